r"""Most probable coefficients of several effects together, all within their bounds, bodies bodies.

    minimize 1/2 x^T H x - b^T x - mu (sum_i ln det J_i(x) + sum ln(x - lower) + sum ln(upper - x))

for mu falling to nothing: an interior-point method on a convex problem, since a body's 4x4
pseudo-inertia J is linear in its inertial parameters and they are those of a body where J is
positive definite (`dynamics/pseudo_inertia.py`, where it is P). Estimates that are clipped after
an unbounded solve are no longer the most probable ones of anything.

The least cost of a barrier mu is within mu times the number of bounds, a body's J being four, of
the least of all (Boyd and Vandenberghe, Convex Optimization (2004), 11.2). mu begins where that
is all that the start may lose to it: a lower one sends the first steps to a wall, along which
Newton's method gains no more than mu a step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy

from ...dynamics.pseudo_inertia import BASIS, pseudo_inertia
from ...types import Array, IntArray

NEXT_TO_NOTHING = np.array([1e-6, 0.0, 0.0, 0.0, 1e-9, 0.0, 1e-9, 0.0, 0.0, 1e-9])
"""(10,) a body far below any that is seen [kg, kg m, kg m^2]: what one that is put on is added to,
as it has to be a body by itself."""

_LAST = 0.01  # nats at one e-fold of a bound, far below a name
_LOWER = 0.1  # of a barrier, the next one
_STEPS = 40
_SETTLED = 1e-6  # nats
_INSIDE = 0.1  # of a plausible size, from a bound at the start
_SAFE = 1e-5  # least pivot, whose square is of the order of one by the condition number


@dataclass(frozen=True, slots=True, eq=False)
class PhysicalBody:
    """A body of whose ten inertial parameters some are among the unknowns.

    Args:
        columns: (k,) places of these among the unknowns.
        file: (10,) what the unknowns are added to.
        which: (k,) of the ten, in the order of Pinocchio's `toDynamicParameters`.
    """

    columns: IntArray
    file: Array
    which: IntArray = field(default_factory=lambda: np.arange(10))

    @property
    def basis(self) -> Array:
        """(k, 4, 4) derivatives of the pseudo-inertia by the unknowns."""
        return BASIS[self.which]

    @property
    def is_body(self) -> bool:
        """Whether it is one in the file."""
        try:
            np.linalg.cholesky(pseudo_inertia(self.file))
        except np.linalg.LinAlgError:
            return False
        return True


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
        bodies: What has to stay a body; those of the file are bodies.
    """

    information: Array
    vector: Array
    sizes: Array
    lower: Array
    upper: Array
    bodies: tuple[PhysicalBody, ...] = ()

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
        bounds = np.isfinite([self.lower, self.upper]).sum() + 4 * len(self.bodies)
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
            factors = np.linalg.cholesky(self._pseudo_inertias(x))
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
        for body, inverse in zip(
            self.bodies, np.linalg.inv(self._pseudo_inertias(x)), strict=True
        ):
            turned = inverse @ body.basis  # (k, 4, 4) J^-1 dJ
            slope[body.columns] -= barrier * np.trace(turned, axis1=1, axis2=2)
            flat = turned.reshape(-1, 16)
            across = flat @ turned.transpose(0, 2, 1).reshape(-1, 16).T
            curvature[np.ix_(body.columns, body.columns)] += barrier * across
        return slope, curvature

    @cached_property
    def _bodies_by_unknowns(self) -> tuple[Array, Array]:
        """(B, 4, 4) pseudo-inertias of the file, (16 B, K) their derivatives by the unknowns."""
        slope = np.zeros((len(self.bodies), 16, len(self.vector)))
        for own, body in zip(slope, self.bodies, strict=True):
            own[:, body.columns] = body.basis.reshape(-1, 16).T
        file = [pseudo_inertia(body.file) for body in self.bodies]
        return np.reshape(file, (-1, 4, 4)), slope.reshape(-1, len(self.vector))

    def _pseudo_inertias(self, x: Array) -> Array:
        """(B, 4, 4) of all bodies."""
        file, slope = self._bodies_by_unknowns
        return np.asarray(file + (slope @ x).reshape(-1, 4, 4))


def _finite(values: Array) -> Array:
    return values[np.isfinite(values)]
