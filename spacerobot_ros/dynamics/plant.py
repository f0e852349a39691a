"""The simulated machine: state, held torques, momentum and energy ledger.

Times are whole numbers: `time_ns = step_index * period_ns`, never a sum of floating-point periods.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import ConfigurationError, MessageRejectedError, SimulationDivergedError
from ..model.robot import Robot
from ..types import Array, Vector3, Vector6
from .equations import Dynamics
from .integrate import hold_step, rk4_step
from .rotation import cross, rotation_matrix
from .state import State


@dataclass(frozen=True, slots=True, eq=False)
class MomentumLedger:
    """What a closed system must keep, and what the simulated one did since its start.

    Args:
        linear: (3,) linear momentum in the inertial frame [N s].
        angular: (3,) angular momentum about the system's centre of mass, wheels included, inertial
            frame [N m s].
        kinetic: Kinetic energy without the gyrostats' own constant spin energy [J].
        potential: Energy in the gravity field [J].
        joint_work: Work of the joint torques since the start [J].
        base_work: Work of the base force and torque since the start [J].
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
    angular_impulse: Vector3
    momentum_drift: float
    energy_drift: float


class Plant:
    """A robot that moves: torques in, state out.

    The torque given to `step` is held over the step, from `step_index` to `step_index + 1`;
    afterwards `effort` is that torque, so a sensor sampled at stamp k sees the torque applied over
    the step that ended at k (zero at k = 0). True rotors turn without torque on their axis.

    Args:
        robot: What the machine really is (`model.loader.true_robot`).
        initial: State at step 0.
        period: Control period [s], a whole number of nanoseconds after rounding.
        substeps: Runge-Kutta steps in one period.

    Raises:
        ConfigurationError: period or substeps not positive, or a state that doesn't fit the robot.
    """

    def __init__(self, robot: Robot, initial: State, period: float, substeps: int) -> None:
        self.robot = robot
        self.n_arm = robot.n_joints - robot.rotor_count
        self.period_ns = round(period * 1e9)
        self.substeps = substeps
        if self.period_ns < 1 or substeps < 1:
            raise ConfigurationError(
                'simulator', f'period {period:g} s and {substeps} substeps must be positive'
            )
        if initial.q.shape != (robot.n_joints,) or initial.qd.shape != (robot.n_joints,):
            raise ConfigurationError(
                'initial',
                f'expected {robot.n_joints} joints, rotors included, got {len(initial.q)}',
            )
        self.dynamics = Dynamics(robot)
        self.step_index = 0
        self.effort: Array = np.zeros(self.n_arm)
        self._x = initial.to_vector()
        self._joint_work = 0.0
        self._base_work = 0.0
        self._impulse = np.zeros(3)
        self._start_momentum = self.dynamics.momentum(initial)[3:]
        self._start_energy = sum(self.dynamics.energy(initial))

    @property
    def period(self) -> float:
        """Control period [s]."""
        return self.period_ns / 1e9

    @property
    def time_ns(self) -> int:
        """Simulated time since the start [ns]."""
        return self.step_index * self.period_ns

    @property
    def state(self) -> State:
        """The state at `time_ns`; a copy."""
        return State.from_vector(self._x.copy())

    def step(self, tau: Array, base_wrench: Vector6 | None = None) -> None:
        """Advance by one control period.

        Args:
            tau: (n_arm,) joint torques held over the period [N m].
            base_wrench: (6,) [force; torque] held on the base, at its origin in base coordinates
                [N, N m].

        Raises:
            MessageRejectedError: torques of the wrong shape or not finite; the plant stays as it
                was.
            SimulationDivergedError: the new state is not finite; the plant stays as it was.
        """
        tau = _checked(tau, self.n_arm, 'joint torque')
        wrench = None if base_wrench is None else _checked(base_wrench, 6, 'base wrench')
        torque = np.concatenate([tau, np.zeros(self.robot.rotor_count)])
        t = self.time_ns / 1e9
        if wrench is None or not wrench.any() or not self.robot.is_free:
            x = hold_step(self.dynamics, self._x, torque, self.period, self.substeps, t=t)
        else:
            x = self._step_with_wrench(torque, wrench, t)
        arm = slice(7, 7 + self.n_arm)
        self._joint_work += float(
            tau @ (x[arm] - self._x[arm])
        )  # exact: the torque is constant over the step
        self._x = x
        self.effort = tau
        self.step_index += 1

    def ledger(self) -> MomentumLedger:
        """Momentum and energy now, and what of them is unaccounted for."""
        state = State.from_vector(self._x)
        momentum = self.dynamics.momentum(state)
        kinetic, potential = self.dynamics.energy(state)
        drift = 0.0
        if self.robot.is_free:
            scale = float(np.linalg.norm(self._start_momentum))
            drift = float(np.linalg.norm(momentum[3:] - self._start_momentum - self._impulse)) / (
                scale or 1.0
            )
        return MomentumLedger(
            linear=momentum[:3],
            angular=momentum[3:],
            kinetic=kinetic,
            potential=potential,
            joint_work=self._joint_work,
            base_work=self._base_work,
            angular_impulse=self._impulse.copy(),
            momentum_drift=drift,
            energy_drift=kinetic
            + potential
            - self._start_energy
            - self._joint_work
            - self._base_work,
        )

    def _step_with_wrench(self, torque: Array, wrench: Vector6, t: float) -> Array:
        """One period with a base wrench; impulse and work are integrated beside the state."""
        size = len(self._x)

        def rate(_: float, y: Array) -> Array:
            return np.concatenate(
                [
                    self.dynamics.rate(y[:size], torque, wrench),
                    self._external_rates(y[:size], wrench),
                ]
            )

        y = np.concatenate([self._x, np.zeros(4)])
        for _ in range(self.substeps):
            y = rk4_step(rate, t, y, self.period / self.substeps)
            y[3:7] /= np.linalg.norm(y[3:7])
        if not np.all(np.isfinite(y)):
            raise SimulationDivergedError(
                t, f'non-finite state under a base wrench of {np.max(np.abs(wrench)):g}'
            )
        self._impulse = self._impulse + y[size : size + 3]
        self._base_work += float(y[size + 3])
        return y[:size]

    def _external_rates(self, x: Array, wrench: Vector6) -> Array:
        """(4,) torque about the centre of mass, inertial frame, and power of the wrench."""
        state = State.from_vector(x)
        torque = wrench[3:]
        if wrench[:3].any():
            torque = torque - cross(self._centre_of_mass(state.q), wrench[:3])
        power = wrench[:3] @ state.v_WB_B + wrench[3:] @ state.omega_WB_B
        return np.append(rotation_matrix(state.q_WB_xyzw) @ torque, power)

    def _centre_of_mass(self, q: Array) -> Vector3:
        """(3,) centre of mass in base coordinates; the mass matrix holds m skew(c)."""
        M = self.dynamics.mass_matrix(q)
        return np.array([M[5, 1], M[3, 2], M[4, 0]]) / M[0, 0]


def _checked(values: Array, size: int, what: str) -> Array:
    array = np.array(values, dtype=float)
    if array.shape != (size,):
        raise MessageRejectedError(f'{what}: expected {size} numbers, got shape {array.shape}')
    if not np.all(np.isfinite(array)):
        raise MessageRejectedError(f'{what}: not finite: {array.tolist()}')
    return array
