"""What all nodes have in common: settings, robot, health; and of those that follow sensors, more.

Messages that must not be used are counted by reason. A stamp that jumps alone is one of them; a
clock that jumped begins another segment of time.
"""

from __future__ import annotations

import math
import time
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache, partial
from typing import Any

from geometry_msgs.msg import QuaternionStamped
from rclpy.clock import Clock, ClockType, JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger

from ..errors import MessageRejectedError, SpaceRobotError
from ..model.robot import Robot
from ..model.settings import Settings
from ..recording import messages
from ..recording.bags.message_types import decoded
from ..recording.buffer import JUMP_NS, PATIENCE_NS
from ..recording.clock_jumps import Judgement, JumpDetector, Sample, refusal
from ..ros.convert import type_name
from ..ros.diagnostics import OK, STALE, WARN, NodeHealth, Status
from ..ros.params import declare_settings, let_change, open_robot
from ..ros.qos import best_effort

TOPICS: dict[str, tuple[str, Any]] = {
    'imu': ('/imu/data', Imu),
    'attitude': ('/attitude', QuaternionStamped),
    'joints': ('/joint_states', JointState),
}
"""Topic and message type of every sensor."""

_heard = lru_cache(maxsize=len(TOPICS))(decoded)
"""Nodes of one process hear the same messages, and need decode them but once."""


def outliers(left_out: Mapping[str, int]) -> dict[str, object]:
    """Samples of each sensor that were left out, as figures of a status."""
    return {f'{TOPICS[sensor][0]} outliers [messages]': n for sensor, n in left_out.items()}


class RobotNode(LifecycleNode):
    """A lifecycle node about one robot, whose parameters are those of a robot file.

    It configures and activates itself as soon as the robot is known, unless `autostart` is false.

    Args:
        name: Of the node.
        node_kwargs: Node arguments of rclpy.

    Attributes:
        settings: All settings.
        health: What it says on /diagnostics.
        is_open: Whether the robot is known.
        is_active: Whether it does its work.
        live: Parameters that may change while it runs (`retune`).
        steady: Clock of timers that go on while no time is simulated.
        wall_ns: Time of such a clock [ns], for a tenth of what asking a Clock of rclpy takes.
        schedule: Settles which process goes before others, where the node has one of its own.

    Raises:
        ConfigurationError: bad parameters.
    """

    live: frozenset[str] = frozenset()
    wall_ns: Callable[[], int] = staticmethod(time.monotonic_ns)
    is_open = is_active = False
    schedule: Callable[[], None] = staticmethod(lambda: None)

    def __init__(self, name: str, **node_kwargs: Any) -> None:
        super().__init__(name, **node_kwargs)
        with self._destroyed_by_failure():
            self.settings = declare_settings(self)
        self.health = NodeHealth(self)
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)
        let_change(self, lambda: self.settings, self.live, self.retune)

    @abstractmethod
    def on_robot(self, robot: Robot) -> None:
        """Take up the robot, once it is known."""

    def retune(self, settings: Settings) -> None:
        """Take up settings in which parameters in `live` may differ.

        Raises:
            ConfigurationError: they can't be; nothing has changed.
        """
        self.settings = settings

    def find_robot(self) -> None:
        """Have `on_robot` called: now, or when /robot_description says what the robot is."""

        def use(robot: Robot) -> None:
            self.on_robot(robot)
            if self.get_parameter('autostart').value:
                self.trigger_configure()
                self.trigger_activate()

        with self._destroyed_by_failure():
            open_robot(self, self.settings, use)

    @contextmanager
    def _destroyed_by_failure(self) -> Iterator[None]:
        """Leave no half-made node, which would keep its name."""
        try:
            yield
        except SpaceRobotError:
            self.destroy_node()
            raise

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Fails while there is no robot."""
        if not self.is_open:
            self.get_logger().warning('no robot yet: waiting for /robot_description')
            return TransitionCallbackReturn.FAILURE
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start to work."""
        self.is_active = True
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop to work; what is known is kept."""
        self.is_active = False
        return super().on_deactivate(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop for good."""
        self.is_active = False
        return super().on_shutdown(state)

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[..., None], *args: Any, **kwargs: Any
    ) -> Any:
        """As of rclpy, whose own listener to /clock would end the node at a time before zero."""

        def take(message: Any) -> None:
            if message.clock.sec >= 0:
                callback(message)
            else:
                why = '/clock: a time before zero is left out'
                self.get_logger().warning(why, throttle_duration_sec=2.0)

        use = take if msg_type is ClockMessage else callback
        return super().create_subscription(msg_type, topic, use, *args, **kwargs)

    def listen(
        self,
        topic: str,
        kind: Any,
        qos: QoSProfile,
        take: Callable[[Any], None],
        events: SubscriptionEventCallbacks | None = None,
    ) -> Any:
        """Subscribe; a message for which `take` raises MessageRejectedError is counted.

        Messages are those that a bag's reader sees, which cost less than rclpy's own.
        """
        name = type_name(kind)

        def on_message(cdr: bytes) -> None:
            try:
                take(_heard(name, cdr))
            except MessageRejectedError as error:
                self.health.reject(topic, error)

        return self.create_subscription(
            kind, topic, on_message, qos, event_callbacks=events, raw=True
        )

    def listen_to_driver(
        self, topic: str, kind: Any, qos: QoSProfile, take: Callable[[Any], None]
    ) -> None:
        """Subscribe as `listen`, reliably; where a driver offers best effort alone, so."""
        heard: list[Any] = []

        def on_mismatch(_: Any) -> None:
            if len(heard) == 1:
                self.get_logger().info(f'{topic} is offered with best effort: taken so')
                heard.append(self.listen(topic, kind, best_effort(qos), take))
                self.destroy_subscription(heard[0])

        events = SubscriptionEventCallbacks(incompatible_qos=on_mismatch)
        heard.append(self.listen(topic, kind, qos, take, events))

    def offer(self, name: str, act: Callable[[], tuple[bool, str]]) -> None:
        """Offer a Trigger service that answers with success and a message."""

        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = act()
            return response

        self.create_service(Trigger, name, answer)

    def now_ns(self) -> int:
        """Time of the node's clock [ns]."""
        return int(self.get_clock().now().nanoseconds)


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
