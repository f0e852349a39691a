"""The state of a simulated robot, also as the flat vector of integrators, and what it keeps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import ConfigurationError
from ..model.motion_settings import InitialSettings
from ..model.robot import Robot
from ..types import Array, Quaternion, Vector3

LEDGER_PERIOD = 0.1  # s between two looks at what the system keeps


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Configuration and velocity of the robot.

    Args:
        p_WB: (3,) base origin in the inertial frame [m].
        q_WB_xyzw: (4,) attitude, Hamilton, takes base to inertial coordinates.
        q: (n,) joint positions [rad].
        v_WB_B: (3,) velocity of the base origin, in base coordinates [m/s].
        omega_WB_B: (3,) angular velocity of the base, in base coordinates [rad/s].
        qd: (n,) joint rates [rad/s].
    """

    p_WB: Vector3
    q_WB_xyzw: Quaternion
    q: Array
    v_WB_B: Vector3
    omega_WB_B: Vector3
    qd: Array

    def to_vector(self) -> Array:
        """(13 + 2 n,) in the order of the fields."""
        return np.concatenate(
            [self.p_WB, self.q_WB_xyzw, self.q, self.v_WB_B, self.omega_WB_B, self.qd]
        )

    @classmethod
    def from_vector(cls, x: Array) -> State:
        """Inverse of `to_vector`."""
        n = (len(x) - 13) // 2
        return cls(x[:3], x[3:7], x[7 : 7 + n], x[7 + n : 10 + n], x[10 + n : 13 + n], x[13 + n :])


def initial_state(robot: Robot, initial: InitialSettings) -> State:
    """State at the start of a run; the base origin is at rest at the inertial origin.

    `Dynamics.at_rest_centre` gives the same state with the system's centre of mass at rest.

    Rotors start at their own rates, the manipulator joints at `initial`.

    Raises:
        ConfigurationError: wrong lengths, or a quaternion that is not normalized within 1e-3.
    """
    n_arm = robot.n_joints - robot.rotor_count
    q = _joint_values(initial.joint_position, n_arm, 'initial.joint_position')
    qd = _joint_values(initial.joint_velocity, n_arm, 'initial.joint_velocity')
    attitude = np.array(initial.attitude_xyzw)
    norm = float(np.linalg.norm(attitude))
    if abs(norm - 1.0) > 1e-3:
        why = f'must be a unit quaternion, its norm is {norm:g}'
        raise ConfigurationError('initial.attitude_xyzw', why)
    if not robot.is_free and any(initial.angular_velocity):
        raise ConfigurationError('initial.angular_velocity', 'must be zero for a fixed base')
    zeros = np.zeros(3)
    return State(
        zeros,
        attitude / norm,
        np.concatenate([q, np.zeros(robot.rotor_count)]),
        zeros,
        np.array(initial.angular_velocity),
        np.concatenate([qd, robot.rotor_rates]),
    )


def _joint_values(values: tuple[float, ...], n: int, place: str) -> Array:
    if values and len(values) != n:
        raise ConfigurationError(place, f'expected {n} numbers (one a joint), got {len(values)}')
    return np.array(values) if values else np.zeros(n)


@dataclass(frozen=True, slots=True, eq=False)
class MomentumLedger:
    """What a closed system must keep, and what the simulated one did since its start.

    Args:
        linear: (3,) linear momentum in the inertial frame [N s].
        angular: (3,) angular momentum about the centre of mass, wheels and what effects hold
            included, inertial frame [N m s].
        kinetic: Kinetic energy without the gyrostats' own constant spin energy [J].
        potential: Energy in the gravity field [J].
        joint_work: Work of the joint torques since the start [J].
        base_work: Work of the base force and torque since the start [J].
        effect_work: Work of all physical effects since the start [J].
        linear_impulse: (3,) time integral of the external force, gravity included, inertial frame
            [N s].
        angular_impulse: (3,) time integral of the external torque about the centre of mass,
            inertial frame [N m s].
        momentum_drift: |h - h0 - angular_impulse| / |h0|; absolute [N m s] when h0 is zero. Zero
            for a fixed base, whose mount takes any torque, so that nothing is kept.
        energy_drift: Kinetic and potential energy, less those at the start, less all work [J].
    """

    linear: Vector3
    angular: Vector3
    kinetic: float
    potential: float
    joint_work: float
    base_work: float
    effect_work: float
    linear_impulse: Vector3
    angular_impulse: Vector3
    momentum_drift: float
    energy_drift: float
