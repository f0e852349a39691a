"""Messages of arrays, of ROS' classes or of those that rosbags writes: each kind once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ...dynamics.state import MomentumLedger
from ...types import Array, Quaternion, Vector3
from ..messages import INERTIAL_FRAME, SECOND_NS

PACKAGE = 'spacerobot_msgs'
_END_NS = 2**31 * SECOND_NS  # of the whole seconds of a stamp
_ABSENT = np.array([-1.0, *np.zeros(8)])  # a covariance of what is not measured (REP 145)
_NONE, _UNTURNED, _DIAGONAL = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), np.eye(3).ravel()


class Composer:
    """Makes messages.

    Args:
        types: Message class by name, such as `sensor_msgs/msg/Imu`.
        sequence: Makes the content of a float64 sequence of a vector.
    """

    def __init__(self, types: Callable[[str], Any], sequence: Callable[[Array], Any]) -> None:
        self._types, self.sequence = types, sequence

    def make(self, kind: str, **content: Any) -> Any:
        """A message of a type with all its fields."""
        return self._types(kind)(**content)

    def stamped(self, kind: str, ns: int, frame: str = '', **content: Any) -> Any:
        """A message with a header."""
        header = self.make('std_msgs/msg/Header', stamp=self.time(ns), frame_id=frame)
        return self.make(kind, header=header, **content)

    def time(self, ns: int) -> Any:
        """A stamp of whole nanoseconds; of those that no message holds the nearest that one does.

        A caller that continues from the last stamp must not fail.
        """
        sec, nanosec = divmod(min(max(ns, -_END_NS), _END_NS - 1), SECOND_NS)
        return self.make('builtin_interfaces/msg/Time', sec=sec, nanosec=nanosec)

    def vector(self, values: Vector3) -> Any:
        """A Vector3."""
        x, y, z = np.asarray(values, dtype=float).tolist()
        return self.make('geometry_msgs/msg/Vector3', x=x, y=y, z=z)

    def rotation(self, q_xyzw: Quaternion) -> Any:
        """A Quaternion."""
        x, y, z, w = np.asarray(q_xyzw, dtype=float).tolist()
        return self.make('geometry_msgs/msg/Quaternion', x=x, y=y, z=z, w=w)

    def joint_state(
        self,
        ns: int,
        names: Sequence[str],
        position: Array | None = None,
        velocity: Array | None = None,
        effort: Array | None = None,
    ) -> Any:
        """A JointState; what is None stays empty."""
        columns = {'position': position, 'velocity': velocity, 'effort': effort}
        content = {
            name: self.sequence(np.zeros(0) if values is None else values)
            for name, values in columns.items()
        }
        return self.stamped('sensor_msgs/msg/JointState', ns, name=list(names), **content)

    def imu(self, ns: int, base_link: str, omega_WB_B: Vector3, std: float | None = None) -> Any:
        """An Imu with the angular velocity only (REP 145), its standard deviation if known."""
        return self.stamped(
            'sensor_msgs/msg/Imu',
            ns,
            base_link,
            orientation=self.rotation(_UNTURNED),
            orientation_covariance=_ABSENT.copy(),
            angular_velocity=self.vector(omega_WB_B),
            angular_velocity_covariance=(std or 0.0) ** 2 * _DIAGONAL,
            linear_acceleration=self.vector(_NONE),
            linear_acceleration_covariance=_ABSENT.copy(),
        )

    def quaternion(self, ns: int, q_WB_xyzw: Quaternion) -> Any:
        """A QuaternionStamped of an attitude."""
        kind = 'geometry_msgs/msg/QuaternionStamped'
        return self.stamped(kind, ns, INERTIAL_FRAME, quaternion=self.rotation(q_WB_xyzw))

    def base_torque(self, ns: int, base_link: str, torque: Vector3) -> Any:
        """A WrenchStamped of a torque alone, in base coordinates [N m]."""
        force = self.vector(_NONE)
        wrench = self.make('geometry_msgs/msg/Wrench', force=force, torque=self.vector(torque))
        return self.stamped('geometry_msgs/msg/WrenchStamped', ns, base_link, wrench=wrench)

    def base_frame(self, ns: int, base_link: str, p_WB: Vector3, q_WB_xyzw: Quaternion) -> Any:
        """A TFMessage from the inertial frame to the base."""
        pose = self.make(
            'geometry_msgs/msg/Transform',
            translation=self.vector(p_WB),
            rotation=self.rotation(q_WB_xyzw),
        )
        transform = self.stamped(
            'geometry_msgs/msg/TransformStamped',
            ns,
            INERTIAL_FRAME,
            child_frame_id=base_link,
            transform=pose,
        )
        return self.make('tf2_msgs/msg/TFMessage', transforms=[transform])

    def momentum(self, ns: int, link: str, h: Vector3) -> Any:
        """A Vector3Stamped of a link's wheel momentum [N m s], in its frame."""
        return self.stamped('geometry_msgs/msg/Vector3Stamped', ns, link, vector=self.vector(h))

    def ledger(self, ns: int, ledger: MomentumLedger) -> Any:
        """A Ledger: the simulated machine's momentum and energy book."""
        return self.stamped(
            f'{PACKAGE}/msg/Ledger',
            ns,
            INERTIAL_FRAME,
            linear_momentum=self.vector(ledger.linear),
            angular_momentum=self.vector(ledger.angular),
            kinetic_energy=ledger.kinetic,
            potential_energy=ledger.potential,
            joint_work=ledger.joint_work,
            angular_impulse=self.vector(ledger.angular_impulse),
            momentum_drift=ledger.momentum_drift,
            energy_drift=ledger.energy_drift,
        )
