"""The integrator: explicit Runge-Kutta steps, classical (order 4) and Dormand-Prince (order 8).

`hold_step` advances one control period under held torques, `simulate_smooth` follows a smooth
torque with error control, both with the same compiled stages; `rk_step` advances any differential
equation, for what is integrated beside the state. DOP853 (Hairer, Norsett and Wanner, Solving
Ordinary Differential Equations I, section II.10; the coefficients are SciPy's) takes twelve
evaluations a step and at 10 ms keeps momentum to rounding; `RK4` takes four and is right to about
1e-7 there. The attitude quaternion is integrated by its own rate stage by stage (one exponential
of an averaged rate would be second order, whatever the rest is).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import DOP853 as SCIPY

from ..errors import SimulationDivergedError
from ..types import Array, Vector6
from .aba import RobotRecords, aba
from .compiling import compiled
from .equations import Dynamics

TorqueOf = Callable[[float, Array], Array]
Tableau = tuple[tuple[float, ...], Array]
"""Times of the stages and of the end; (s + 1, s) weights of the slopes for their states."""

RK4: Tableau = (
    (0.0, 0.5, 0.5, 1.0, 1.0),
    np.array([[0, 0, 0, 0], [3, 0, 0, 0], [0, 3, 0, 0], [0, 0, 6, 0], [1, 2, 2, 1]]) / 6.0,
)
_S = SCIPY.n_stages
DOP853: Tableau = ((*SCIPY.C[:_S].tolist(), 1.0), np.vstack([SCIPY.A[:_S, :_S], SCIPY.B]))
TABLEAUS: dict[str, Tableau] = {'dop853': DOP853, 'rk4': RK4}

_NODES, _WEIGHTS = DOP853
_EXTRA = tuple(zip(SCIPY.C_EXTRA.tolist(), SCIPY.A_EXTRA, strict=True))
_INTERPOLANT, _ERROR_3, _ERROR_5 = np.array(SCIPY.D), np.array(SCIPY.E3), np.array(SCIPY.E5)
_SAFETY, _LARGEST_CUT, _LARGEST_GROWTH = 0.9, 0.2, 10.0  # Hairer's, and SciPy's
_ORDER = 8


@compiled  # type: ignore[untyped-decorator]
def stages(
    machine: RobotRecords,
    inputs: tuple[Array, Array],
    weights: Array,
    slopes: Array,
    which: tuple[int, int],
    x: Array,
    dt: float,
) -> None:
    """Slopes of some stages under held torques, and the state of the stage after them.

    The state is written to the last row of the slopes; after a whole step its quaternion is
    normalized. (An array returned costs a third of a microsecond.)

    Args:
        machine: From `robot_records`.
        inputs: (1, n) joint torques [N m] and (1, 6) wrench on the base.
        weights: Of a `Tableau`.
        slopes: (s + 1 or more, 13 + 2 n) slopes; those before the first stage are given.
        which: First stage, and the one whose state is asked for; s is the end of the step.
        x: (13 + 2 n,) state at the start of the step.
        dt: Length of the step [s].
    """
    first, last = which
    state = slopes[len(slopes) - 1 :]
    for s in range(first, last + 1):
        for i in range(len(x)):
            state[0, i] = 0.0
        for k in range(s):
            if weights[s, k] != 0.0:  # most of the later stages' weights are
                for i in range(len(x)):
                    state[0, i] += weights[s, k] * slopes[k, i]
        for i in range(len(x)):
            state[0, i] = x[i] + dt * state[0, i]
        if s < last:
            aba(machine, state, *inputs, slopes[s : s + 1])
    y = state[0]
    if last - first == len(weights) - 1:
        norm = math.sqrt(y[3] * y[3] + y[4] * y[4] + y[5] * y[5] + y[6] * y[6])
        for a in range(3, 7):
            y[a] /= norm


def rk_step(
    rate: Callable[[float, Array], Array], t: float, x: Array, dt: float, tableau: Tableau = DOP853
) -> Array:
    """One step of any differential equation; local error O(dt^5) with `RK4`, else O(dt^9)."""
    nodes, weights = tableau
    slopes = np.zeros((len(weights) - 1, len(x)))
    for s in range(len(slopes)):
        slopes[s] = rate(t + nodes[s] * dt, x + dt * (weights[s] @ slopes))
    return x + dt * (weights[-1] @ slopes)


class Holding:
    """Steps of one robot under held torques; keeps memory, so one object serves one thread.

    Args:
        dynamics: Equations of motion.
        period: Control period [s].
        substeps: Runge-Kutta steps in the period.
        tableau: Method.
    """

    def __init__(
        self, dynamics: Dynamics, period: float, substeps: int = 1, tableau: Tableau = DOP853
    ) -> None:
        self._machine, self._inputs = dynamics.machine, dynamics.inputs
        self._dt, self._substeps, self._weights = period / substeps, substeps, tableau[1]
        self._whole = 0, len(self._weights) - 1
        self._slopes = np.empty((self._whole[1] + 1, 13 + 2 * dynamics.robot.n_joints))
        self._after = self._slopes[-1]

    def step(self, x: Array, tau: Array, base_wrench: Vector6 | None, t: float) -> Array:
        """The state after a period; arguments as `hold_step`."""
        state, held = self._inputs(x, tau, base_wrench)
        x, y, machine = state[0], self._after, self._machine
        for k in range(self._substeps):
            if k > 0:
                x[:] = y
            stages(machine, held, self._weights, self._slopes, self._whole, x, self._dt)
        if not math.isfinite(y @ y) and not np.all(np.isfinite(y)):  # the quick way first
            raise SimulationDivergedError(
                t,
                f'non-finite state after a step of {self._dt:g} s; largest torque '
                f'{np.max(np.abs(tau)):g} N m',
            )
        return y.copy()


def hold_step(
    dynamics: Dynamics,
    x: Array,
    tau: Array,
    period: float,
    substeps: int = 1,
    base_wrench: Vector6 | None = None,
    t: float = 0.0,
) -> Array:
    """Advance the state by one control period with the torques held, by DOP853.

    Args:
        dynamics: Equations of motion.
        x: (13 + 2 n,) state vector.
        tau: (n,) joint torques, constant over the period [N m].
        period: Control period [s].
        substeps: Runge-Kutta steps in the period.
        base_wrench: (6,) held force and torque on the base in base coordinates.
        t: Time at the start [s], for error messages.

    Raises:
        SimulationDivergedError: the new state is not finite.
    """
    return Holding(dynamics, period, substeps).step(x, tau, base_wrench, t)


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

    Step control and interpolant of order 7 are those of Hairer, Norsett and Wanner and of SciPy's
    `DOP853`. The torque is a Python function, so a step is a Python loop over compiled stages.

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


@compiled  # type: ignore[untyped-decorator]
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
