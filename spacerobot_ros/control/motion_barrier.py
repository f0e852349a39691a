r"""No joint passes a limit of its motion while torques are held: a barrier for every law.

The rates at the end of the hold are predicted with the equations of motion. Where a joint would
use up more than a share gamma of what is left to its largest rate (a discrete control barrier
function, [AS17] of docs/references.md), or could no longer stop before the end of its range,

    q'(t + T) <= q'(t) + gamma (limit - q'(t)),
    q'(t + T) <= v,  v^2 / (2 a) + T v = end - q(t) - T q'(t) / 2,

its mean acceleration is the one that does not; the other joints, and a base that torques control,
accelerate as the law asked: du = M [0; dq''], M being the inertia of what is driven.
To stop, a joint has half of what its largest torque gives it. Where du takes more than the
actuators have, the torques within their limits are those whose accelerations come nearest in the
norm of M (Gauss's least constraint), of joints at their limits first.

What the model does not know (wrong beliefs, friction, commands that come late) shows in what the
last prediction missed: smoothed by beta, and up to what a joint can brake, it is part of the next
one. With inertias believed R times too large a joint near its limit obeys, e its distance and d
what was missed in a period,

    e' = e - R (gamma e - d),    d' = (1 - beta) d + beta (R - 1) (gamma e - d),

stable up to R = 2.28 for gamma = beta = 1/2, and up to 4/3 with both at 1.
"""

from __future__ import annotations

import math

import numpy as np
import scipy

from ..dynamics.compiling import compiled, inner
from ..dynamics.equations import Dynamics
from ..dynamics.integrate import RK4, Holding
from ..dynamics.reduction import eliminate
from ..errors import SimulationDivergedError
from ..model.robot import Robot
from ..recording.faults.gaps import ONE_LOST
from ..types import Array
from .command import NS, Feedback
from .plausible import WOUND

_APPROACH, _SMOOTHING = 0.5, 0.5  # gamma and beta
_BRAKE = 0.5
"""Share of a joint's largest torque with which it stops: the rest is for what pushes it."""
_FIRST = 100.0
"""Times by which a joint at its limit weighs more than one that follows the law."""
_ROOM = 1e-9  # N m, for a torque that is at its limit


