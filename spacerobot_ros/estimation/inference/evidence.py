r"""What a group of coefficients c with prior N(0, S^2) explains, by its Gram matrix.

With whitened innovations r and columns W, G = W^T W and b = W^T r say everything: twice the gain
in log likelihood is b^T (G + S^-2)^-1 b, a chi-square of trace(G (G + S^-2)^-1) degrees of freedom
without the effect (MacKay, Neural Computation 4 (1992)).
"""

from __future__ import annotations

import numpy as np
import scipy

from ...inference.gram import Gram
from ...types import Array

LEAST_PRECISION = 1e-12  # added, so that a column without any effect can be eliminated


def explained(gram: Gram, sizes: Array) -> tuple[float, float]:
    """Twice the gain in log likelihood of a group, and the probability of such a one by chance.

    Args:
        gram: Of its columns, all else marginalized.
        sizes: (K,) prior standard deviations.
    """
    scaled = sizes[:, None] * gram.matrix * sizes
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    values = np.maximum(values, 0.0)
    gain = float(np.sum((vectors.T @ (sizes * gram.vector)) ** 2 / (1.0 + values)))
    return gain, chi_square_tail(gain, max(float(np.sum(values / (1.0 + values))), 1e-3))


def chi_square_tail(value: float, dof: float) -> float:
    """Probability that a chi-square is above a value; scipy.stats takes half a second to load."""
    return float(scipy.special.chdtrc(dof, max(value, 0.0)))


def inverse_of_positive(matrix: Array) -> Array:
    """(K, K) inverse of a symmetric positive matrix, in half of the time of a general one.

    Where rounding has left it no factor of Cholesky's, as of any other matrix.
    """
    factor, failed = scipy.linalg.lapack.dpotrf(matrix, lower=1)
    if failed:
        return np.asarray(np.linalg.inv(matrix))
    lower = np.tril(scipy.linalg.lapack.dpotri(factor, lower=1)[0])
    return np.asarray(lower + np.tril(lower, -1).T)


def price(values: Array, rows: int) -> float:
    """What a group's freedom costs in log evidence, 1/2 ln det(I + S G S).

    Where the data are sharper than the prior by more than their number a direction pays no more
    than with a prior that is worth one datum (Kass and Wasserman, J. Am. Stat. Assoc. 90 (1995)).

    Args:
        values: (K,) eigenvalues of its information in units of the plausible sizes.
        rows: Number of data.
    """
    return 0.5 * float(np.sum(np.log1p(np.clip(values, 0.0, rows))))
