"""What a law explains of parts of a channel that it was not fitted to, against placebos.

Parts are whole recordings where there are several, else fifths of one. Named causes, inertial
errors and other laws are free in every part, so that a law is not credited with what is theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...estimation.evidence import Gram, folds, score, sum_of
from ...estimation.placebo import held_out_gain
from ...types import Array
from .law_search import SearchedChannel, Winner
from .spectral_terms import Whitening, rows_of

_FREE = 1e-6  # precision of coefficients without a prior, of columns of unit size
_WIDE = 1e3  # prior deviation of a law's coefficients, of columns of unit size


@dataclass(frozen=True, slots=True)
class LeftOut:
    """What a law does for parts that it was not fitted to.

    Args:
        inside: Share of the squares of all parts that it explains, fitted to them.
        share: The same of parts that it was not fitted to.
        placebo: The same of the best columns without meaning.
        agreeing: Share of parts that it explains anything of.
        left: Squares that it leaves of parts that it was not fitted to.
    """

    inside: float
    share: float
    placebo: float
    agreeing: float
    left: float


class Parts:
    """A channel's rows, white under the level that laws leave, part by part.

    Args:
        channel: The channel.
        chosen: All laws.
    """

    def __init__(self, channel: SearchedChannel, chosen: Sequence[Winner]) -> None:
        terms = channel.terms
        self._channel, self._part, self._times = channel, channel.part, channel.times
        self.level = terms.level(_beside(chosen, len(terms.data)))
        self._scale = self.level.scale
        self._white = Whitening(terms.nuisance, self._scale)
        self._data = self._rows(terms.data)
        self._nuisance = self._rows(terms.nuisance)

    def judge(
        self, columns: Array, others: Sequence[Winner], *, has_placebo: bool = True
    ) -> LeftOut:
        """What (M, k) columns do beside other laws."""
        own, beside = self._rows(columns), self._rows(_beside(others, len(columns)))
        own, beside = _normed(own), _normed(beside)
        rows = np.concatenate([self._nuisance, beside, own], axis=1)
        parts = [
            Gram.of(rows[self._part == k], self._data[self._part == k])
            for k in np.unique(self._part)
        ]
        count = self._nuisance.shape[1]
        precision = np.concatenate([np.ones(count), np.full(beside.shape[1], _FREE)])
        sizes = np.full(own.shape[1], _WIDE)
        free = (np.full(len(sizes), -np.inf), np.full(len(sizes), np.inf))
        found = folds(parts, len(precision), precision)
        gains = np.array([score(f.rest, sizes, free, f.part).held_out for f in found])
        square = sum(f.part.square for f in found)
        whole = sum_of(parts).without(len(precision), precision)
        return LeftOut(
            inside=score(whole, sizes, free, None).gain / whole.square,
            share=float(np.sum(gains)) / square,
            placebo=self._placebo(columns, others, sizes) if has_placebo else 0.0,
            agreeing=float(np.mean(gains > 0.0)),
            left=square - float(np.sum(gains)),
        )

    def _placebo(self, columns: Array, others: Sequence[Winner], sizes: Array) -> float:
        """Share that the best placebo explains."""
        beside = self._white(_beside(others, len(columns)))
        data, own = self._white(self._channel.terms.data), self._white(columns)
        if beside.shape[1]:
            q, _ = np.linalg.qr(beside)
            data, own = data - q @ (q.T @ data), own - q @ (q.T @ own)
        count = len(self._times)
        data, own = rows_of(data, count), rows_of(own, count)
        own = _normed(own)
        ends = np.searchsorted(self._part, np.arange(self._part[-1] + 2))
        slices = [slice(a, b) for a, b in pairwise(ends.tolist())]
        gain = held_out_gain(own, data, sizes, slices, self._times)
        return gain / float(data @ data)

    def _rows(self, terms: Array) -> Array:
        return rows_of((terms.T / self._scale).T, len(self._times))


def _normed(columns: Array) -> Array:
    return columns / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)


def _beside(steps: Sequence[Winner], count: int) -> Array:
    return np.concatenate([np.zeros((count, 0)), *(step.columns for step in steps)], axis=1)
