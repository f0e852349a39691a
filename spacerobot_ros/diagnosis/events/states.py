r"""Whether an error of the model that is a function of a joint's state may be a pulse.

A state of joint j is (q, q', 2 q_j''), each by its scatter over the recordings. Beside every
column of the balance the torque may have a function of the state x, a Gaussian process that all
recordings share and another of the pulse's own, as loads differ,

    k(x, x') = g^2 exp(-|x - x'|^2 / (2 l^2)),

seen at some states (Nystroem). The size g and the length l are where the marginal likelihood of
all rows is largest, the pulse's torque with any prior [RW06, (5.8), section 8.1]. Where the arm
comes back to a state the function is known and only what differs there is a pulse; where it does
not the function may be anything of the size g that it has elsewhere. On a machine whose leftover
is no function of states g is zero, and the pulse as large as it was.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from ...effects.surroundings.external import pulse_shape
from ...estimation.balance.arm_rows import ArmRows
from ...types import Array, BoolArray
from .joint_templates import Arm
from .transient import Transient

_SIZES = np.array([0.0, 0.25, 0.5, 1.0, 2.0, 4.0])[:, None]
"""g, by what is left of the joint (rms)."""
_LENGTHS = (0.35, 0.7, 1.4)
"""l, by the states' scatter: longer ones are what columns are, shorter ones noise."""
_CENTRES, _OWN = 100, 12  # states of all the recordings, and of the pulse
_JITTER = 1e-6
_NEIGHBOURS = 6
_FAR, _AWAY = 2.0, 1.0  # durations, and s: rows closer in time are the same visit
_LEAST = (0.1, 0.1, 1.0)  # rad, rad/s, rad/s^2: smaller differences are the same state
_SAME = 0.01  # of these scales
_USUAL, _RARE = 0.9, 1.3  # of these scales; of the record's own 90 % distance


class States:
    """States of one joint at its M rows.

    Args:
        rows: The recordings.
        j: The joint.
        beside: What lasts, and all pulses.
    """

    def __init__(self, rows: ArmRows, j: int, beside: Arm) -> None:
        own = beside.templates.sets[j]
        self._time, self._run, self._left = own.time, own.run, own.left(beside.coefficients)
        self._size = float(np.sqrt(np.mean(beside.left_of(j) ** 2)))
        blocks = []
        for balance in rows.balances:
            k, every = balance.arm.kinematics, slice(None, None, balance.arm.stride)
            states = np.column_stack([k.q, k.qd, 2.0 * k.qdd[:, j]])[every]
            blocks.append(states[rows.rows_at(balance, j)])
        states, n = np.concatenate(blocks), rows.robot.n_joints
        least = np.repeat(_LEAST, [n, n, 1])
        self.states = states / np.maximum(np.std(states, axis=0), least)

    def visited(self, p: Transient) -> tuple[float, float]:
        """Share of a pulse that the same states have at other times, and how far those are.

        The distance is by what is usual: beyond 1 the state is visited once. Every recording that
        comes to a state is one witness: where two have something, or half of them, it comes back.
        One alone may have been pushed there, too.
        """
        inside = self._inside(p)
        shape = pulse_shape((self._time[inside] - p.start) / p.duration, p.edge)
        if not shape.any():
            return 0.0, np.inf
        visits = [self._visit(p, inside, shape, run) for run in np.unique(self._run)]
        shares = sorted((share for share, distance in visits if distance <= 1.0), reverse=True)
        nearest = min(distance for _, distance in visits)
        return (shares[min(1, (len(shares) - 1) // 2)] if shares else 0.0), nearest

    def _visit(
        self, p: Transient, inside: BoolArray, shape: Array, run: int
    ) -> tuple[float, float]:
        """The same in one recording, at other times."""
        far = np.abs(self._time - p.middle) > _FAR * p.duration
        there = (self._run == run) & ((run != p.run) | far)
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
        for k in range(0, len(self.states), 5):
            away = (self._run != self._run[k]) | (np.abs(self._time - self._time[k]) > _AWAY)
            square = np.sum((self.states[away] - self.states[k]) ** 2, axis=1)
            if len(square) > _NEIGHBOURS:
                distances.append(np.sqrt(np.mean(np.partition(square, _NEIGHBOURS)[:_NEIGHBOURS])))
        return max(_USUAL, _RARE * float(np.quantile(distances, 0.9)) if distances else 0.0)

    def beside_function(self, p: Transient, others: Arm) -> float:
        """Size in white noise of a pulse beside all others and a function of the state."""
        centres = np.concatenate(
            [_some(self.states, _CENTRES), _some(self.states[self._inside(p)], _OWN)]
        )
        every = (self._functions(p, centres, length) for length in _LENGTHS)
        return max(_fitted(others, p, self._size * functions) for functions in every)[1]

    def _inside(self, p: Transient) -> BoolArray:
        """(M,) rows of a pulse."""
        return (self._run == p.run) & (self._time > p.start) & (self._time < p.end)

    def _functions(self, p: Transient, centres: Array, length: float) -> Array:
        """(M, P) whose sum, with coefficients of unit variance, is such a process of unit size."""
        between = _kernel(centres, centres, length) + _JITTER * np.eye(len(centres))
        lower = np.linalg.cholesky(between)
        shared = solve_triangular(lower, _kernel(centres, self.states, length), lower=True).T
        own = self._run == p.run
        if own.all():
            return np.asarray(shared)
        return np.column_stack([shared, shared * own[:, None]]) / np.sqrt(2.0)


def _fitted(others: Arm, p: Transient, functions: Array) -> tuple[float, float]:
    """Log likelihood of the best size of a function, and z of the pulse beside it."""
    normal, right = others.with_functions(p, functions)
    eigenvalues, vectors = np.linalg.eigh(normal[1:, 1:])
    cross, along = vectors.T @ normal[1:, 0], vectors.T @ right[1:]
    square, seen = _SIZES**2, np.maximum(eigenvalues, 0.0)
    taken = square / (1.0 + square * seen)
    den = np.maximum(normal[0, 0] - taken @ cross**2, _JITTER * normal[0, 0])
    num = right[0] - taken @ (cross * along)
    likelihood = taken @ along**2 + num**2 / den - np.log(den)
    likelihood -= np.sum(np.log1p(square * seen), axis=1)
    at = int(np.argmax(likelihood))
    return float(likelihood[at]), float(abs(num[at]) / np.sqrt(den[at]))


def _kernel(x: Array, y: Array, length: float) -> Array:
    return np.asarray(np.exp(-0.5 * cdist(x, y, 'sqeuclidean') / length**2))


def _some(states: Array, count: int) -> Array:
    """At most so many, evenly along."""
    return states[np.unique(np.linspace(0, len(states) - 1, count).astype(int))]
