"""What nodes that follow sensors have in common: newest samples, stamps that jump.

A stamp that jumps alone is counted and left out; a clock that jumped begins another segment.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from geometry_msgs.msg import QuaternionStamped
from rclpy.clock import JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Imu, JointState

from ..errors import MessageRejectedError
from ..model.robot import Robot
from ..recording import messages
from ..recording.buffer import JUMP_NS, PATIENCE_NS
from ..recording.clock_jumps import Judgement, JumpDetector, Sample, refusal
from ..ros.diagnostics import OK, STALE, WARN, Status
from .base import RobotNode

TOPICS: dict[str, tuple[str, Any]] = {
    'imu': ('/imu/data', Imu),
    'attitude': ('/attitude', QuaternionStamped),
    'joints': ('/joint_states', JointState),
}
"""Topic and message type of every sensor."""


def outliers(left_out: Mapping[str, int]) -> dict[str, object]:
    """Samples of each sensor that were left out, as figures of a status."""
    return {f'{TOPICS[sensor][0]} outliers [messages]': n for sensor, n in left_out.items()}


class SensorNode(RobotNode):
    """A node that follows sensors.

    Attributes:
        latest: Stamp [ns] and content of the newest sample of each sensor.
        jump_ns: Stamps that jump further are doubted [ns].
        bridged_ns: The clock may jump ahead by as much without another segment [ns].
    """

    jump_ns = JUMP_NS
    bridged_ns: float = math.inf

    def __init__(self, name: str, **node_kwargs: Any) -> None:
        super().__init__(name, **node_kwargs)
        self.latest: dict[str, tuple[Any, ...]] = {}
        self._sensors: tuple[str, ...] = ()
        self._jumps = JumpDetector(self.jump_ns)

    @abstractmethod
    def take(self, sensor: str, stamp_ns: int, *content: Any) -> None:
        """Use a sample; raise MessageRejectedError where it must not be used."""

    @abstractmethod
    def restart(self, why: str) -> None:
        """Begin another run; the newest samples are forgotten already."""

    def begin_segment(self, why: str, jump_ns: int | None) -> None:
        """Go on in another time; the newest samples are forgotten already.

        Args:
            why: In words.
            jump_ns: By how much stamps jumped [ns]; None: back, and /clock with them.
        """
        self.restart(why)

    def follow(
        self,
        robot: Robot,
        sensors: Iterable[str],
        qos: QoSProfile,
        *,
        efforts: bool = False,
    ) -> None:
        """Subscribe to sensors.

        Args:
            robot: Gives the frame of the gyro and the joints' names.
            sensors: Names in `TOPICS`.
            qos: Of the subscriptions.
            efforts: Whether the joints' efforts are wanted; None where there are none.
        """
        self._sensors = tuple(sensors)
        names = list(robot.arm)
        units = robot.effort_units if efforts else None
        read: dict[str, Callable[[Any], tuple[Any, ...]]] = {
            'imu': lambda m: messages.angular_rate(m, robot.base_link),
            'attitude': messages.attitude,
            'joints': lambda m: messages.joint_sample(m, names, effort_units=units),
        }
        for sensor in self._sensors:
            topic, kind = TOPICS[sensor]
            take = partial(self._on_sample, sensor, read[sensor])
            self.listen_to_driver(topic, kind, qos, take)
        self._jumps = JumpDetector(self.jump_ns)
        moves = JumpThreshold(
            min_forward=Duration(nanoseconds=1),
            min_backward=Duration(nanoseconds=-1),
            on_clock_change=False,
        )
        self._jump = self.get_clock().create_jump_callback(moves, post_callback=self._on_time)

    def _on_time(self, jump: TimeJump) -> None:
        self._jumps.hear_clock(jump.delta.nanoseconds)
        if self._jumps.is_doubtful:
            self._use(self._jumps.judge_held(self.now_ns))

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the run."""
        self.reset('cleaned up')
        return super().on_cleanup(state)

    def reset(self, why: str) -> None:
        """Forget the run."""
        self.latest = {}
        self._jumps.clear()
        self.restart(why)

    def newest_ns(self) -> int | None:
        """Newest stamp of a sensor that is believed [ns]; None before the first."""
        return self._jumps.newest_ns

    def input_status(self) -> Status:
        """Which sensors arrive."""
        newest = max((sample[0] for sample in self.latest.values()), default=None)
        if newest is None:
            return Status('inputs', STALE, 'nothing received yet')
        values: dict[str, object] = {}
        late = []
        for sensor in self._sensors:
            topic, sample = TOPICS[sensor][0], self.latest.get(sensor)
            lag = 'never received' if sample is None else (newest - sample[0]) * 1e-9
            values[f'{topic} lag [s]'] = lag
            if sample is None or newest - sample[0] > PATIENCE_NS:
                late.append(topic)
        if late:
            return Status('inputs', WARN, f'no samples from {", ".join(late)}', values)
        return Status('inputs', OK, 'all sensors arrive', values)

    def _on_sample(
        self, sensor: str, read: Callable[[Any], tuple[Any, ...]], message: Any
    ) -> None:
        stamp, *content = read(message)
        self._use(self._jumps.judge(Sample(sensor, stamp, tuple(content)), self._clock_ns))

    def _clock_ns(self) -> int | None:
        """Time of /clock [ns]; None where the node runs on another one."""
        return self.now_ns() if self.get_clock().ros_time_is_active else None

    def _use(self, judgement: Judgement) -> None:
        for sample in judgement.refused:
            newest_ns = max((sample[0] for sample in self.latest.values()), default=None)
            self.health.reject(TOPICS[sample.sensor][0], refusal(sample, newest_ns))
        jump_ns = judgement.jump_ns
        if jump_ns is not None and not 0 <= jump_ns <= self.bridged_ns:
            self.latest = {}
            where, now_ns = TOPICS[judgement.taken[0].sensor][0], self._clock_ns()
            is_now = (
                now_ns is not None and abs(judgement.taken[-1].stamp_ns - now_ns) <= self.jump_ns
            )
            if jump_ns < 0 and is_now:  # a wrong /clock alone goes nowhere
                self.begin_segment('/clock went back', None)
            else:
                self.begin_segment(f'stamps of {where} jumped by {jump_ns * 1e-9:.3f} s', jump_ns)
        for sensor, stamp, content in judgement.taken:
            try:
                self.take(sensor, stamp, *content)
            except MessageRejectedError as error:
                self.health.reject(TOPICS[sensor][0], error)
                continue
            if sensor not in self.latest or stamp > self.latest[sensor][0]:
                self.latest[sensor] = (stamp, *content)
