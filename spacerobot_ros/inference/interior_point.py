r"""Most probable unknowns within bounds and linear matrix inequalities.

    minimize 1/2 x^T H x - b^T x - mu (sum_i ln det F_i(x) + sum ln(x - lower) + sum ln(upper - x))

for mu falling to nothing: an interior-point method on a convex problem, since F_i(x) =
offset_i + sum_k x_k basis_ik is linear. Inertial parameters are those of a body where such an F,
the 4x4 pseudo-inertia, is positive definite. Estimates that are clipped after an unbounded solve
are no longer the most probable ones of anything.

The least cost of a barrier mu is within mu times the number of bounds, F being as many as its
rows, of the least of all (Boyd and Vandenberghe, Convex Optimization (2004), 11.2). mu begins
where that is all that the start may lose to it: a lower one sends the first steps to a wall,
along which Newton's method gains no more than mu a step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy

from ..types import Array, IntArray

_LAST = 0.01  # nats at one e-fold of a bound, far below a name
_LOWER = 0.1  # of a barrier, the next one
_STEPS = 40
_SETTLED = 1e-6  # nats
_INSIDE = 0.1  # of a plausible size, from a bound at the start
_SAFE = 1e-5  # least pivot, whose square is of the order of one by the condition number


class MatrixInequality(Protocol):
    """F(x) = offset + sum_k x_k basis_k must stay positive definite; it is at x = 0."""

    @property
    def columns(self) -> IntArray:
        """(k,) places of its unknowns among all."""

    @property
    def offset(self) -> Array:
        """(m, m) at zero."""

    @property
    def basis(self) -> Array:
        """(k, m, m) derivatives."""


def _least(matrix: Array, right: Array) -> Array:
    """Solution of a positive matrix of unit diagonal; the least one where it is all but singular.

    By Cholesky's factor where that is safe: a tenth of the time of singular values.
    """
    try:
        factor = scipy.linalg.cho_factor(matrix, check_finite=False)
    except np.linalg.LinAlgError:
        factor = None
    if factor is None or np.min(np.diag(factor[0])) < _SAFE:
        return np.asarray(np.linalg.lstsq(matrix, right, 1e-14)[0])
    return np.asarray(scipy.linalg.cho_solve(factor, right, check_finite=False))


@dataclass(frozen=True, eq=False)
class ConstrainedProblem:
    """K unknowns.

    Args:
        information: (K, K) H, priors included.
        vector: (K,) b.
        sizes: (K,) plausible sizes, for the start.
        lower: (K,). upper: (K,).
        inequalities: What has to stay positive definite, all of one size.
    """

    information: Array
    vector: Array
    sizes: Array
    lower: Array
    upper: Array
    inequalities: Sequence[MatrixInequality] = ()

    def solve(self) -> Array:
        """(K,) the most probable values."""
        inside = np.minimum(_INSIDE * self.sizes, 0.25 * (self.upper - self.lower))
        x = np.clip(np.zeros(len(self.vector)), self.lower + inside, self.upper - inside)
        for barrier in self._barriers(x):
            for _ in range(_STEPS):
                slope, curvature = self._derivatives(x, barrier)
                scale = 1.0 / np.sqrt(np.diag(curvature))
                scaled = scale[:, None] * curvature * scale
                step = -scale * _least(scaled, scale * slope)
                share = self._share(x, step, slope, barrier)
                x = x + share * step
                if -share * float(slope @ step) < _SETTLED:
                    break
        return x

    def _barriers(self, start: Array) -> Array:
        """Falling to `_LAST`."""
        bounds = np.isfinite([self.lower, self.upper]).sum()
        bounds += sum(len(own.offset) for own in self.inequalities)
        off = start - np.linalg.lstsq(self.information, self.vector, 1e-14)[0]
        first = 0.5 * float(off @ self.information @ off) / max(int(bounds), 1)
        count = max(0, math.ceil(math.log(max(first, _LAST) / _LAST) / -math.log(_LOWER)))
        return _LAST * _LOWER ** -np.arange(count, -1.0, -1.0)

    def _share(self, x: Array, step: Array, slope: Array, barrier: float) -> float:
        """The part of a step that lowers the cost (Armijo's rule); zero where none does."""
        here, descent = self._cost(x, barrier), 0.1 * float(slope @ step)
        shares = (0.5**k for k in range(_STEPS))
        return next(
            (s for s in shares if self._cost(x + s * step, barrier) <= here + s * descent), 0.0
        )

    def _cost(self, x: Array, barrier: float) -> float:
        if np.any(x <= self.lower) or np.any(x >= self.upper):
            return np.inf
        try:
            factors = np.linalg.cholesky(self._matrices(x))
        except np.linalg.LinAlgError:
            return np.inf
        logs = np.sum(np.log(_finite(x - self.lower))) + np.sum(np.log(_finite(self.upper - x)))
        logs += 2.0 * np.sum(np.log(np.diagonal(factors, axis1=1, axis2=2)))
        return float(0.5 * x @ self.information @ x - self.vector @ x - barrier * logs)

    def _derivatives(self, x: Array, barrier: float) -> tuple[Array, Array]:
        """(K,) and (K, K) of the cost."""
        low, high = 1.0 / (x - self.lower), 1.0 / (self.upper - x)
        slope = self.information @ x - self.vector - barrier * (low - high)
        curvature = self.information + barrier * np.diag(low**2 + high**2)
        for own, inverse in zip(self.inequalities, np.linalg.inv(self._matrices(x)), strict=True):
            turned = inverse @ own.basis  # (k, m, m) F^-1 dF
            slope[own.columns] -= barrier * np.trace(turned, axis1=1, axis2=2)
            flat = turned.reshape(len(turned), -1)
            across = flat @ turned.transpose(0, 2, 1).reshape(len(turned), -1).T
            curvature[np.ix_(own.columns, own.columns)] += barrier * across
        return slope, curvature

    @cached_property
    def _linear(self) -> tuple[Array, Array]:
        """(B, m, m) at zero, (B m m, K) derivatives by the unknowns."""
        offsets = np.array([i.offset for i in self.inequalities])
        if not len(offsets):
            return np.zeros((0, 1, 1)), np.zeros((0, len(self.vector)))
        slope = np.zeros((len(offsets), offsets[0].size, len(self.vector)))
        for out, own in zip(slope, self.inequalities, strict=True):
            out[:, own.columns] = own.basis.reshape(len(own.columns), -1).T
        return offsets, slope.reshape(-1, len(self.vector))

    def _matrices(self, x: Array) -> Array:
        """(B, m, m) of all inequalities."""
        offsets, slope = self._linear
        return np.asarray(offsets + (slope @ x).reshape(offsets.shape))


def _finite(values: Array) -> Array:
    return values[np.isfinite(values)]
