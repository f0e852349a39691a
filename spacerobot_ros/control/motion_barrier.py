r"""No joint passes a limit of its motion while torques are held: a barrier for every law.

The rates at the end of the hold are predicted with the equations of motion. Where a joint would
use up more than a share gamma of what is left to its largest rate (a discrete control barrier
function, [AS17] of docs/references.md), or could no longer stop before the end of its range,

    q'(t + T) <= q'(t) + gamma (limit - q'(t)),
    q'(t + T) <= v,  v^2 / (2 a) + T v = end - q(t) - T q'(t) / 2,

its mean acceleration is the one that does not; the other joints, and a base that torques control,
accelerate as the law asked: du = M [0; dq''], M being the inertia of what is driven. In a hold of
15 ms or more the first holds at moments within it, too (`HeldTorques`); a rate that is beyond
its limit has until the end of the hold.
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
from ..dynamics.reduction import eliminate
from ..errors import SimulationDivergedError
from ..model.robot import Robot
from ..recording.faults.gaps import ONE_LOST
from ..types import Array
from .command import NS, Feedback
from .held_torques import FIRST, ROOM, HeldTorques
from .plausible import WOUND

_Now = tuple[tuple[Array, Array], Array, Array, float]  # what `allowed` asks for beside rates
_APPROACH, _SMOOTHING = 0.5, 0.5  # gamma and beta
_BRAKE = 0.5
"""Share of a joint's largest torque with which it stops: the rest is for what pushes it."""


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
        self._x = np.zeros(13 + 2 * self._n)
        self._x[6] = 1.0  # uniform gravity moves a free base and its arm alike
        self._held = HeldTorques(self._dynamics, 0.0)
        self._end = -1, self._x, np.zeros(self._n)
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
        if self._held.period != period:
            self._held = HeldTorques(self._dynamics, period)
        middle = sample.q + 0.5 * period * sample.qd
        M = self._inertia(middle, len(u))
        slowing = _BRAKE * limits[-n:] / M.diagonal()[-n:]
        # what is more than a joint can brake is none of its own motion, but a sensor's
        missed = np.minimum(np.maximum(self._missed, -slowing), slowing)
        now = (middle, sample.qd), slowing, self._ends, period
        try:
            u, state, rates = self._kept(self._state(sample), u, M, missed, now, limits)
        except SimulationDivergedError:
            return np.zeros(len(u))
        self._last = stamp_ns, sample.qd, (rates - sample.qd) / period - missed
        self._end = stamp_ns + hold_ns, state, rates
        return u

    def expected(self, stamp_ns: int) -> Feedback | None:
        """The sample of a stamp by the last prediction; None where it was for another time."""
        (end_ns, state, rates), period = self._end, self._held.period
        late = (stamp_ns - end_ns) * NS
        if abs(late) > 0.5 * period:
            return None
        n = self._n
        # what the model does not know, and the change of a hold of one moment, count in the mean
        q = state[7 : 7 + n] + 0.5 * period * (rates - state[-n:]) + late * rates
        return Feedback(q, rates, state[10 + n : 13 + n], np.zeros(3))

    def _kept(
        self, x: Array, u: Array, M: Array, missed: Array, now: _Now, limits: Array
    ) -> tuple[Array, Array, Array]:
        """Torques, state at the end by the model, and rates (n,) at the end."""
        n, held = self._n, self._held
        states = held.states(x, u)
        push = held.times * missed
        rates = states[:, -n:] + push
        change = allowed(rates, *now) - rates
        if not change.any():
            return u, states[-1], rates[-1]
        if len(rates) > 1:
            every = np.full(rates.shape, np.inf)
            bounds = np.array([allowed(-every, *now), allowed(every, *now)])
            u, states, _ = held.kept(x, u, M, push, bounds, limits)
            return u, states[-1], states[-1, -n:] + push[-1]
        slowed = u + M[:, -n:] @ (change[0] / held.period)
        if (np.abs(slowed) > limits).any():
            slowed = _nearest(M, u, change[0] / held.period, limits)
        return slowed, states[-1], rates[-1] + held.period * np.linalg.solve(M, slowed - u)[-n:]

    def _compare(self, stamp_ns: int, qd: Array) -> None:
        """See by how much the last prediction of accelerations was off."""
        start_ns, before, predicted = self._last
        elapsed = (stamp_ns - start_ns) * NS
        if 0.0 < elapsed < ONE_LOST * self._held.period:
            self._missed += _SMOOTHING * ((qd - before) / elapsed - predicted - self._missed)
        else:
            self._missed = np.zeros(self._n)

    def _state(self, sample: Feedback) -> Array:
        """(13 + 2 n,) of a base at rest in its place: where it is moves nothing."""
        n, x = self._n, self._x
        x[7 : 7 + n], x[10 + n : 13 + n], x[13 + n :] = sample.q, sample.omega_WB_B, sample.qd
        return x

    def _inertia(self, q: Array, count: int) -> Array:
        """(count, count) inertia of what is driven."""
        M = self._dynamics.mass_matrix(q)
        rest = len(M) - count
        equation = np.zeros((len(M), len(M) + 1))  # nothing drives what is eliminated
        equation[:, :-1] = M
        eliminate(equation, rest)
        return equation[rest:, rest:-1]


@compiled
def allowed(
    rates: Array, now: tuple[Array, Array], slowing: Array, limits: Array, period: float
) -> Array:
    """The rates (K, n) nearest to others that the limits allow at moments that divide a hold.

    Args:
        rates: (K, n) those that are predicted; the last ones are those at the end.
        now: (n,) positions that will have been reached in the middle of the hold, and rates.
        slowing: (n,) accelerations with which the joints stop.
        limits: (3, n) lower and upper ends of the positions, and largest rates.
        period: Time of the hold [s].
    """
    count, n = rates.shape
    out = np.empty((count, n))
    for k in range(count):
        done = (k + 1.0) / count
        for j in range(n):
            down = up = math.inf
            if k == count - 1:
                brake = period * slowing[j] / _BRAKE  # more than that is not asked
                down = _stopping(now[0][j] - limits[0, j], slowing[j], period)
                down = max(down, -now[1][j] - brake)
                up = _stopping(limits[1, j] - now[0][j], slowing[j], period)
                up = max(up, now[1][j] - brake)
            least = -_approached(-now[1][j], limits[2, j], done)
            most = _approached(now[1][j], limits[2, j], done)
            out[k, j] = min(max(rates[k, j], least, -down), most, up)
    return out


@inner
def _approached(rate: float, limit: float, done: float) -> float:
    """Largest rate after a part of a hold."""
    share = _APPROACH * (done if rate > limit else 1.0)
    return (1.0 - share) * rate + share * limit


@inner
def _stopping(room: float, slowing: float, period: float) -> float:
    """Largest rate at the end of a hold from which a joint stops within some room."""
    room = max(room, 0.0)
    return 2.0 * room / (period + math.sqrt(period**2 + 2.0 * room / slowing))


def _nearest(M: Array, u: Array, change: Array, limits: Array) -> Array:
    """Torques within limits that come nearest to a change of the joints' accelerations (n,)."""
    wanted = np.concatenate([np.zeros(len(u) - len(change)), change])
    first = wanted != 0.0
    weights = np.diag(FIRST * np.sqrt(np.diag(M)))[first]
    rows = np.vstack([np.linalg.cholesky(M).T, weights])
    bounds = -limits - u - ROOM, limits - u + ROOM
    du = scipy.optimize.lsq_linear(rows @ np.linalg.inv(M), rows @ wanted, bounds, method='bvls').x
    return np.clip(u + du, -limits, limits)
