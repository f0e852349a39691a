"""Least squares in square-root form: rows are added by QR, unknowns eliminated by QR."""

from __future__ import annotations

import numpy as np
import scipy

from ...types import Array, IntArray

_ROUNDING = 1e-13  # of the largest singular value: less is a direction without information
_AT_ONCE = 500  # rows; as many as stay in a processor's cache
_PANEL = 32  # columns that are cleared at once


class SquareRootInformation:
    """Least squares in square-root form: min |R t - z|^2.

    Args:
        size: Number p of unknowns.

    Attributes:
        factor: (p, p + 1) R, upper triangular, and beside it z.
        residual: Sum of squares that no unknowns explain.
        rows: Number of rows that were added.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self.factor = np.zeros((size, size + 1))
        self.residual = 0.0
        self.rows = 0

    def add(self, columns: Array, values: Array) -> None:
        """Add rows columns @ t = values, of unit variance; (r, p) and (r,)."""
        triangle = np.zeros((self.size + 1, self.size + 1), order='F')
        triangle[:-1] = self.factor
        for start in range(0, len(values), _AT_ONCE):
            part = slice(start, start + _AT_ONCE)
            rows = np.asfortranarray(np.column_stack([columns[part], values[part]]))
            panel = min(_PANEL, self.size + 1)
            triangle = scipy.linalg.lapack.dtpqrt(0, panel, triangle, rows, 1, 1)[0]
        self.factor = np.array(triangle[:-1], order='C')
        self.residual += float(triangle[-1, -1] ** 2)
        self.rows += len(values)

    def reset_residual(self) -> None:
        """Count residual and rows from here: a prior is no part of the goodness of fit."""
        self.residual, self.rows = 0.0, 0

    def solve(self) -> tuple[Array, Array]:
        """Estimate (p,) and covariance (p, p); directions without information stay at zero."""
        R, z = self.factor[:, :-1], self.factor[:, -1]
        scale = np.linalg.norm(R, axis=0)
        scale[scale == 0.0] = 1.0
        left, singular, right = np.linalg.svd(R / scale)
        known = singular > _ROUNDING * singular[0]
        inverse = right[known].T / singular[known]
        estimate = inverse @ (left[:, known].T @ z) / scale
        covariance = (inverse @ inverse.T) / np.outer(scale, scale)
        return estimate, covariance


def ordered(
    factor: Array, first: IntArray, last: IntArray
) -> tuple[Array, Array, Array, Array, Array]:
    """Square-root information with some unknowns eliminated: those before the others.

    Args:
        factor: (p, p + 1) of all, with its right-hand side.
        first: Which k are eliminated.
        last: Which m are kept.

    Returns:
        A (k, k), B (k, m) and a (k,) of A t_first + B t_last = a, and C (m, m) and c (m,) of
        C t_last = c, which is all that is known of the others; A and C upper triangular.
    """
    k, m = len(first), len(last)
    stacked = np.column_stack([factor[:, first], factor[:, last], factor[:, -1]])
    triangle = np.zeros((k + m, k + m + 1))
    (found,) = scipy.linalg.qr(stacked, mode='r')
    triangle[: min(len(found), k + m)] = found[: k + m]
    return (
        triangle[:k, :k],
        triangle[:k, k : k + m],
        triangle[:k, -1],
        triangle[k:, k : k + m],
        triangle[k:, -1],
    )


def marginal(factor: Array, wanted: IntArray) -> Array:
    """(m, m + 1) square-root information of some unknowns, the others eliminated.

    Args:
        factor: (p, p + 1) of all, with its right-hand side.
        wanted: Which m are kept.
    """
    others = np.setdiff1d(np.arange(factor.shape[1] - 1), wanted)
    *_, root, values = ordered(factor, others, wanted)
    return np.column_stack([root, values])
