r"""What held torques lead to, and their least change that keeps joints' rates within bounds.

Where torques are held for long, joints may be fastest within the hold: axes of an arm that come
into line (gimbal lock) let rates rise and fall within some hundredths of a second. So the rates
are bounded at moments t_k that divide a hold into steps of the integrator. With a the change of
the mean accelerations of base and joints, du = M a, and D^2 the diagonal of M,

    minimize |D a|^2,    low_k <= q'_k(u) + (d q'_k / d a) a <= high_k,

torques within their limits; where these don't suffice, bounds are missed by as little as can be.
Rates are not linear in torques, least of all where axes come into line, so it is solved anew about
what it led to. With one moment and d q'_j / d a_j = T it would be the change of `MotionBarrier`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy

from ..dynamics.equations import Dynamics
from ..dynamics.integrate import RK4, Holding
from ..types import Array

FIRST = 100.0
"""Times by which a joint at its limit weighs more than one that follows the law."""
ROOM = 1e-9  # N m, for a torque that is at its limit
_STEP = 0.01  # s, up to half as much again; RK4 is right to about 1e-7 there
_PASSES = 3  # one is enough but where axes come into line
_ENOUGH = 1e-3  # of what is beyond the bounds may stay: ten times what FIRST leaves
_CHANGE = 1e-2  # rad/s^2 of a body of 1 kg m^2, for slopes: what is not linear is below 1e-6


class LedTo(NamedTuple):
    """Torques and what they lead to.

    Attributes:
        u: (m,) torques [N m].
        states: (K, 13 + 2 n) at the moments, by the model.
        excess: By how much a rate is out of its bounds at most [rad/s].
    """

    u: Array
    states: Array
    excess: float


class HeldTorques:
    """Torques that are held for one length of time.

    Args:
        dynamics: Equations of motion.
        period: For how long [s].

    Attributes:
        times: (K, 1) moments since the start [s], the last one at the end.
    """

    def __init__(self, dynamics: Dynamics, period: float) -> None:
        count = max(1, round(period / _STEP))
        self.period, self.times = period, period * np.arange(1, count + 1)[:, None] / count
        self._n = dynamics.robot.n_joints
        self._holding = Holding(dynamics, period / count, tableau=RK4)
        self._wrench = np.zeros(6)

    def states(self, x: Array, u: Array) -> Array:
        """(K, 13 + 2 n) states at the moments.

        Args:
            x: (13 + 2 n,) state at the start.
            u: (n,) torques of the joints, or (3 + n,) of base and joints [N m].

        Raises:
            SimulationDivergedError: one is not finite.
        """
        n, states = self._n, np.empty((len(self.times), len(x)))
        self._wrench[3:] = u[:-n] if len(u) > n else 0.0
        for k in range(len(states)):
            states[k] = x = self._holding.step(x, u[-n:], self._wrench, 0.0)
        return states

    def kept(
        self, x: Array, u: Array, M: Array, push: Array, bounds: Array, limits: Array
    ) -> LedTo:
        """Torques within limits under which rates are within bounds, or as near as they come.

        Args:
            x: (13 + 2 n,) state at the start.
            u: (m,) torques that a law asks for, as of `states`, within their limits [N m].
            M: (m, m) inertia of what they drive.
            push: (K, n) what the model does not know adds to the rates [rad/s].
            bounds: (2, K, n) lower and upper bounds of the rates [rad/s].
            limits: (m,) of the torques [N m].

        Raises:
            SimulationDivergedError: a state is not finite.
        """
        asked, change, tried = u, np.zeros(len(u)), list[LedTo]()
        driven = M / np.sqrt(M.diagonal())  # torques by D a
        firm = np.vstack([driven, -driven]), np.concatenate([-limits - u, u - limits]) - ROOM
        while True:
            states = self.states(x, u)
            rates = states[:, -self._n :] + push
            tried.append(LedTo(u, states, np.max([rates - bounds[1], bounds[0] - rates])))
            if len(tried) > _PASSES or tried[-1].excess <= _ENOUGH * tried[0].excess:
                break
            slopes = self._slopes(x, u, driven, states)
            left = (bounds - rates).reshape(2, -1) + slopes @ change
            wanted = np.vstack([slopes, -slopes]), np.concatenate([left[0], -left[1]])
            try:
                change = shortest(wanted, firm)
            except (RuntimeError, ValueError):  # no end of it, or numbers beyond all bounds
                break
            u = np.clip(asked + driven @ change, -limits, limits)
        return min(tried, key=lambda kept: kept.excess)

    def _slopes(self, x: Array, u: Array, driven: Array, states: Array) -> Array:
        """(K n, m) changes of the rates by D a."""
        changed = [self.states(x, u + _CHANGE * column) - states for column in driven.T]
        return np.column_stack([c[:, -self._n :].ravel() for c in changed]) / _CHANGE


def shortest(wanted: tuple[Array, Array], firm: tuple[Array, Array]) -> Array:
    """The shortest x (m,) with rows (k, m) x >= least (k,): [LH74], chapter 23.

    Args:
        wanted: Rows and least of what may be missed, for `FIRST` times what it would take of x.
        firm: Of what may not; together with the others it leaves an x.
    """
    wanted, firm = _of_one(*wanted), _of_one(*firm)
    missed = np.vstack([np.eye(len(wanted[0])) / FIRST, np.zeros((len(firm[0]), len(wanted[0])))])
    rows = np.hstack([np.vstack([wanted[0], firm[0]]), missed])
    least = np.concatenate([wanted[1], firm[1]])
    size = np.max(np.abs(least))
    dual = np.vstack([rows.T, least / size])
    unit = np.zeros(len(dual))
    unit[-1] = 1.0
    left = unit - dual @ scipy.optimize.nnls(dual, unit)[0]
    return np.asarray(-left[: wanted[0].shape[1]] * (size / left[-1]))


def _of_one(rows: Array, least: Array) -> tuple[Array, Array]:
    """Rows of length one, of those that ask for something."""
    sizes = np.linalg.norm(rows, axis=1)
    asks = np.isfinite(least) & (sizes > 0.0)
    return rows[asks] / sizes[asks, None], least[asks] / sizes[asks]
