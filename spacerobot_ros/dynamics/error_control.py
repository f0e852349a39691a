"""DOP853 with error control along a smooth torque, its stages compiled.

The step control and the interpolant of order 7 are those of Hairer, Norsett and Wanner, Solving
Ordinary Differential Equations I, section II.10, and of SciPy's `DOP853`, whose coefficients these
are. The torque is a Python function, so a step is a Python loop over compiled stages.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import DOP853

from ..errors import SimulationDivergedError
from ..types import Array
from .equations import Dynamics
from .integrate_kernel import NODES, STAGES, combined, error_norm, stage

Torque = Callable[[float, Array], Array]

_SAFETY, _LARGEST_CUT, _LARGEST_GROWTH = 0.9, 0.2, 10.0
_ORDER = 8
_NODES = NODES.tolist()
_EXTRA = tuple(zip(DOP853.C_EXTRA.tolist(), DOP853.A_EXTRA, strict=True))
_INTERPOLANT = np.array(DOP853.D)


class SmoothMotion:
    """A motion under a smooth torque, advanced step by step.

    Args:
        dynamics: Equations of motion.
        torque: Joint torques (n,) from time and state vector [N m].
        t: Start [s].
        x: (13 + 2 n,) state at the start.
        rtol: Relative tolerance a step.
        atol: Absolute tolerance a step.
    """

    def __init__(
        self, dynamics: Dynamics, torque: Torque, t: float, x: Array, rtol: float, atol: float
    ) -> None:
        self.t = t
        self._dynamics, self._torque = dynamics, torque
        self._rtol, self._atol = rtol, atol
        self._x, self._tau = np.array(x, dtype=float), np.zeros(dynamics.robot.n_joints)
        self._slopes = np.empty((STAGES + 1 + len(_EXTRA), len(x)))
        self._slopes[STAGES] = self._slope(t, self._x)
        self._next_dt = self._first_step()
        self._before, self._dt = self._x, 0.0

    def advance(self, end: float) -> None:
        """One step, as long as the tolerance allows and not beyond `end`.

        Raises:
            SimulationDivergedError: no step is short enough.
        """
        self._slopes[0] = self._slopes[STAGES]
        growth = _LARGEST_GROWTH
        while True:
            dt = min(self._next_dt, end - self.t)
            if dt < 10.0 * math.ulp(self.t) and dt < end - self.t:
                raise SimulationDivergedError(self.t, 'no step is short enough for the tolerance')
            after = self._attempt(dt)
            error = error_norm(self._slopes, self._x, after, dt, self._rtol, self._atol)
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
        for s, (node, weights) in enumerate(_EXTRA, start=STAGES + 1):
            slopes[s] = self._slope(t + node * dt, self._before + dt * (weights[:s] @ slopes[:s]))
        change = self._x - self._before
        terms = [
            change,
            dt * slopes[0] - change,
            2.0 * change - dt * (slopes[STAGES] + slopes[0]),
            *(dt * (_INTERPOLANT @ slopes)),
        ]
        done = ((times - t) / dt)[:, None]
        value = np.zeros((len(times), len(change)))
        for power, term in enumerate(reversed(terms)):
            value = (value + term) * (done if power % 2 == 0 else 1.0 - done)
        return self._before + value

    def _attempt(self, dt: float) -> Array:
        """State after a step; fills the slopes of its stages and of its end."""
        state = combined(self._x, self._slopes, 1, dt)
        for s in range(1, STAGES):
            self._tau[:] = self._torque(self.t + _NODES[s] * dt, state)
            state = stage(self._dynamics.machine, self._slopes, s, state, self._tau, self._x, dt)
        self._slopes[STAGES] = self._slope(self.t + dt, state)
        return np.asarray(state)

    def _slope(self, t: float, x: Array) -> Array:
        return self._dynamics.rate(x, self._torque(t, x))

    def _first_step(self) -> float:
        """A hundredth of the time in which the state would change by its own size."""
        scale = self._atol + self._rtol * np.abs(self._x)
        size = float(np.linalg.norm(self._x / scale))
        speed = float(np.linalg.norm(self._slopes[STAGES] / scale))
        return 0.01 * size / speed if speed > 0.0 else 1e-3
