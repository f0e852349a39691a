"""How well a set of causes fits the rows, all of them and block by block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from ..types import Array
from .decisive import MISFIT
from .hypotheses import FittedBlocks


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
    def is_good(self) -> bool:
        """Whether a right model could leave as much."""
        return self.p_value >= MISFIT


def goodness(fitted: FittedBlocks) -> Goodness:
    """Of a fit of blocks of rows.

    E |y_c - X_c m|^2 = r_c - tr(V X_c' X_c)
    """
    rows = np.array([gram.rows for gram in fitted.grams])
    used = np.array([np.sum(fitted.covariance * gram.matrix) for gram in fitted.grams])
    squares = np.array([gram.misfit(fitted.mean) for gram in fitted.grams])
    return Goodness(squares, np.maximum(rows - used, np.finfo(float).eps))
