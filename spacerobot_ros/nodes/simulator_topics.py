"""What the simulator publishes: samples of the sensors, clock, momentum book."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from spacerobot_msgs.msg import Ledger

from ..ros.convert import compose, message_type
from ..ros.qos import STATE
from ..sensing.sensors import SensorSamples
from ..simulation.plant import Plant
from ..simulation.truth import sample_messages
from .sensor_node import TOPICS


class SimulatorTopics:
    """Publishers of a simulator, and the samples that were sent last.

    Args:
        node: The simulator.
        has_wheels: Whether the servicer has true rotors.
        ledger_every: Steps from one momentum book to the next.
    """

    def __init__(self, node: Node, has_wheels: bool, ledger_every: int) -> None:
        self._node, self._ledger_every = node, ledger_every
        kinds: dict[str, Any] = {'/clock': Clock, **dict(TOPICS.values()), '~/ledger': Ledger}
        if has_wheels:
            kinds['/wheel_states'] = JointState
        with suppress(ImportError):  # part of ROS, but not of its wheels
            kinds['/tf'] = message_type('tf2_msgs/msg/TFMessage')
        self._publishers = {
            topic: node.create_publisher(kind, topic, STATE) for topic, kind in kinds.items()
        }
        self.forget()

    @property
    def joint_topic(self) -> str:
        """Name of the topic of the joint states."""
        return str(self._publishers['/joint_states'].topic_name)

    @property
    def is_heard(self) -> bool:
        """Whether all subscribers of the joint states, at least one, get what is sent now."""
        takers = self._publishers['/joint_states'].get_subscription_count()
        return 0 < takers == self._node.count_subscribers(self.joint_topic)

    def forget(self) -> None:
        """Drop the samples that could be sent again, and when topics were sent last [ns]."""
        self.sent_ns: dict[str, int] = {}
        self._last: dict[str, Any] = {}

    def publish(self, plant: Plant, samples: SensorSamples) -> None:
        """Publish what is due at a step; the joint states last, for they ask for a command.

        At once when all is composed, so that who waits for several messages wakes up once.
        """
        ns = plant.time_ns
        due = {'/clock': compose.make('rosgraph_msgs/msg/Clock', clock=compose.time(ns))}
        if plant.step_index % self._ledger_every == 0 and self._is_taken('~/ledger'):
            due['~/ledger'] = compose.ledger(ns, plant.ledger())
        if samples.joints is not None and self._is_taken('/tf'):
            robot, state = plant.robot, plant.state
            due['/tf'] = compose.base_frame(ns, robot.base_link, state.p_WB, state.q_WB_xyzw)
        due |= sample_messages(compose, plant, samples)
        self._last |= due
        self.sent_ns |= {self._publishers[topic].topic_name: ns for topic in due}
        for topic, message in due.items():
            self._publishers[topic].publish(message)

    def _is_taken(self, topic: str) -> bool:
        publisher = self._publishers.get(topic)
        return publisher is not None and publisher.get_subscription_count() > 0

    def resend(self, *, with_attitude: bool) -> None:
        """Send the last samples again, that of the star tracker only where it is asked for."""
        left_out = '' if with_attitude else TOPICS['attitude'][0]
        self.repeat_clock()
        for topic, _ in TOPICS.values():
            if topic in self._last and topic != left_out:
                self._publishers[topic].publish(self._last[topic])

    def repeat_clock(self) -> None:
        """Send the time again: who heard another simulator believes it, not a stamp alone."""
        self._publishers['/clock'].publish(self._last['/clock'])
