r"""Covariance of the causes' coefficients that holds where the noise is not what it is thought.

    V_r = V + sum_c t_c t_c' - V_w,    t_c = V X_c' (1 - H_c)^(-1/2) e_c

with e_c what is left in a block, X_c the causes' columns there, all else projected out, and V_w
what the sum is under white noise: of the model's own covariance V the part that comes from noise
is replaced by what blocks show (Liang and Zeger, Biometrika 73 (1986)). H_c is the leverage of a
block; its root makes the sum unbiased under white noise (CR2: Bell and McCaffrey, Survey
Methodology 28 (2002)). Deviations are never below the model's own, whose correlations they keep.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from ..types import Array, IntArray
from .decisive import CLUSTERS
from .hypotheses import FittedBlocks, Hypotheses


@dataclass(frozen=True, slots=True, eq=False)
class RobustCovariance:
    """Of the coefficients of a set of causes, as they are given.

    Args:
        columns: (k,) which, ascending.
        own: (k, k) by the noise as it is thought.
        wider: (k,) times by which deviations are larger, 1 or more.
        freedom: (k,) degrees of freedom of that scatter (Satterthwaite, Biometrics Bulletin 2
            (1946)): the blocks that count.
    """

    columns: IntArray
    own: Array
    wider: Array
    freedom: Array

    @property
    def matrix(self) -> Array:
        """(k, k) covariance, never below the model's own."""
        return self.wider[:, None] * self.own * self.wider

    @property
    def deviations(self) -> Array:
        """(k,) standard deviations."""
        return np.sqrt(np.diag(self.matrix))


def robust_covariance(
    hypotheses: Hypotheses, fitted: FittedBlocks, chosen: Collection[int]
) -> RobustCovariance:
    """Of a set of causes.

    Args:
        hypotheses: All of them.
        fitted: The rows in `CLUSTERS` blocks or more, each some correlation times of the noise
            long.
        chosen: The set.

    Raises:
        ValueError: there are fewer blocks.
    """
    if len(fitted.grams) < CLUSTERS:
        raise ValueError(f'{len(fitted.grams)} blocks of rows, fewer than {CLUSTERS}')
    own, covariance = hypotheses.columns_of(chosen), fitted.covariance
    at = np.searchsorted(fitted.columns, own)
    inside = covariance[np.ix_(at, at)]
    # rows of `project` give causes' columns with all else, as far as it is free, taken out
    project = np.linalg.solve(inside, covariance[at])
    others = covariance - covariance[:, at] @ project
    basis = hypotheses.basis(chosen)
    turned = basis @ inside
    total, white = np.zeros(len(own)), list[Array]()
    for gram in fitted.grams:
        information = project @ gram.matrix @ project.T
        score = project @ (gram.vector - gram.matrix @ fitted.mean)
        lost = min(float(np.sum(others * gram.matrix)) / gram.rows, _MOST_LEVERAGE)
        score = _unbiased(inside, information, score) / np.sqrt(1.0 - lost)
        total += (turned @ score) ** 2
        white.append(np.sum((turned @ information) * turned, axis=1))
    inherent = np.sum(white, axis=0)
    matrix = basis @ inside @ basis.T
    wider = np.sqrt(np.maximum(1.0 + (total - inherent) / np.diag(matrix), 1.0))
    freedom = inherent**2 / np.maximum(np.sum(np.square(white), axis=0), np.finfo(float).tiny)
    return RobustCovariance(own, matrix, wider, freedom)


_MOST_LEVERAGE = 0.99  # of a block's rows that other columns fit


def _unbiased(covariance: Array, information: Array, score: Array) -> Array:
    """(k,) score of a block, divided by the root of what its leverage leaves."""
    root = np.linalg.cholesky(covariance)
    values, vectors = np.linalg.eigh(root.T @ information @ root)
    turned = vectors.T @ (root.T @ score) / np.sqrt(1.0 - np.clip(values, 0.0, _MOST_LEVERAGE))
    return np.asarray(np.linalg.solve(root.T, vectors @ turned))
