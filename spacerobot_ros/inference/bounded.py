r"""The most probable point of a normal distribution within bounds and matrix inequalities.

    minimize 1/2 |z|^2    subject to    G z >= h,    x = mean + L z,    covariance = L L'

is a least-distance problem, solved as nonnegative least squares (Lawson and Hanson, Solving Least
Squares Problems (1974), 23.4). A matrix inequality F(x) > 0 is cut by planes: where v' F(x) v < 0
for an eigenvector v, v' F v >= 0 is one more row (Kelley, J. SIAM 8 (1960)). Until it holds, each
loss is below the one that is sought, so that a set of causes which is too dear is known early.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.optimize import nnls

from ..types import Array
from .interior_point import MatrixInequality

CUTS, CUT_LOSS = 60, 0.01
"""Planes that stand for a matrix inequality: their number bounds the run time; the last one that
costs less than a hundredth of a nat, far below any odds, ends them before."""

RANK = 1e-10
"""Of the largest eigenvalue of a group's information: less is no direction of its own. Rounding of
the marginal sums is 1e-12 of it."""


def nearest(
    mean: Array,
    covariance: Array,
    bounds: tuple[Array, Array],
    inequalities: Sequence[MatrixInequality] = (),
    enough: float = math.inf,
) -> tuple[Array, float]:
    """The point x that is allowed and nearest to the mean, and what it costs.

        loss = 1/2 (x - mean)' covariance^-1 (x - mean)

    Matrix inequalities may be left a little: by what costs `CUT_LOSS` at most.

    Args:
        mean: (k,).
        covariance: (k, k), positive definite.
        bounds: Lower and upper (k,) bounds; zero is within them.
        inequalities: See `MatrixInequality`.
        enough: Loss beyond which only that it is more matters.

    Returns:
        x (k,) and the loss [nats].
    """
    sizes = np.sqrt(np.diag(covariance))
    x, loss = mean, 0.0
    planes, levels = np.zeros((0, len(mean))), np.zeros(0)
    bodies = _Inequalities(inequalities)
    for _ in range(CUTS):
        found = [*_violated_bounds(x, bounds, sizes), *bodies.cuts(x)]
        if not found:
            break
        if not len(levels):
            root = np.asarray(np.linalg.cholesky(covariance))
        planes = np.vstack([planes, *(plane for plane, _ in found)])
        levels = np.append(levels, [level for _, level in found])
        z = _least_distance(planes @ root, levels - planes @ mean)
        before, loss = loss, 0.5 * float(np.linalg.norm(z)) ** 2
        if not loss < _IMPOSSIBLE:  # no point is allowed, but for rounding
            return np.clip(x, *bounds), math.inf
        x = mean + root @ z
        if loss > enough or (inequalities and loss - before < CUT_LOSS and before > 0.0):
            break
    return np.clip(x, *bounds), loss


_IMPOSSIBLE = 1e100  # nats, which rounding alone makes


def _violated_bounds(
    x: Array, bounds: tuple[Array, Array], sizes: Array
) -> Iterator[tuple[Array, float]]:
    """Planes of the bounds that a point is outside of."""
    for bound, sign in zip(bounds, (1.0, -1.0), strict=True):
        for i in np.flatnonzero(sign * (x - bound) < -RANK * sizes):
            plane = np.zeros(len(x))
            plane[i] = sign
            yield plane, sign * float(bound[i])


class _Inequalities:
    """Matrix inequalities of like shapes, looked at together.

    Args:
        every: They.
    """

    def __init__(self, every: Sequence[MatrixInequality]) -> None:
        shapes = defaultdict[tuple[int, ...], list[MatrixInequality]](list)
        for own in every:
            shapes[own.basis.shape].append(own)
        self._stacks = [
            (
                np.array([own.columns for own in alike]),
                np.array([own.offset for own in alike]),
                np.array([own.basis for own in alike]),
            )
            for alike in shapes.values()
        ]

    def cuts(self, x: Array) -> Iterator[tuple[Array, float]]:
        """Planes between a point and what each inequality allows."""
        for columns, offsets, bases in self._stacks:
            values, vectors = np.linalg.eigh(
                offsets + np.einsum('bk,bkij->bij', x[columns], bases)
            )
            least = -RANK * np.maximum(values[:, -1], 0.0)
            for b, k in np.argwhere(values < least[:, None]).tolist():
                v = vectors[b, :, k]
                own = bases[b] @ v @ v
                if own.any():
                    plane = np.zeros(len(x))
                    plane[columns[b]] = own
                    yield plane, -float(v @ offsets[b] @ v)


def _least_distance(rows: Array, right: Array) -> Array:
    """The least z of rows @ z >= right (c,)."""
    scale = np.maximum(np.linalg.norm(rows, axis=1), np.finfo(float).tiny)
    size = float(np.max(np.abs(right) / scale))  # at least so far away
    stacked = np.vstack([(rows / scale[:, None]).T, right / scale / size])
    target = np.zeros(len(stacked))
    target[-1] = 1.0
    weights, _ = nnls(stacked, target, maxiter=CUTS * len(right))
    left = stacked @ weights - target
    return np.asarray(-size * left[:-1] / min(left[-1], -np.finfo(float).tiny))
