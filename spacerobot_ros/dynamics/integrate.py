"""The integrator: explicit Runge-Kutta steps.

`hold_step` advances one control period under held torques; `rk_step` advances any differential
equation, for what is integrated beside the state. DOP853 takes twelve evaluations a step and at
10 ms keeps momentum to rounding; `RK4` takes four and is right to about 1e-7 there. The attitude
quaternion is integrated by its own rate stage by stage (one exponential of an averaged rate would
be second order, whatever the rest is).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..errors import SimulationDivergedError
from ..types import Array, Vector6
from .aba import RobotRecords, aba
from .compiling import compiled
from .equations import Dynamics
from .tableaus import DOP853, Tableau


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
