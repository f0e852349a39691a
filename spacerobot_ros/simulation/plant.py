"""The simulated machine: state, held torques, momentum and energy ledger.

Times are whole numbers: `time_ns = step_index * period_ns`, never a sum of floating-point periods.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..dynamics.equations import Dynamics
from ..dynamics.integrate import DOP853, Holding, Tableau
from ..dynamics.state import MomentumLedger, State
from ..effects.effect import Effect
from ..errors import ConfigurationError, MessageRejectedError, SimulationDivergedError
from ..formats import counted
from ..model.robot import Robot
from ..types import Array, Vector6
from .forced import ForcedMotion, fastest_mode, steps_of


class Plant:
    """A robot that moves: torques in, state out.

    The torque given to `step` is held over the step, from `step_index` to `step_index + 1`;
    afterwards `effort` is that torque, so a sensor sampled at stamp k sees the torque applied over
    the step that ended at k (zero at k = 0). True rotors turn without torque on their axis.

    Args:
        robot: What the machine really is, its effects' changes made (`truth.true_robot`).
        initial: State at step 0.
        period: Control period [s], a whole number of nanoseconds after rounding.
        substeps: Runge-Kutta steps in one period; more where the robot or an effect is fast.
        effects: Physical effects that act on it.
        tableau: Runge-Kutta method: DOP853 keeps momentum to rounding, RK4 is right to 1e-6.

    Raises:
        ConfigurationError: period or substeps not positive, a state that doesn't fit the robot, or
            an effect that is too fast for the period.
    """

    def __init__(
        self,
        robot: Robot,
        initial: State,
        period: float,
        substeps: int,
        effects: Sequence[Effect] = (),
        tableau: Tableau = DOP853,
    ) -> None:
        self.robot = robot
        self.effects = tuple(effects)
        self.n_arm = robot.n_joints - robot.rotor_count
        self.period_ns = round(period * 1e9)
        if self.period_ns < 1 or substeps < 1:
            why = f'period {period:g} s and {substeps} substeps must be positive'
            raise ConfigurationError('simulator', why)
        if initial.q.shape != (robot.n_joints,) or initial.qd.shape != (robot.n_joints,):
            expected = f'{counted(robot.n_joints, "joint")}, rotors included'
            why = f'expected {expected}, got {len(initial.q)}'
            raise ConfigurationError('initial', why)
        self.dynamics = Dynamics(robot)
        self.step_index = 0
        self.effort: Array = np.zeros(self.n_arm)
        self._x = initial.to_vector()
        self._joint_work = 0.0
        self._driven = 1.0 - np.isin(robot.arm, robot.passive_joints)
        self._torque, self._arm = np.zeros(robot.n_joints), slice(7, 7 + self.n_arm)
        nutation = fastest_mode(self.dynamics, self._x)
        substeps = max(substeps, steps_of(nutation, 'robot', self.period, tableau))
        self._free = Holding(self.dynamics, self.period, substeps, tableau)
        self._forced = ForcedMotion(self.dynamics, effects, self.period, substeps, tableau)
        self.substeps = self._forced.substeps
        self._integrals = np.zeros(8)  # of `ForcedMotion.step`
        self._weight = robot.is_free * robot.gravity * np.sum(robot.inertial_parameters[:, 0])
        self._start_momentum = self._momentum()[3:]
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

    @property
    def hidden(self) -> Array:
        """Own states of all effects, one effect after the other (`effects.effect.own_states`)."""
        return self._forced.hidden

    @np.errstate(over='ignore', invalid='ignore', divide='ignore')  # such states are refused
    def step(
        self, tau: Array, base_wrench: Vector6 | None = None, *, fastest: float = math.inf
    ) -> None:
        """Advance by one control period.

        Args:
            tau: (n_arm,) joint torques held over the period [N m]; those of joints without a motor
                are zero, whatever is commanded.
            base_wrench: (6,) [force; torque] held on the base, at its origin in base coordinates
                [N, N m].
            fastest: Sum of the rates of base and joints [rad/s] beyond which no torque may lead.

        Raises:
            MessageRejectedError: torques of the wrong shape or not finite; the plant stays as it
                was.
            SimulationDivergedError: the new state is not finite, or torques made it too fast; the
                plant stays as it was.
        """
        tau = _checked(tau, self.n_arm, 'joint torque') * self._driven
        wrench = None if base_wrench is None else _checked(base_wrench, 6, 'base wrench')
        has_wrench = wrench is not None and self.robot.is_free and bool(wrench.any())
        torque, arm = self._torque, self._arm
        torque[: self.n_arm] = tau
        t = self.time_ns / 1e9
        integrals = None
        if self._forced.is_free_of_forces and not has_wrench:
            x = self._free.step(self._x, torque, None, t)
        else:
            external = wrench if has_wrench and wrench is not None else np.zeros(6)
            x, integrals = self._forced.step(self._x, torque, external, t)
        if fastest < math.inf and (has_wrench or tau.any()):
            turning = 10 + self.robot.n_joints  # rates of the base, then those of the joints
            rate = float(np.abs(x[turning : turning + 3 + self.n_arm]).sum())
            if rate > fastest:
                raise SimulationDivergedError(t, f'a torque would lead to {rate:.3g} rad/s')
        if integrals is not None:
            self._integrals += integrals
        # exact: the torque is constant over the step
        self._joint_work += float(tau @ (x[arm] - self._x[arm]))
        self._x, self.effort = x, tau
        self.step_index += 1

    def ledger(self) -> MomentumLedger:
        """Momentum and energy now, and what of them is unaccounted for."""
        momentum, integrals = self._momentum(), self._integrals.copy()
        kinetic, potential = self.dynamics.energy(State.from_vector(self._x))
        base_work, effect_work = integrals[6:].tolist()
        work = self._joint_work + base_work + effect_work
        drift = 0.0
        if self.robot.is_free:
            scale = float(np.linalg.norm(self._start_momentum))
            change = momentum[3:] - self._start_momentum
            drift = float(np.linalg.norm(change - integrals[3:6])) / (scale or 1.0)
        return MomentumLedger(
            linear=momentum[:3],
            angular=momentum[3:],
            kinetic=kinetic,
            potential=potential,
            joint_work=self._joint_work,
            base_work=base_work,
            effect_work=effect_work,
            linear_impulse=integrals[:3] + self._weight * self.time_ns / 1e9,
            angular_impulse=integrals[3:6],
            momentum_drift=drift,
            energy_drift=kinetic + potential - self._start_energy - work,
        )

    def _momentum(self) -> Vector6:
        """(6,) [linear; angular about the centre of mass], what effects hold included."""
        total = self.dynamics.momentum(State.from_vector(self._x))
        torque = np.concatenate([self.effort, np.zeros(self.robot.rotor_count)])
        linear, angular = self._forced.momentum(self._x, torque, self.time_ns / 1e9)
        return total + np.concatenate([linear, angular])


def _checked(values: Array, size: int, what: str) -> Array:
    array = np.array(values, dtype=float)
    if array.shape != (size,):
        raise MessageRejectedError(f'{what}: expected {size} numbers, got shape {array.shape}')
    if not math.isfinite(array @ array) and not np.all(np.isfinite(array)):  # the quick way first
        raise MessageRejectedError(f'{what}: not finite: {array.tolist()}')
    return array
