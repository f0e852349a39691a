"""Whether what is left of a joint comes back where the arm comes back to the same state.

A state of joint j is (q, q', 2 q_j''), each by its scatter over the recordings: what is a function
of it is friction or an error of the model, and nothing from outside. Every recording that comes
to a state is one witness: where two have something, or half of them, it comes back. One alone may
have been pushed there, too. This sees what is there in few states alone; `state_function.py`
what is a little everywhere.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from ...effects.surroundings.external import pulse_shape
from ...types import Array, BoolArray
from .contact import Pulse
from .moving import PulseSearch

_NEIGHBOURS = 6
_FAR = 2.0  # durations: rows closer in time are the same visit
_LEAST = (0.1, 0.1, 1.0)  # rad, rad/s, rad/s^2: smaller differences are the same state
_SAME = 0.01  # of these scales
_USUAL = 0.9  # of these scales
_RARE = 1.3  # of the record's own 90 % distance


class States:
    """States of one joint at its rows.

    Args:
        search: The recordings.
        j: The joint.

    Attributes:
        states: (M, 3) by their scatter.
        run: (M,) recording of each.
    """

    def __init__(self, search: PulseSearch, j: int) -> None:
        rows, own = search.rows, search.scan.joints[j].whole
        self._time, self.run = own.time, own.run
        self._left = own.left(search.scan.coefficients)
        parts = []
        for balance in rows.balances:
            at = rows.rows_at(balance, j)
            k = balance.arm.kinematics
            acceleration = 2.0 * k.qdd[:: balance.arm.stride, j : j + 1][at]
            parts.append(
                (k.q[:: balance.arm.stride][at], k.qd[:: balance.arm.stride][at], acceleration)
            )
        blocks = [np.concatenate(x) for x in zip(*parts, strict=True)]
        scaled = [
            x / np.maximum(np.std(x, axis=0), least)
            for x, least in zip(blocks, _LEAST, strict=True)
        ]
        self.states = np.column_stack(scaled)

    def visited(self, pulse: Pulse) -> tuple[float, float]:
        """Share of a pulse that the same states have at other times, and how far those are.

        The distance is by what is usual: beyond 1 the state is visited once.
        """
        inside = self.inside(pulse)
        phase = (self._time[inside] - pulse.start) / (pulse.end - pulse.start)
        shape = pulse_shape(phase, pulse.edge)
        if not shape.any():
            return 0.0, np.inf
        visits = [self._visit(pulse, inside, shape, run) for run in np.unique(self.run)]
        shares = sorted((share for share, distance in visits if distance <= 1.0), reverse=True)
        nearest = min(distance for _, distance in visits)
        return (shares[min(1, (len(shares) - 1) // 2)] if shares else 0.0), nearest

    def inside(self, pulse: Pulse) -> BoolArray:
        """(M,) rows of a pulse."""
        return (self.run == pulse.run) & (self._time > pulse.start) & (self._time < pulse.end)

    def _visit(
        self, pulse: Pulse, inside: BoolArray, shape: Array, run: int
    ) -> tuple[float, float]:
        """The same in one recording, at other times."""
        far = _FAR * (pulse.end - pulse.start)
        middle = 0.5 * (pulse.start + pulse.end)
        there = (self.run == run) & ((run != pulse.run) | (np.abs(self._time - middle) > far))
        if np.sum(there) < _NEIGHBOURS:
            return 0.0, np.inf
        distance, near = KDTree(self.states[there]).query(self.states[inside], _NEIGHBOURS)
        weights = 1.0 / np.maximum(distance, _SAME) ** 2  # Shepard: the nearest visit decides
        left = np.sum(weights * self._left[there][near], axis=1) / np.sum(weights, axis=1)
        share = float(shape @ left) / float(shape @ self._left[inside])
        return share, float(np.median(distance)) / self._usual

    @cached_property
    def _usual(self) -> float:
        """Distance that is not rare: of states to those at other times."""
        distances = []
        for time, run in zip(self._time[::5], self.run[::5], strict=True):
            away = (self.run != run) | (np.abs(self._time - time) > 1.0)
            here = self.states[(self.run == run) & (self._time == time)][0]
            square = np.sum((self.states[away] - here) ** 2, axis=1)
            if len(square) > _NEIGHBOURS:
                distances.append(np.sqrt(np.mean(np.partition(square, _NEIGHBOURS)[:_NEIGHBOURS])))
        usual = _RARE * float(np.quantile(distances, 0.9)) if distances else 0.0
        return max(_USUAL, usual)
