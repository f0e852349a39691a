"""The change of each cause that would have been named."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...inference.decisive import NAMED
from ...inference.hypotheses import FittedBlocks, Hypotheses
from ...inference.marginal import Marginal
from ...types import Array
from ..limits import CLEAR


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

    def limit(self, i: int, direction: Array | None = None) -> float:
        r"""Least multiple of a direction of a hypothesis's coefficients; infinite: none.

        The log evidence of a multiple x of a step z is, noise aside,

            1/2 x^2 (W z)' D A^-1 W z - 1/2 ln |A|,    A = 1 + W D

        with W what the rows tell of the coefficients and D their slab less their spike. It has to
        exceed `NAMED` and the prior by the scatter of blocks as they are. One deviation beyond
        what is named half of the time is in five of six.

        Args:
            i: The hypothesis.
            direction: (k,); None: of the first coefficient, the others nothing.
        """
        every, without = self.hypotheses, self._marginal
        if i in self.chosen:
            without = without.changed(*every.exchange((), [i]))
        own, more = every.exchange([i])
        at = np.searchsorted(without.columns, own)
        told = without.matrix[np.ix_(at, at)]
        occam = np.eye(len(own)) + told * more
        along = np.eye(len(own))[0] if direction is None else direction
        along = np.linalg.solve(every.bases[i], along)
        seen = told @ along
        power = float((seen * more) @ np.linalg.solve(occam, seen))
        if power <= 0.0:
            return math.inf
        deviation, wider, freedom = self._scatter(i, along, without.changed(own, more))
        need = NAMED - every.log_odds[i]
        gain = 0.5 * freedom * math.expm1(2.0 * need / (freedom + 1.0)) * wider**2
        cost = gain + 0.5 * float(np.linalg.slogdet(occam)[1])
        return max(math.sqrt(2.0 * cost / power), CLEAR * deviation) + deviation

    def _scatter(self, i: int, along: Array, marginal: Marginal) -> tuple[float, float, float]:
        """Deviation of the multiple by blocks, times what rows say, and its freedom."""
        every, h = self.hypotheses, self.hypotheses.every[i]
        columns = np.union1d(self._fitted.columns, h.columns)
        variances = every.variances(self.chosen | {i})[columns]
        covariance = marginal.covariance(columns, variances)[np.searchsorted(columns, h.columns)]
        within = covariance[:, np.searchsorted(columns, h.columns)]
        weights = np.linalg.solve(within, along)
        own = 1.0 / float(weights @ along)
        weights = own * weights @ covariance[:, np.searchsorted(columns, self._fitted.columns)]
        inherent = np.array([weights @ gram.matrix @ weights for gram in self._fitted.grams])
        total = float(np.sum((self._scores @ weights) ** 2))
        freedom = float(np.sum(inherent) ** 2 / max(np.sum(inherent**2), np.finfo(float).tiny))
        wider = math.sqrt(1.0 + max(total - float(np.sum(inherent)), 0.0) / own)
        return wider * math.sqrt(own), wider, max(freedom, 1.0)
