"""How well a set of causes fits the rows, all of them and block by block."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from ..types import Array
from .decisive import MISFIT
from .hypotheses import Hypotheses
from .marginal import Marginal


@dataclass(frozen=True, slots=True, eq=False)
class Goodness:
    """Squares of the whitened rows that are left.

    Args:
        squares: (B,) of each block with rows.
        freedom: (B,) their degrees of freedom: rows less what the coefficients fit of them.
    """

    squares: Array
    freedom: Array

    @property
    def p_value(self) -> float:
        """Probability of as bad a fit of all rows under a right model."""
        return float(chdtrc(np.sum(self.freedom), np.sum(self.squares)))

    @property
    def p_values(self) -> Array:
        """(B,) of each block."""
        return np.asarray(chdtrc(self.freedom, self.squares))

    @property
    def overdispersion(self) -> float:
        """Variance of what is left by that of the noise as it is thought."""
        return float(np.sum(self.squares) / np.sum(self.freedom))

    @property
    def is_good(self) -> bool:
        """Whether a right model could leave as much."""
        return self.p_value >= MISFIT


def goodness(hypotheses: Hypotheses, marginal: Marginal, chosen: Collection[int]) -> Goodness:
    """Of a set of causes.

        E |y_c - X_c m|^2 = r_c - tr(V X_c' X_c)

    Args:
        hypotheses: All of them.
        marginal: All rows under the set.
        chosen: The set.
    """
    active = hypotheses.active(chosen)
    columns = hypotheses.columns_of(active)
    variances = hypotheses.variances(chosen)[columns]
    mean, covariance = (f(columns, variances) for f in (marginal.mean, marginal.covariance))
    grams = [gram for gram in hypotheses.grams(active) if gram.rows]
    used = np.array([np.sum(covariance * gram.matrix) for gram in grams])
    return Goodness(
        np.array([gram.misfit(mean) for gram in grams]),
        np.maximum(np.array([gram.rows for gram in grams]) - used, np.finfo(float).eps),
    )
