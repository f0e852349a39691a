r"""One control period of a robot under physical effects and a wrench on its base.

The effects' generalized forces act in every stage of every integration step; their own states, the
impulses and the works are integrated beside the robot's state. For the ledger, with C the robot's
centre of mass, P the momentum of the whole and f, m the external force and torque on C,

    P' = f,    h_C' = m - v_C x P,

where the last term vanishes unless an effect holds a mass of its own that moves against the robot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..dynamics.equations import Dynamics
from ..dynamics.integrate import DOP853, Tableau, rk_step
from ..dynamics.rotation import cross, rotation_matrix
from ..dynamics.state import State
from ..effects.effect import Effect, own_states
from ..effects.motion import Motion, motion_at
from ..errors import ConfigurationError, SimulationDivergedError
from ..types import Array, Vector3, Vector6

_ANGLE_PER_STEP = {13: 1.0, 5: 0.1}
"""Largest product of step and natural frequency by rows of the tableau: the error of DOP853 and of
RK4 is then about 1e-7 a step."""
_MOST_STEPS = 200
_REPEATED = ('time', 'q', 'qd', 'effort')


class ForcedMotion:
    """Integrates the robot and its effects over control periods.

    Args:
        dynamics: Equations of motion of the robot as all effects have made it.
        effects: Physical effects.
        period: Control period [s].
        substeps: Fewest Runge-Kutta steps in a period; a fast effect makes it more.
        tableau: Runge-Kutta method.

    Raises:
        ConfigurationError: an effect that is too fast for the period.
    """

    def __init__(
        self,
        dynamics: Dynamics,
        effects: Sequence[Effect],
        period: float,
        substeps: int,
        tableau: Tableau = DOP853,
    ) -> None:
        self._dynamics = dynamics
        self._robot = dynamics.robot
        places = zip(effects, own_states(effects), strict=True)
        self._forces = [(e, own) for e, own in places if e.acts('force') or e.hidden]
        self._holders = [(e, own) for e, own in self._forces if e.acts('momentum')]
        self._is_implicit = any(e.follows_acceleration for e, _ in self._forces)
        # what wheels hold is a couple; only effects with states of their own move a mass
        self._holds_mass = any(e.hidden for e, _ in self._holders)
        self.hidden: Array = np.zeros(sum(e.hidden for e in effects))
        self._tableau = tableau
        needed = (
            steps_of(e.fastest(self._robot), f'effects.{e.name}', period, tableau) for e in effects
        )
        self.substeps = max([substeps, *needed])
        self._period = period
        self._size = 13 + 2 * self._robot.n_joints

    @property
    def is_free_of_forces(self) -> bool:
        """Whether no effect exerts a force."""
        return not self._forces

    def step(self, x: Array, torque: Array, wrench: Vector6, t: float) -> tuple[Array, Array]:
        """Advance by one period; the effects' own states move along.

        Args:
            x: (13 + 2 n,) state.
            torque: (n,) joint torques [N m].
            wrench: (6,) [force; torque] on the base in base coordinates [N, N m].
            t: Time at the start [s].

        Returns:
            (13 + 2 n,) state, and (8,) integrals over the period: impulses of the external force
            [N s] and of the external torque about the centre of mass [N m s] in the inertial
            frame, work of the wrench and work of the effects' forces, internal and external [J].

        Raises:
            SimulationDivergedError: the new state is not finite; nothing has changed.
        """
        size, own = self._size, len(self.hidden)

        def rate(at: float, y: Array) -> Array:
            return self._rate(at, y[:size], y[size : size + own], torque, wrench)

        y = np.concatenate([x, self.hidden, np.zeros(8)])
        dt = self._period / self.substeps
        for k in range(self.substeps):
            y = rk_step(rate, t + k * dt, y, dt, self._tableau)
            y[3:7] /= np.linalg.norm(y[3:7])
        if not np.all(np.isfinite(y)):
            names = ', '.join(e.name for e, _ in self._forces)
            outside = f'a base wrench of {np.max(np.abs(wrench)):g}'
            cause = f'effects {names}' if names else outside
            raise SimulationDivergedError(t, f'non-finite state under {cause}')
        self.hidden = y[size : size + own].copy()
        return y[:size], y[size + own :]

    def momentum(self, x: Array, torque: Array, t: float) -> tuple[Vector3, Vector3]:
        """Momentum that the effects hold themselves.

        Returns:
            (3,) linear [N s], and (3,) angular about the robot's centre of mass [N m s], both in
            the inertial frame.
        """
        if not self._holders:
            return np.zeros(3), np.zeros(3)
        state = State.from_vector(x)
        own = self._own_momentum(motion_at(self._robot, t, state, torque), self.hidden)
        R = rotation_matrix(state.q_WB_xyzw)
        return R @ own[:3], R @ (own[3:] - cross(self._centre_of_mass(state.q)[0], own[:3]))

    def _rate(self, t: float, x: Array, hidden: Array, torque: Array, wrench: Vector6) -> Array:
        """Rates of state, own states and integrals."""
        state = State.from_vector(x)
        motion = motion_at(self._robot, t, state, torque)
        total, external = np.zeros(6 + self._robot.n_joints), wrench.copy()
        added = np.zeros((len(total), len(total)))
        for effect, own in self._forces:
            if effect.follows_acceleration:
                force, by_acceleration = _affine_force(effect, motion, hidden[own])
                added += by_acceleration
            else:
                force = effect.force(motion, hidden[None, own])[0]
            total += force
            if effect.is_external:
                external += force[:6]
        dx = self._dynamics.rate(x, torque + total[6:], wrench + total[:6])
        if self._is_implicit:
            total += added @ self._solve(state.q, added, dx[7 + self._robot.n_joints :])
        slopes = np.empty(len(hidden))
        if len(hidden):
            motion.acceleration = dx[None, 7 + self._robot.n_joints :]
            for effect, own in self._forces:
                slopes[own] = effect.hidden_rate(motion, hidden[None, own])[0]
        rates = x[7 + self._robot.n_joints :]
        works = [wrench @ rates[:6], total @ rates]
        return np.concatenate([dx, slopes, self._impulses(state, motion, hidden, external), works])

    def _solve(self, q: Array, added: Array, acceleration: Array) -> Array:
        """(6 + n,) accelerations, in place, where forces are `added` times the accelerations."""
        first = 0 if self._robot.is_free else 6
        M = self._dynamics.mass_matrix(q)
        acceleration[first:] = np.linalg.solve(M - added[first:, first:], M @ acceleration[first:])
        return acceleration

    def _impulses(self, state: State, motion: Motion, hidden: Array, external: Vector6) -> Array:
        """(6,) rates of the linear and of the angular impulse, inertial frame."""
        if not (self._robot.is_free and (self._holds_mass or external.any())):
            return np.zeros(6)
        R = rotation_matrix(state.q_WB_xyzw)
        force, torque = external[:3], external[3:]
        if self._holds_mass or force.any():
            c, v, mass = self._centre_of_mass(state.q, state)
            torque = torque - cross(c, force)
            if self._holds_mass:
                own = self._own_momentum(motion, hidden)
                torque = torque - cross(v, mass * v + own[:3])
        return np.concatenate([R @ force, R @ torque])

    def _own_momentum(self, motion: Motion, hidden: Array) -> Vector6:
        own = [effect.momentum(motion, hidden[None, own])[0] for effect, own in self._holders]
        return np.sum(own, axis=0) if own else np.zeros(6)

    def _centre_of_mass(
        self, q: Array, state: State | None = None
    ) -> tuple[Vector3, Vector3, float]:
        """Centre of mass, its velocity where a state is given, and mass, in base coordinates.

        The mass matrix holds m skew(c).
        """
        M = self._dynamics.mass_matrix(q)
        mass = float(M[0, 0])
        c = np.array([M[5, 1], M[3, 2], M[4, 0]]) / mass
        if state is None:
            return c, np.zeros(3), mass
        rates = np.concatenate([state.v_WB_B, state.omega_WB_B, state.qd])
        return c, M[:3] @ rates / mass, mass


def _affine_force(effect: Effect, motion: Motion, hidden: Array) -> tuple[Array, Array]:
    """Force of an effect at no acceleration (6 + n,), and its derivative by the accelerations."""
    size = 6 + motion.robot.n_joints
    at: dict[str, Any] = {
        key: np.repeat(getattr(motion, key), 1 + size, axis=0) for key in _REPEATED
    }
    each = replace(motion, **at, acceleration=np.vstack([np.zeros(size), np.eye(size)]))
    forces = effect.force(each, np.repeat(hidden[None], 1 + size, axis=0))
    return forces[0], (forces[1:] - forces[0]).T


def steps_of(fastest: float, place: str, period: float, tableau: Tableau) -> int:
    """Runge-Kutta steps that what moves so fast [rad/s] needs in a period [s].

    Raises:
        ConfigurationError: more than are made.
    """
    angle = _ANGLE_PER_STEP[len(tableau[1])]
    steps = max(1, math.ceil(fastest * period / angle))
    if steps > _MOST_STEPS:
        raise ConfigurationError(
            place,
            f'moves at {fastest:.3g} rad/s: needs integration steps of '
            f'{angle / fastest:.2g} s, {steps} in a simulator.period of {period:g} s '
            f'(at most {_MOST_STEPS}): give a period of at most '
            f'{_MOST_STEPS * angle / fastest:.2g} s',
        )
    return steps


def fastest_mode(dynamics: Dynamics, x: Array) -> float:
    """Highest frequency of the robot itself about a state (13 + 2 n,): nutation [rad/s].

    Its accelerations are quadratic in its rates, so their derivatives by central differences are
    exact; wheels make them large where bodies are light.
    """
    n = dynamics.robot.n_joints
    rates = np.arange(7 + n, 13 + 2 * n)
    steps, tau = np.zeros((len(rates), len(x))), np.zeros(n)
    steps[:, rates] = np.eye(len(rates))
    ends = [[dynamics.rate(x + side * s, tau)[rates] for s in steps] for side in (1.0, -1.0)]
    slopes = 0.5 * (np.array(ends[0]) - np.array(ends[1])).T
    return float(np.max(np.abs(np.linalg.eigvals(slopes).imag), initial=0.0))
