"""Motion under a smooth torque: SciPy's DOP853 with compiled stages."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import DOP853 as SCIPY

from spacerobot_ros.dynamics.compiling import compiled
from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.integrate import DOP853, stages
from spacerobot_ros.errors import SimulationDivergedError
from spacerobot_ros.types import Array

TorqueOf = Callable[[float, Array], Array]

_NODES, _WEIGHTS = DOP853
_FIFTH, _THIRD = SCIPY.E5[:-1].copy(), SCIPY.E3[:-1].copy()


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
    motion = _Motion(dynamics, torque, times, x, rtol=rtol, atol=atol)
    states, done = np.array([x] * len(times), dtype=float), 1
    while done < len(times):
        if why := motion.step():
            raise SimulationDivergedError(motion.t, why)
        reached = int(np.searchsorted(times, motion.t, side='right'))
        if reached > done:
            states[done:reached] = motion.dense_output()(times[done:reached]).T
            done = reached
    states[:, 3:7] /= np.linalg.norm(states[:, 3:7], axis=1, keepdims=True)
    return states


class _Motion(SCIPY):  # type: ignore[misc]  # SciPy has no types
    """SciPy's solver, its step over compiled stages: twice as fast (docs/decisions.md, 21)."""

    t: float
    y: Array
    f: Array
    h_abs: float

    def __init__(
        self, dynamics: Dynamics, torque: TorqueOf, times: Array, x: Array, **tolerance: float
    ) -> None:
        self._dynamics, self._torque = dynamics, torque
        self._inputs = np.zeros((1, dynamics.robot.n_joints)), np.zeros((1, 6))
        super().__init__(self._rate, float(times[0]), x, float(times[-1]), **tolerance)
        self.h_abs = float(self.h_abs)  # NumPy's numbers are slow

    def _rate(self, t: float, x: Array) -> Array:
        return self._dynamics.rate(x, self._torque(t, x))

    def _step_impl(self) -> tuple[bool, Any]:
        self.K[0], dt, growth = self.f, self.h_abs, 10.0  # limits: SciPy's, and Hairer's
        while True:
            dt = min(dt, self.t_bound - self.t)
            if dt < 10.0 * math.ulp(self.t) and dt < self.t_bound - self.t:
                return False, 'no step is short enough for the tolerance'
            x = self._attempt(dt)
            error = _error(self.K, self.y, x, dt, (self.rtol, self.atol))
            wanted = growth if error == 0.0 else 0.9 * error**self.error_exponent
            if error < 1.0:
                break
            dt, growth = dt * max(0.2, wanted), 1.0
        self.h_previous, self.h_abs = dt, dt * min(growth, wanted)
        self.t = self.t_bound if dt == self.t_bound - self.t else self.t + dt
        self.y_old, self.y = self.y, x
        self.f = self.K[-1] = self._rate(self.t, x)
        return True, None

    def _attempt(self, dt: float) -> Array:
        """State after a step; fills the slopes of its stages."""
        slopes, held = self.K_extended, self._inputs
        machine, state, tau = self._dynamics.machine, slopes[-1], held[0][0]
        stages(machine, held, _WEIGHTS, slopes, (1, 1), self.y, dt)
        for s in range(1, self.n_stages):
            tau[:] = self._torque(self.t + _NODES[s] * dt, state)
            stages(machine, held, _WEIGHTS, slopes, (s, s + 1), self.y, dt)
        return np.array(state)


@compiled
def _error(slopes: Array, x: Array, y: Array, dt: float, tolerance: tuple[float, float]) -> float:
    """Error of a step from x to y relative to its tolerance; NumPy takes 12 us, a fifth of it."""
    squares, size = 0.0, 0.0
    for i in range(len(x)):
        fifth, third = 0.0, 0.0
        for s in range(len(_FIFTH)):
            fifth += _FIFTH[s] * slopes[s, i]
            third += _THIRD[s] * slopes[s, i]
        scale = tolerance[1] + tolerance[0] * max(abs(x[i]), abs(y[i]))
        squares += (fifth / scale) ** 2
        size += (fifth / scale) ** 2 + 0.01 * (third / scale) ** 2
    return dt * squares / math.sqrt(size * len(x)) if squares != 0.0 else 0.0
