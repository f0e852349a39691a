"""What all nodes have in common: settings, robot, health; and of those that follow sensors, more.

Messages that must not be used are counted by reason; stamps or a clock that go back are another
run, and the node starts again.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from geometry_msgs.msg import QuaternionStamped
from rclpy.clock import Clock, ClockType, JumpThreshold
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger

from ..errors import MessageRejectedError
from ..model.robot import Robot
from ..recording import messages
from ..recording.buffer import JUMP_NS, PATIENCE_NS
from ..ros.diagnostics import OK, STALE, WARN, NodeHealth, Status
from ..ros.params import declare_settings, open_robot

TOPICS: dict[str, tuple[str, Any]] = {
    'imu': ('/imu/data', Imu),
    'attitude': ('/attitude', QuaternionStamped),
    'joints': ('/joint_states', JointState),
}
"""Topic and message type of every sensor."""


class RobotNode(Node):
    """A node about one robot, whose parameters are those of a robot file.

    Args:
        name: Of the node.
        node_kwargs: Node arguments of rclpy.

    Attributes:
        settings: All settings.
        health: What it says on /diagnostics.
        is_open: Whether the robot is known.

    Raises:
        ConfigurationError: bad parameters.
    """

    def __init__(self, name: str, **node_kwargs: Any) -> None:
        super().__init__(name, **node_kwargs)
        self.settings = declare_settings(self)
        self.health = NodeHealth(self)
        self.is_open = False
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)

    @abstractmethod
    def on_robot(self, robot: Robot) -> None:
        """Take up the robot, once it is known."""

    def find_robot(self) -> None:
        """Have `on_robot` called: now, or when /robot_description says what the robot is."""
        open_robot(self, self.settings, self.on_robot)

    def listen(self, topic: str, kind: Any, qos: QoSProfile, take: Callable[[Any], None]) -> Any:
        """Subscribe; a message for which `take` raises MessageRejectedError is counted."""

        def on_message(message: Any) -> None:
            try:
                take(message)
            except MessageRejectedError as error:
                self.health.reject(topic, error)

        return self.create_subscription(kind, topic, on_message, qos)

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
        jump_ns: Stamps that go back further are another run [ns].
    """

    jump_ns = JUMP_NS

    def __init__(self, name: str, **node_kwargs: Any) -> None:
        super().__init__(name, **node_kwargs)
        self.latest: dict[str, tuple[Any, ...]] = {}
        self._sensors: tuple[str, ...] = ()

    @abstractmethod
    def take(self, sensor: str, stamp_ns: int, *content: Any) -> None:
        """Use a sample; raise MessageRejectedError where it must not be used."""

    @abstractmethod
    def restart(self, why: str) -> None:
        """Begin another run; the newest samples are forgotten already."""

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
            self.listen(topic, kind, qos, partial(self._on_sample, sensor, read[sensor]))
        backward = JumpThreshold(
            min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=False
        )
        self._jump = self.get_clock().create_jump_callback(
            backward, post_callback=lambda _: self._on_clock_jump()
        )

    def reset(self, why: str) -> None:
        """Forget the run."""
        self.latest = {}
        self.restart(why)

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
        if sensor in self.latest and stamp < self.latest[sensor][0] - self.jump_ns:
            back = (self.latest[sensor][0] - stamp) * 1e-9
            self.reset(f'stamps of {TOPICS[sensor][0]} went back by {back:.3f} s')
        self.take(sensor, stamp, *content)
        if sensor not in self.latest or stamp > self.latest[sensor][0]:
            self.latest[sensor] = (stamp, *content)

    def _on_clock_jump(self) -> None:
        newest = max((sample[0] for sample in self.latest.values()), default=0)
        if newest > self.now_ns():  # not if the stamps went back before
            self.reset('/clock went back')
