r"""Rows with all coefficients integrated out: everything a linear hypothesis can ask.

With y = X z + noise of unit variance, z ~ N(0, P), and S = I + X P X' the covariance of y,

    W = X' S^-1 X,    r = X' S^-1 y,    ln N(y; 0, S)

say all. To exchange the priors of some coefficients g, P_g for P_g + D, is

    ln N(y; 0, S') = ln N(y; 0, S) + 1/2 r_g' D A^-1 r_g - 1/2 ln |A|,    A = I + W_gg D
    W' = W - W_g D A^-1 W_g',    r' = r - W_g D A^-1 r_g

(Woodbury), whether a cause comes, goes or takes another one's place: the gains of all moves cost
one small solution each, and a move one update of rank k. Pulsar timing nests its signals so
(van Haasteren and Vallisneri, Phys. Rev. D 90 (2014) 104012). Posterior mean and covariance are
P r and P - P W P.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from ..types import Array, IntArray
from .gram import Gram

_LEAST = 1e-12  # of a prior's variance, what rounding leaves
_AT_ONCE = 2**20  # numbers of all small matrices: 8 MB


@dataclass(frozen=True, slots=True, eq=False)
class SingleBounds:
    """(K,) bounds of single coefficients where these are a cause's, of prior variance one."""

    lower: Array
    upper: Array

    def loss(self, columns: IntArray, change: Array, vector: Array, told: Array) -> Array:
        """(c,) that the dearest bound costs: all together cost no less.

        Args:
            columns: (c, k).
            change: (c, k) of their prior variances; not less: a cause's.
            vector: (c, k) of r after it.
            told: (c, k) of the diagonal of W after it.
        """
        off = np.maximum(self.lower[columns] - vector, vector - self.upper[columns])
        off = np.where(change >= 0.0, np.maximum(off, 0.0), 0.0)
        return np.asarray(0.5 * np.max(off**2 / np.maximum(1.0 - told, _LEAST), axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class Marginal:
    """Sums of the marginal likelihood for some columns.

    Args:
        columns: (n,) which, ascending.
        matrix: (n, n) W. vector: (n,) r.
        log_density: ln N(y; 0, S) of all rows.
    """

    columns: IntArray
    matrix: Array
    vector: Array
    log_density: float

    @classmethod
    def of(cls, gram: Gram, columns: IntArray, variances: Array) -> Marginal:
        """From sums X' X, X' y (n, n), (n,) and the prior variances (n,) of the columns.

        With B = 1 + R G R, R the roots of the variances, W = G - G R B^-1 R G. Of columns with a
        prior it is R^-1 (1 - B^-1) R^-1, which rounding does not touch where data are sharp.
        """
        active = np.flatnonzero(variances)
        root = np.sqrt(variances[active])
        across = root[:, None] * gram.matrix[active]
        factor = np.linalg.cholesky(np.eye(len(active)) + across[:, active] * root)
        both = np.column_stack([across, root * gram.vector[active], np.eye(len(active))])
        both = solve_triangular(factor, both, lower=True, overwrite_b=True, check_finite=False)
        count = len(gram.vector)
        half, own, inverse = both[:, :count], both[:, count], both[:, count + 1 :]
        density = -0.5 * (gram.square - float(own @ own)) - float(np.sum(np.log(np.diag(factor))))
        density -= 0.5 * gram.rows * math.log(2.0 * math.pi)
        matrix, vector = gram.matrix - half.T @ half, gram.vector - half.T @ own
        scaled = inverse / root
        matrix[:, active] = half.T @ scaled
        matrix[active] = matrix[:, active].T
        matrix[np.ix_(active, active)] = np.diag(1.0 / root**2) - scaled.T @ scaled
        vector[active] = scaled.T @ own
        return cls(columns, matrix, vector, density)

    def part(self, columns: IntArray) -> Marginal:
        """The same for fewer columns, ascending."""
        at = self._at(columns)
        return Marginal(columns, self.matrix[np.ix_(at, at)], self.vector[at], self.log_density)

    def gains(self, columns: IntArray, change: Array, bounds: SingleBounds | None = None) -> Array:
        """(c,) by which the log density grows with each of c exchanges of priors by itself.

        Args:
            columns: (c, k) whose prior variances change in each.
            change: (c, k) by how much.
            bounds: What single coefficients may be: the gain is then at most so much.
        """
        out, step = np.empty(len(columns)), max(_AT_ONCE // columns.shape[1] ** 2, 1)
        for start in range(0, len(columns), step):
            part = slice(start, start + step)
            at, more = self._at(columns[part]), change[part]
            own, right = self.matrix[at[:, :, None], at[:, None, :]], self.vector[at]
            matrix = np.eye(at.shape[1]) + own * more[:, None, :]
            solved = np.asarray(np.linalg.solve(matrix, right[:, :, None])[:, :, 0], dtype=float)
            _, logarithm = np.linalg.slogdet(matrix)
            out[part] = 0.5 * np.sum(right * more * solved, axis=1) - 0.5 * logarithm
            if bounds is not None:
                told: Array = np.diagonal(np.linalg.solve(matrix, own), axis1=1, axis2=2)
                out[part] -= bounds.loss(columns[part], more, solved, told)
        return out

    def changed(self, columns: IntArray, change: Array) -> Marginal:
        """With other prior variances of some columns (k,), by a change (k,)."""
        at = self._at(columns)
        across = self.matrix[:, at]
        inverse = np.linalg.inv(np.eye(len(at)) + across[at] * change)
        inner = change[:, None] * inverse
        inner = 0.5 * (inner + inner.T)
        (gain,) = self.gains(columns[None], change[None])
        matrix = self.matrix - across @ inner @ across.T
        vector = self.vector - across @ (inner @ self.vector[at])
        matrix[at] = inverse @ across.T  # as above, and as exact as the inverse
        matrix[:, at] = matrix[at].T
        vector[at] = inverse @ self.vector[at]
        return Marginal(self.columns, matrix, vector, self.log_density + float(gain))

    def mean(self, columns: IntArray, variances: Array) -> Array:
        """(k,) posterior mean of coefficients of prior variances (k,)."""
        return variances * self.vector[self._at(columns)]

    def covariance(self, columns: IntArray, variances: Array) -> Array:
        """(k, k) their posterior covariance."""
        at = self._at(columns)
        own = self.matrix[np.ix_(at, at)]
        return np.diag(variances) - variances[:, None] * own * variances

    def _at(self, columns: IntArray) -> IntArray:
        return np.searchsorted(self.columns, columns)
