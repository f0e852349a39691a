"""The most probable point of a normal distribution within bounds and matrix inequalities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from ..types import Array, BoolArray
from .interior_point import ConstrainedProblem, MatrixInequality


def nearest(
    mean: Array,
    covariance: Array,
    sizes: Array,
    bounds: tuple[Array, Array],
    inequalities: Sequence[MatrixInequality] = (),
) -> tuple[Array, float]:
    """The point x that is allowed and nearest to the mean, and what it costs.

        loss = 1/2 (x - mean)' covariance^-1 (x - mean)

    Of bounds alone it is exact; where a matrix inequality is in force it is within a hundredth of
    a nat a bound, see `ConstrainedProblem`.

    Args:
        mean: (k,).
        covariance: (k, k), positive definite.
        sizes: (k,) plausible sizes of the coordinates.
        bounds: Lower and upper (k,) bounds; zero is within them.
        inequalities: See `MatrixInequality`.

    Returns:
        x (k,) and the loss [nats].
    """
    x = _within_bounds(mean, covariance, bounds)
    if not all(_holds(own, x) for own in inequalities):
        information = np.linalg.inv(covariance)
        information = 0.5 * (information + information.T)
        x = ConstrainedProblem(
            information, information @ mean, sizes, *bounds, inequalities
        ).solve()
    off = x - mean
    return x, 0.5 * float(off @ np.linalg.solve(covariance, off)) if np.any(off) else 0.0


def _holds(own: MatrixInequality, x: Array) -> bool:
    matrix = own.offset + np.tensordot(x[own.columns], own.basis, 1)
    return bool(np.linalg.eigvalsh(matrix)[0] > 0.0)


def _within_bounds(mean: Array, covariance: Array, bounds: tuple[Array, Array]) -> Array:
    """(k,) by the primal-dual active set, or, should that not settle, bounded least squares."""
    lower, upper = bounds
    if np.all((mean >= lower) & (mean <= upper)):
        return mean
    low, high = mean < lower, mean > upper
    for _ in range(len(mean) + 1):
        x, force = _held(mean, covariance, low, high, bounds)
        # what is held stays while it is pulled outwards; what is free is held where it is outside
        next_low = np.where(low, force > 0.0, x < lower)
        next_high = np.where(high, force < 0.0, x > upper)
        if np.array_equal(next_low, low) and np.array_equal(next_high, high):
            return x
        low, high = next_low, next_high & ~next_low
    root = np.linalg.cholesky(covariance)
    inverse = scipy.linalg.solve_triangular(root, np.eye(len(mean)), lower=True)
    x = scipy.optimize.lsq_linear(inverse, inverse @ mean, bounds, method='bvls').x
    return np.clip(x, lower, upper)


def _held(
    mean: Array,
    covariance: Array,
    low: BoolArray,
    high: BoolArray,
    bounds: tuple[Array, Array],
) -> tuple[Array, Array]:
    """The mean where some coordinates are at their bounds, and the forces that hold them."""
    at = np.flatnonzero(low | high)
    target = np.where(low, bounds[0], bounds[1])[at]
    force = np.zeros(len(mean))
    force[at] = np.linalg.solve(covariance[np.ix_(at, at)], target - mean[at])
    x = mean + covariance @ force
    x[at] = target
    return x, force
