"""Motion under a smooth torque, by DOP853 with error control.

Step control and interpolant of order 7 are those of Hairer, Norsett and Wanner and of SciPy, whose
coefficients they use; stages are the compiled ones of `integrate`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import DOP853 as SCIPY

from ..errors import SimulationDivergedError
from ..types import Array
from .compiling import compiled
from .equations import Dynamics
from .integrate import stages
from .tableaus import DOP853

TorqueOf = Callable[[float, Array], Array]

_NODES, _WEIGHTS = DOP853
_S = SCIPY.n_stages
_EXTRA = tuple(zip(SCIPY.C_EXTRA.tolist(), SCIPY.A_EXTRA, strict=True))
_INTERPOLANT, _ERROR_3, _ERROR_5 = np.array(SCIPY.D), np.array(SCIPY.E3), np.array(SCIPY.E5)
_SAFETY, _LARGEST_CUT, _LARGEST_GROWTH = 0.9, 0.2, 10.0  # Hairer's, and SciPy's
_ORDER = 8


def simulate_smooth(
    dynamics: Dynamics,
    x: Array,
    torque: TorqueOf,
    times: Array,
    rtol: float = 1e-13,
    atol: float = 1e-15,
) -> Array:
    """Follow a smooth joint torque with error-controlled DOP853.

    Args:
        dynamics: Equations of motion.
        x: (13 + 2 n,) state at `times[0]`.
        torque: Joint torques (n,) from time and state vector [N m].
        times: (m,) increasing output times [s].
        rtol: Relative tolerance a step.
        atol: Absolute tolerance a step.

    Returns:
        (m, 13 + 2 n) states at `times`, quaternions normalized.

    Raises:
        SimulationDivergedError: the integrator gave up.
    """
    motion = SmoothMotion(dynamics, torque, float(times[0]), x, (rtol, atol))
    states = np.empty((len(times), len(x)))
    states[0], done = x, 1
    while done < len(times):
        motion.advance(float(times[-1]))
        reached = int(np.searchsorted(times, motion.t, side='right'))
        if reached > done:
            states[done:reached] = motion.states(times[done:reached])
            done = reached
    states[:, 3:7] /= np.linalg.norm(states[:, 3:7], axis=1, keepdims=True)
    return states


class SmoothMotion:
    """A motion under a smooth torque, advanced step by step.

    The torque is a Python function, so a step is a Python loop over compiled stages.

    Args:
        dynamics: Equations of motion.
        torque: Joint torques (n,) from time and state vector [N m].
        t: Start [s].
        x: (13 + 2 n,) state at the start.
        tolerance: Relative and absolute tolerance a step.
    """

    def __init__(
        self,
        dynamics: Dynamics,
        torque: TorqueOf,
        t: float,
        x: Array,
        tolerance: tuple[float, float],
    ) -> None:
        self.t = t
        self._dynamics, self._torque, self._tolerance = dynamics, torque, tolerance
        self._x = np.array(x, dtype=float)
        self._inputs = np.zeros((1, dynamics.robot.n_joints)), np.zeros((1, 6))
        self._slopes = np.empty((_S + 2 + len(_EXTRA), len(x)))
        self._slopes[_S] = self._slope(t, self._x)
        self._next_dt = self._first_step()
        self._before, self._dt = self._x, 0.0

    def advance(self, end: float) -> None:
        """One step, as long as the tolerance allows and not beyond `end`.

        Raises:
            SimulationDivergedError: no step is short enough.
        """
        self._slopes[0] = self._slopes[_S]
        growth = _LARGEST_GROWTH
        while True:
            dt = min(self._next_dt, end - self.t)
            if dt < 10.0 * math.ulp(self.t) and dt < end - self.t:
                raise SimulationDivergedError(self.t, 'no step is short enough for the tolerance')
            after = self._attempt(dt)
            error = error_norm(self._slopes, self._x, after, dt, self._tolerance)
            if error <= 1.0:
                break
            self._next_dt = dt * max(_LARGEST_CUT, _SAFETY * error ** (-1.0 / _ORDER))
            growth = 1.0
        if error > 0.0:
            growth = min(growth, _SAFETY * error ** (-1.0 / _ORDER))
        self._next_dt = dt * growth
        self._before, self._x, self._dt = self._x, after, dt
        self.t = end if dt == end - self.t else self.t + dt

    def states(self, times: Array) -> Array:
        """(m, 13 + 2 n) states at times of the last step, by interpolation."""
        dt, slopes, t = self._dt, self._slopes, self.t - self._dt
        for s, (node, weights) in enumerate(_EXTRA, start=_S + 1):
            slopes[s] = self._slope(t + node * dt, self._before + dt * (weights[:s] @ slopes[:s]))
        change = self._x - self._before
        terms = [
            change,
            dt * slopes[0] - change,
            2.0 * change - dt * (slopes[_S] + slopes[0]),
            *(dt * (_INTERPOLANT @ slopes[:-1])),
        ]
        done = ((times - t) / dt)[:, None]
        value = np.zeros((len(times), len(change)))
        for power, term in enumerate(reversed(terms)):
            value = (value + term) * (done if power % 2 == 0 else 1.0 - done)
        return self._before + value

    def _attempt(self, dt: float) -> Array:
        """State after a step; fills the slopes of its stages and of its end."""
        machine, inputs, slopes, x = self._dynamics.machine, self._inputs, self._slopes, self._x
        state, tau = slopes[-1], inputs[0][0]
        stages(machine, inputs, _WEIGHTS, slopes, (1, 1), x, dt)
        for s in range(1, _S):
            tau[:] = self._torque(self.t + _NODES[s] * dt, state)
            stages(machine, inputs, _WEIGHTS, slopes, (s, s + 1), x, dt)
        slopes[_S] = self._slope(self.t + dt, state)
        return state.copy()

    def _slope(self, t: float, x: Array) -> Array:
        return self._dynamics.rate(x, self._torque(t, x))

    def _first_step(self) -> float:
        """A hundredth of the time in which the state would change by its own size."""
        scale = self._tolerance[1] + self._tolerance[0] * np.abs(self._x)
        size = float(np.linalg.norm(self._x / scale))
        speed = float(np.linalg.norm(self._slopes[_S] / scale))
        return 0.01 * size / speed if speed > 0.0 else 1e-3


@compiled
def error_norm(
    slopes: Array, before: Array, after: Array, dt: float, tolerance: tuple[float, float]
) -> float:
    """Local error of a step relative to its tolerance; at most 1 is good enough.

    Args:
        slopes: (13 or more, m) slopes of the stages and of the result.
        before: (m,) state at the start.
        after: (m,) state at the end.
        dt: Length of the step [s].
        tolerance: Relative and absolute.
    """
    rtol, atol = tolerance
    third, fifth = 0.0, 0.0
    for i in range(before.shape[0]):
        scale = atol + rtol * max(abs(before[i]), abs(after[i]))
        e3, e5 = 0.0, 0.0
        for s in range(_S + 1):
            e3 += _ERROR_3[s] * slopes[s, i]
            e5 += _ERROR_5[s] * slopes[s, i]
        third += (e3 / scale) ** 2
        fifth += (e5 / scale) ** 2
    if fifth == 0.0:
        return 0.0
    return abs(dt) * fifth / math.sqrt((fifth + 0.01 * third) * before.shape[0])
