r"""Inference on Gram matrices: how much the data want a group of columns, beside others.

With whitened innovations r and columns W, G = W^T W and b = W^T r say everything. A group of
coefficients c with prior N(0, S^2), S the catalogue's plausible sizes, raises the log evidence by

    E = 1/2 b^T (G + S^-2)^-1 b - 1/2 ln det(I + S G S)

(MacKay, Neural Computation 4 (1992)): no rank tolerance, no implausible values, and a larger group
pays for its freedom. Where the data are sharper than that by more than their number, N, a
direction pays 1/2 ln(1 + N) and no more, as with a prior that is worth one datum (Kass and
Wasserman, J. Am. Stat. Assoc. 90 (1995)): what is plausible on a large robot may be a million
times what a small one shows. Selected columns are removed by the Schur complement first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from ...inference.gram import Gram as Gram
from ...inference.gram import sum_of as sum_of
from ...types import Array, IntArray

LEAST_PRECISION = 1e-12  # added, so that a column without any effect can be eliminated
_ROUNDING = 1e-9  # of a size: less is a zero, whose digits are of the file's units


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """Some rows and all others, for cross-validation; companions are marginalized in both.

    Args:
        rest: Rows that an estimate may use. part: Rows that it is scored on.
    """

    rest: Gram
    part: Gram

    def of(self, chosen: IntArray) -> Fold:
        """The same with only the chosen columns."""
        return Fold(self.rest.part(chosen), self.part.part(chosen))


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """What a group of columns is worth.

    Args:
        evidence: Gain in log evidence.
        gain: Twice the gain in log likelihood at the estimate.
        dof: Effective number of coefficients.
        p_value: Probability of such a gain without the effect.
        bic_gain: gain - dof ln(rows).
        held_out: The same gain on other rows, estimate unchanged; nan where not asked.
        estimate: (K,) coefficients.
    """

    evidence: float
    gain: float
    dof: float
    p_value: float
    bic_gain: float
    held_out: float
    estimate: Array


def folds(parts: Sequence[Gram], nuisance: int, precision: Array) -> list[Fold]:
    """Each part of the rows against all others.

    Args:
        parts: Sums over the parts.
        nuisance: Number of leading columns that are companions.
        precision: (nuisance,) their prior precision.
    """
    out = []
    for k, part in enumerate(parts):
        rest = sum_of([*parts[:k], *parts[k + 1 :]])
        out.append(Fold(rest.without(nuisance, precision), part.without(nuisance, precision)))
    return out


def chi_square_tail(value: float, dof: float) -> float:
    """Probability that a chi-square is above a value; scipy.stats takes half a second to load."""
    return float(scipy.special.chdtrc(dof, max(value, 0.0)))


def cross_validated(found: Sequence[Fold], sizes: Array, bounds: tuple[Array, Array]) -> float:
    """Twice the gain in log likelihood on each part of the rows, estimated from all others."""
    return sum(score(fold.rest, sizes, bounds, fold.part).held_out for fold in found)


def score(gram: Gram, sizes: Array, bounds: tuple[Array, Array], test: Gram | None) -> Score:
    """Judge a group whose companions are marginalized already.

    Args:
        gram: On the rows that the estimate may use.
        sizes: (K,) prior standard deviations.
        bounds: Lower and upper (K,) bounds.
        test: On the rows that it is scored on.
    """
    values, estimate, gain = _estimated(gram, sizes, bounds)
    dof = max(float(np.sum(values / (1.0 + values))), 1e-3)
    held_out = np.nan
    if test is not None:
        held_out = float(2.0 * test.vector @ estimate - estimate @ test.matrix @ estimate)
    return Score(
        evidence=0.5 * gain - price(values, gram.rows),
        gain=gain,
        dof=dof,
        p_value=chi_square_tail(gain, dof),
        bic_gain=gain - dof * float(np.log(max(gram.rows, 1))),
        held_out=held_out,
        estimate=np.where(np.abs(estimate) < _ROUNDING * sizes, 0.0, estimate),
    )


def _estimated(
    gram: Gram, sizes: Array, bounds: tuple[Array, Array]
) -> tuple[Array, Array, float]:
    """Eigenvalues of the information, most probable coefficients, and twice their gain."""
    scaled = sizes[:, None] * gram.matrix * sizes
    vector = sizes * gram.vector
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    values = np.maximum(values, 0.0)
    projected = vectors.T @ vector
    estimate = sizes * (vectors @ (projected / (1.0 + values)))
    if np.any(estimate < bounds[0]) or np.any(estimate > bounds[1]):
        return values, *_bounded(vectors * np.sqrt(1.0 + values), vector, sizes, bounds)
    return values, estimate, float(np.sum(projected**2 / (1.0 + values)))


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
    """What a group's freedom costs in log evidence.

    Args:
        values: (K,) eigenvalues of its information in units of the plausible sizes.
        rows: Number of data.
    """
    return 0.5 * float(np.sum(np.log1p(np.clip(values, 0.0, rows))))


def _bounded(
    root: Array, vector: Array, sizes: Array, bounds: tuple[Array, Array]
) -> tuple[Array, float]:
    """Most probable coefficients within bounds, and twice their gain.

    Args:
        root: (K, K) whose product with its transpose is the information, the prior's included, in
            units of the sizes.
        vector: (K,) in these units.
        sizes: (K,) prior standard deviations.
        bounds: Lower and upper (K,) bounds.
    """
    target = np.linalg.solve(root, vector)
    low = np.minimum(bounds[0] / sizes, -1e-300)
    high = np.maximum(bounds[1] / sizes, 1e-300)
    if len(vector) == 1:
        z = np.clip(target / root[0], low, high)
    else:
        z = scipy.optimize.lsq_linear(root.T, target, bounds=(low, high), method='bvls').x
    gain = float(target @ target - np.sum((target - root.T @ z) ** 2))
    return np.clip(sizes * z, bounds[0], bounds[1]), gain
