"""What the simulator publishes: samples of the sensors, clock, momentum book."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import QuaternionStamped
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from spacerobot_msgs.msg import Ledger

from ..ros.convert import compose
from ..ros.qos import STATE
from ..sensing.sensors import SensorSamples
from ..simulation.plant import Plant


class SimulatorTopics:
    """Publishers of a simulator, and the samples that were sent last.

    Args:
        node: The simulator.
        joints: Names of the manipulator joints.
        wheels: Names of the servicer's true rotors.
        base_link: Frame of the gyro.
        gyro_std: Standard deviation of a gyro sample [rad/s]; None where it is not known.
        ledger_every: Steps from one momentum book to the next.
    """

    def __init__(
        self,
        node: Node,
        joints: Sequence[str],
        wheels: Sequence[str],
        base_link: str,
        gyro_std: float | None,
        ledger_every: int,
    ) -> None:
        self._joint_names, self._wheel_names = list(joints), list(wheels)
        self._base_link, self._gyro_std, self._ledger_every = base_link, gyro_std, ledger_every
        self._clock = node.create_publisher(Clock, '/clock', STATE)
        self._imu = node.create_publisher(Imu, '/imu/data', STATE)
        self._attitude = node.create_publisher(QuaternionStamped, '/attitude', STATE)
        self._joints = node.create_publisher(JointState, '/joint_states', STATE)
        self._ledger = node.create_publisher(Ledger, '~/ledger', STATE)
        if self._wheel_names:
            self._wheels = node.create_publisher(JointState, '/wheel_states', STATE)
        self.forget()

    @property
    def takers(self) -> int:
        """Number of subscribers to the joint states."""
        return int(self._joints.get_subscription_count())

    @property
    def n_wheels(self) -> int:
        """Number of the servicer's true rotors."""
        return len(self._wheel_names)

    def forget(self) -> None:
        """Drop the samples that could be sent again."""
        self._last_imu: Imu | None = None
        self._last_attitude: QuaternionStamped | None = None
        self._last_joints: JointState | None = None

    def publish(self, plant: Plant, sample: SensorSamples) -> None:
        """Publish what is due at a step; the joint states last, for they ask for a command."""
        ns = plant.time_ns
        self._clock.publish(Clock(clock=compose.time(ns)))
        if sample.omega is not None and plant.robot.is_free:
            self._last_imu = compose.imu(ns, self._base_link, sample.omega, self._gyro_std)
            self._imu.publish(self._last_imu)
        if sample.attitude_xyzw is not None:
            self._last_attitude = compose.quaternion(ns, sample.attitude_xyzw)
            self._attitude.publish(self._last_attitude)
        if sample.wheel_rates is not None:
            rates = np.asarray(sample.wheel_rates)
            self._wheels.publish(compose.joint_state(ns, self._wheel_names, velocity=rates))
        if plant.step_index % self._ledger_every == 0:
            self._ledger.publish(compose.ledger(ns, plant.ledger()))
        if sample.joints is not None:
            j = sample.joints
            self._last_joints = compose.joint_state(
                ns, self._joint_names, j.position, j.velocity, j.effort
            )
            self._joints.publish(self._last_joints)

    def resend(self, *, with_attitude: bool) -> None:
        """Send the last samples again, that of the star tracker only where it is asked for."""
        if self._last_imu is not None:
            self._imu.publish(self._last_imu)
        if self._last_attitude is not None and with_attitude:
            self._attitude.publish(self._last_attitude)
        if self._last_joints is not None:
            self._joints.publish(self._last_joints)
