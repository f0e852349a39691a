"""The integrator: explicit Runge-Kutta steps.

`Holding` advances one control period under held torques; `rk_step` advances any differential
equation. DOP853 takes twelve evaluations a step and at 10 ms keeps momentum to rounding; `RK4`
takes four and is right to about 1e-7 there. The attitude quaternion is integrated by its own rate
stage by stage (one exponential of an averaged rate would be second order, whatever the rest is).

DOP853 is that of Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, section
II.10. SciPy has the same numbers, but loads half a second of other code with them, for which no
node can wait.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..errors import SimulationDivergedError
from ..types import Array, Vector6
from .aba import RobotRecords, aba
from .compiling import compiled
from .equations import Dynamics

Tableau = tuple[tuple[float, ...], Array]
"""Times of the stages and of the end; (s + 1, s) weights of the slopes for their states."""


def _tableau(rows: Sequence[tuple[float, Mapping[int, float]]]) -> Tableau:
    """From the time of each row and its weights that are not zero, by column."""
    weights = np.zeros((len(rows), len(rows) - 1))
    for row, (_, given) in zip(weights, rows, strict=True):
        row[list(given)] = list(given.values())
    return tuple(time for time, _ in rows), weights


# fmt: off
RK4 = _tableau((
    (0.0, {}),
    (0.5, {0: 1 / 2}),
    (0.5, {1: 1 / 2}),
    (1.0, {2: 1.0}),
    (1.0, {0: 1 / 6, 1: 1 / 3, 2: 1 / 3, 3: 1 / 6}),
))
DOP853 = _tableau((
    (0.0, {}),
    (0.05260015195876773, {0: 0.05260015195876773}),
    (0.0789002279381516, {0: 0.0197250569845379, 1: 0.0591751709536137}),
    (0.1183503419072274, {0: 0.02958758547680685, 2: 0.08876275643042054}),
    (0.2816496580927726, {0: 0.2413651341592667, 2: -0.8845494793282861, 3: 0.924834003261792}),
    (0.3333333333333333, {0: 0.037037037037037035, 3: 0.17082860872947386,
     4: 0.12546768756682242}),
    (0.25, {0: 0.037109375, 3: 0.17025221101954405, 4: 0.06021653898045596, 5: -0.017578125}),
    (0.3076923076923077, {0: 0.03709200011850479, 3: 0.17038392571223998, 4: 0.10726203044637328,
     5: -0.015319437748624402, 6: 0.008273789163814023}),
    (0.6512820512820513, {0: 0.6241109587160757, 3: -3.3608926294469414, 4: -0.868219346841726,
     5: 27.59209969944671, 6: 20.154067550477894, 7: -43.48988418106996}),
    (0.6, {0: 0.47766253643826434, 3: -2.4881146199716677, 4: -0.590290826836843,
     5: 21.230051448181193, 6: 15.279233632882423, 7: -33.28821096898486,
     8: -0.020331201708508627}),
    (0.8571428571428571, {0: -0.9371424300859873, 3: 5.186372428844064, 4: 1.0914373489967295,
     5: -8.149787010746927, 6: -18.52006565999696, 7: 22.739487099350505, 8: 2.4936055526796523,
     9: -3.0467644718982196}),
    (1.0, {0: 2.273310147516538, 3: -10.53449546673725, 4: -2.0008720582248625,
     5: -17.9589318631188, 6: 27.94888452941996, 7: -2.8589982771350235, 8: -8.87285693353063,
     9: 12.360567175794303, 10: 0.6433927460157636}),
    (1.0, {0: 0.054293734116568765, 5: 4.450312892752409, 6: 1.8915178993145003,
     7: -5.801203960010585, 8: 0.3111643669578199, 9: -0.1521609496625161,
     10: 0.20136540080403034, 11: 0.04471061572777259}),
))
# fmt: on
TABLEAUS: dict[str, Tableau] = {'dop853': DOP853, 'rk4': RK4}


@compiled
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
        _advance(x, dt, weights[s], slopes, state[0])
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
    """One step of any differential equation; local error O(dt^5) with `RK4`, else O(dt^9).

    An entry is rounded the same whatever the others are and however many.

    Args:
        rate: Of change, from time and state.
        t: Time at the start.
        x: State of any shape.
        dt: Length of the step.
        tableau: Method.
    """
    nodes, weights = tableau
    start = x.ravel()
    slopes, state = np.empty((len(weights) - 1, x.size)), x
    for s in range(len(slopes)):
        slopes[s] = rate(t + nodes[s] * dt, state).ravel()
        after = np.empty(x.size)
        _advance(start, dt, weights[s + 1], slopes, after)
        state = after.reshape(x.shape)
    return state


@compiled
def _advance(x: Array, dt: float, weights: Array, slopes: Array, out: Array) -> None:
    """Write x + dt sum_k w_k f_k."""
    for i in range(len(x)):
        out[i] = 0.0
    for k in range(len(weights)):
        if weights[k] != 0.0:  # most are
            for i in range(len(x)):
                out[i] += weights[k] * slopes[k, i]
    for i in range(len(x)):
        out[i] = x[i] + dt * out[i]


def cubic_hermite(
    x0: Array, x1: Array, v0: Array, v1: Array, t: float, h: float
) -> tuple[Array, Array]:
    """Cubic through two points with given slopes, and its slope, at t of [0, h]."""
    u = t / h
    chord = (x1 - x0) / h
    bend, twist = chord - v0, v1 + v0 - 2.0 * chord
    value = x0 + t * (v0 + u * (bend + (u - 1.0) * twist))
    slope = v0 + 2.0 * u * bend + u * (3.0 * u - 2.0) * twist
    return value, slope


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
        """The state after a period.

        Args:
            x: (13 + 2 n,) state vector.
            tau: (n,) joint torques, constant over the period [N m].
            base_wrench: (6,) held force and torque on the base in base coordinates.
            t: Time at the start [s], for error messages.

        Raises:
            SimulationDivergedError: the new state is not finite.
        """
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