class MotionBarrier:
    """Changes torques so that no joint passes a limit of its motion.

    Args:
        robot: The robot as the model believes it to be; its position and velocity limits hold.
    """

    def __init__(self, robot: Robot) -> None:
        self._n = robot.n_joints
        stated = (
            np.isfinite(robot.position_limits).any() or np.isfinite(robot.velocity_limits).any()
        )
        self._is_limited = bool(stated)
        lower, upper = np.clip(robot.position_limits, -WOUND, WOUND).T
        self._ends = np.array([lower, upper, robot.velocity_limits])
        self._dynamics = Dynamics(robot)
        self._x, self._wrench = np.zeros(13 + 2 * self._n), np.zeros(6)
        self._x[6] = 1.0  # uniform gravity moves a free base and its arm alike
        self._period, self._holding = 0.0, Holding(self._dynamics, 0.0)
        self._last = 0, np.zeros(self._n), np.zeros(self._n)
        self._missed = np.zeros(self._n)

    def hold(
        self, stamp_ns: int, sample: Feedback, u: Array, limits: Array, hold_ns: int
    ) -> Array:
        """Torques within their limits under which the joints keep theirs.

        Args:
            stamp_ns: Stamp of the sample [ns].
            sample: Measured state.
            u: (n,) of the joints, or (3 + n,) of base and joints, within their limits [N m].
            limits: Of each [N m].
            hold_ns: Time over which they are held [ns].

        Returns:
            As `u`; zeros where they lead nowhere.
        """
        if not self._is_limited:
            return u
        self._compare(stamp_ns, sample.qd)
        n, period = self._n, hold_ns * NS
        middle = sample.q + 0.5 * period * sample.qd
        M = self._inertia(middle, len(u))
        slowing = _BRAKE * limits[-n:] / M.diagonal()[-n:]
        # what is more than a joint can brake is none of its own motion, but a sensor's
        missed = np.minimum(np.maximum(self._missed, -slowing), slowing)
        try:
            rates = self._rates_after(sample, u, period) + period * missed
        except SimulationDivergedError:
            return np.zeros(len(u))
        now = middle, sample.qd
        change = (allowed(rates, now, slowing, self._ends, period) - rates) / period
        if change.any():
            slowed = u + M[:, -n:] @ change
            if (np.abs(slowed) > limits).any():
                slowed = _nearest(M, u, change, limits)
            rates = rates + period * np.linalg.solve(M, slowed - u)[-n:]
            u = slowed
        self._last = stamp_ns, sample.qd, (rates - sample.qd) / period - missed
        return u

    def _compare(self, stamp_ns: int, qd: Array) -> None:
        """See by how much the last prediction of accelerations was off."""
        start_ns, before, predicted = self._last
        elapsed = (stamp_ns - start_ns) * NS
        if 0.0 < elapsed < ONE_LOST * self._period:
            self._missed += _SMOOTHING * ((qd - before) / elapsed - predicted - self._missed)
        else:
            self._missed = np.zeros(self._n)

    def _rates_after(self, sample: Feedback, u: Array, period: float) -> Array:
        """(n,) rates at the end of the hold, by the model."""
        n, x = self._n, self._x
        if self._period != period:
            self._period, self._holding = period, Holding(self._dynamics, period, tableau=RK4)
        x[7 : 7 + n], x[10 + n : 13 + n], x[13 + n :] = sample.q, sample.omega_WB_B, sample.qd
        self._wrench[3:] = u[:-n] if len(u) > n else 0.0
        return self._holding.step(x, u[-n:], self._wrench, 0.0)[-n:]

    def _inertia(self, q: Array, count: int) -> Array:
        """(count, count) inertia of what is driven."""
        M = self._dynamics.mass_matrix(q)
        rest = len(M) - count
        equation = np.zeros((len(M), len(M) + 1))  # nothing drives what is eliminated
        equation[:, :-1] = M
        eliminate(equation, rest)
        return equation[rest:, rest:-1]


@compiled  # type: ignore[untyped-decorator]
def allowed(
    rates: Array, now: tuple[Array, Array], slowing: Array, limits: Array, period: float
) -> Array:
    """The rates (n,) nearest to others that the limits allow at the end of a hold.

    Args:
        rates: (n,) those that are predicted.
        now: (n,) positions that will have been reached in the middle of the hold, and rates.
        slowing: (n,) accelerations with which the joints stop.
        limits: (3, n) lower and upper ends of the positions, and largest rates.
        period: Time of the hold [s].
    """
    out = np.empty(len(rates))
    for j in range(len(rates)):
        kept, most = (1.0 - _APPROACH) * now[1][j], _APPROACH * limits[2, j]
        brake = period * slowing[j] / _BRAKE  # more than that is not asked
        down = max(_stopping(now[0][j] - limits[0, j], slowing[j], period), -now[1][j] - brake)
        up = max(_stopping(limits[1, j] - now[0][j], slowing[j], period), now[1][j] - brake)
        out[j] = min(max(rates[j], kept - most, -down), kept + most, up)
    return out


@inner  # type: ignore[untyped-decorator]
def _stopping(room: float, slowing: float, period: float) -> float:
    """Largest rate at the end of a hold from which a joint stops within some room."""
    room = max(room, 0.0)
    return 2.0 * room / (period + math.sqrt(period**2 + 2.0 * room / slowing))


def _nearest(M: Array, u: Array, change: Array, limits: Array) -> Array:
    """Torques within limits that come nearest to a change of the joints' accelerations (n,)."""
    wanted = np.concatenate([np.zeros(len(u) - len(change)), change])
    first = wanted != 0.0
    weights = np.diag(_FIRST * np.sqrt(np.diag(M)))[first]
    rows = np.vstack([np.linalg.cholesky(M).T, weights])
    bounds = -limits - u - _ROOM, limits - u + _ROOM
    du = scipy.optimize.lsq_linear(rows @ np.linalg.inv(M), rows @ wanted, bounds, method='bvls').x
    return np.clip(u + du, -limits, limits)
