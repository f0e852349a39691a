"""Posterior of unknowns whose data are a curved function of them, under a scaled prior."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from ..types import Array
from .scaled_prior import ScaledPosterior, scaled_posterior

_LINEAR = 10.0
"""Root mean square shift of the unknowns, in standard deviations, up to which a step is taken as
the linear model has it; of eleven hard flights 1 to 1000 settle in as many steps or more."""
_MOST = 150  # steps in all; a dozen where everything is off by a third
_KEPT = 1e-3  # of what a step promises, from which it is taken
_DECREMENT = 1e-4  # square of the whole shift that is left, in standard deviations
_SAME_FACTOR = 0.02  # of its logarithm, which the data tell to some 0.1


class DataCurve(Protocol):
    """What the data tell: values (k,) of unknowns (m,)."""

    def told_of(self, y: Array) -> Array:
        """(k,) values."""

    def told_slopes(self, y: Array) -> Array:
        """(k, m) their derivatives."""

    def stepped(self, y: Array, step: Array) -> Array:
        """(m,) unknowns after a step (m,) along which the values are as straight as can be."""


class CurvedPosterior(NamedTuple):
    """Posterior about its most probable unknowns.

    Args:
        slopes: (k, m) derivatives of the values there.
        posterior: Of the unknowns.
        is_settled: Whether another step would move them by no more than a hundredth of their
            deviations in all.
    """

    slopes: Array
    posterior: ScaledPosterior
    is_settled: bool


def curved_posterior(
    curve: DataCurve,
    root: Array,
    values: Array,
    std: Array,
    start: Array,
) -> CurvedPosterior:
    """Combine data |root (g(y) - g(start)) - values|^2 with a prior about zero.

    The most probable unknowns for one factor of the prior, the factor by its evidence there, and
    so on: an evidence far from these would take bends for what the prior lacks.

    Args:
        curve: g.
        root: (r, k) square-root information of g, any rank.
        values: (r,) its right-hand side.
        std: (m,) standard deviations of the prior at factor one.
        start: (m,) where to begin.
    """
    problem = _Problem(curve, root, values, std, start)
    now, steps = 1.0, _MOST
    while True:
        steps = problem.descend(now, steps)
        slopes, posterior = problem.posterior()
        change = abs(np.log(posterior.factor / now))
        if change < _SAME_FACTOR or steps <= 0:
            break
        now = posterior.factor
    # the average over factors is a little elsewhere, across the bends
    return CurvedPosterior(slopes, replace(posterior, mean=problem.y), steps > 0)


class _Problem:
    """Least squares of data and prior, at unknowns `y`."""

    def __init__(
        self, curve: DataCurve, root: Array, values: Array, std: Array, start: Array
    ) -> None:
        self._curve, self._root, self._std, self.y = curve, root, std, start
        self._values = values + root @ curve.told_of(start)

    def posterior(self) -> tuple[Array, ScaledPosterior]:
        """(k, m) slopes, and the posterior with the values straight about `y`."""
        slopes = self._curve.told_slopes(self.y)
        told = self._root @ slopes
        square, right = _reduced(told, self._left(self.y) + told @ self.y)
        return slopes, scaled_posterior(square, right, self._std)

    def descend(self, factor: float, steps: int) -> int:
        """Go to the most probable unknowns for a factor of the prior; how many steps are left.

        Levenberg and Marquardt's steps in the metric of the prior, at first damped so that an
        unknown shifts by some `_LINEAR` standard deviations (Nocedal and Wright, Numerical
        Optimization, 10.3).
        """
        width, damping = factor * self._std, -1.0
        cost = self._cost(self.y, width)
        while steps > 0:
            told = self._root @ self._curve.told_slopes(self.y) * width
            gradient = told.T @ self._left(self.y) - self.y / width
            curvature = told.T @ told + np.eye(len(width))
            values, vectors = np.linalg.eigh(curvature)
            values, along = np.maximum(values, 1.0), vectors.T @ gradient
            decrement = float(np.sum(along**2 / values))
            if decrement < _DECREMENT:
                break
            if damping < 0.0:
                damping = decrement / len(width) / _LINEAR**2
            while steps > 0:
                steps -= 1
                step = vectors @ (along / (values + damping))
                tried = self._curve.stepped(self.y, step * width)
                reached = self._cost(tried, width)
                wanted = float(step @ (gradient + damping * step))
                if cost - reached > _KEPT * wanted:
                    damping *= 0.2 if cost - reached > 0.5 * wanted else 1.0
                    cost, self.y = reached, tried
                    break
                damping = max(10.0 * damping, 1e-3)
        return steps

    def _left(self, y: Array) -> Array:
        return np.asarray(self._values - self._root @ self._curve.told_of(y))

    def _cost(self, y: Array, width: Array) -> float:
        left = self._left(y)
        return float(left @ left + np.sum((y / width) ** 2))


def _reduced(rows: Array, values: Array) -> tuple[Array, Array]:
    """(m, m) and (m,) of the same least squares for m unknowns."""
    m = rows.shape[1]
    padded = np.zeros((max(len(rows), m), m + 1))
    padded[: len(rows), :m], padded[: len(rows), m] = rows, values
    triangle = np.asarray(np.linalg.qr(padded, mode='r'))
    return triangle[:m, :m], triangle[:m, m]
