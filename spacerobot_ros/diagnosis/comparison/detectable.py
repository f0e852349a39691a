"""The change of each cause that would have been named."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...inference.hypotheses import FittedBlocks, Hypotheses
from ...inference.marginal import Marginal
from ...types import Array
from ..limits import CLEAR, NAMED


@dataclass(frozen=True, eq=False)
class Detection:
    """Least coefficients that would have had a name beside a set of causes.

    Args:
        hypotheses: All of them.
        chosen: Numbers of the causes.
    """

    hypotheses: Hypotheses
    chosen: frozenset[int]

    @cached_property
    def _marginal(self) -> Marginal:
        return self.hypotheses.marginal(self.chosen)

    @cached_property
    def _fitted(self) -> FittedBlocks:
        return self.hypotheses.fitted(self._marginal, self.chosen)

    @cached_property
    def _scores(self) -> Array:
        """(B, n) of every block for the columns in use."""
        mean = self._fitted.mean
        return np.array([gram.vector - gram.matrix @ mean for gram in self._fitted.grams])

    def limit(self, i: int) -> float:
        r"""Of the first coefficient of a hypothesis, the others nothing; infinite: never.

        The log evidence of a multiple x of a step z is, noise aside,

            1/2 x^2 (W z)' D A^-1 W z - 1/2 ln |A|,    A = 1 + W D

        with W what the rows tell of the coefficients and D their slab less their spike. It has to
        exceed `NAMED` and the prior by the scatter of blocks as they are. One deviation beyond
        what is named half of the time is in five of six.
        """
        every, without = self.hypotheses, self._marginal
        if i in self.chosen:
            without = without.changed(*every.exchange((), [i]))
        own, more = every.exchange([i])
        at = np.searchsorted(without.columns, own)
        told = without.matrix[np.ix_(at, at)]
        occam = np.eye(len(own)) + told * more
        seen = told @ np.linalg.solve(every.bases[i], np.eye(len(own))[0])
        power = float((seen * more) @ np.linalg.solve(occam, seen))
        if power <= 0.0:
            return math.inf
        deviation, wider, freedom = self._scatter(i, without.changed(own, more))
        need = NAMED - every.log_odds[i]
        gain = 0.5 * freedom * math.expm1(2.0 * need / (freedom + 1.0)) * wider**2
        cost = gain + 0.5 * float(np.linalg.slogdet(occam)[1])
        return max(math.sqrt(2.0 * cost / power), CLEAR * deviation) + deviation

    def _scatter(self, i: int, marginal: Marginal) -> tuple[float, float, float]:
        """Deviation of its first coefficient by blocks, times what rows say, and its freedom."""
        every, h = self.hypotheses, self.hypotheses.every[i]
        columns = np.union1d(self._fitted.columns, h.columns)
        variances = every.variances(self.chosen | {i})[columns]
        at = np.searchsorted(columns, h.columns)
        covariance = every.bases[i] @ marginal.covariance(columns, variances)[at]
        own = float(covariance[0, at] @ every.bases[i][0])
        weights = covariance[0, np.searchsorted(columns, self._fitted.columns)]
        inherent = np.array([weights @ gram.matrix @ weights for gram in self._fitted.grams])
        total = float(np.sum((self._scores @ weights) ** 2))
        freedom = float(np.sum(inherent) ** 2 / max(np.sum(inherent**2), np.finfo(float).tiny))
        wider = math.sqrt(1.0 + max(total - float(np.sum(inherent)), 0.0) / own)
        return wider * math.sqrt(own), wider, max(freedom, 1.0)
