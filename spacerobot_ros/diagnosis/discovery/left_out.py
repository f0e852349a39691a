"""What a law explains of parts of a channel that it was not fitted to, against placebos.

Parts are whole recordings where there are several, else fifths of one. A part is predicted by the
others with the law and without it, named causes, inertial errors and other laws free in both: a
law is not credited with what is theirs, nor is a slow one lost to errors that a part alone allows
and all others do not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...estimation.inference.evidence import Fold, Gram, score, sum_of
from ...estimation.inference.placebo import DRAWS, SEED, shuffle
from ...estimation.inference.spectral_terms import rows_of
from ...types import Array
from .law_search import SearchedChannel, Winner, columns_of

_FREE = 1e-6  # precision of coefficients without a prior, of columns of unit size
_WIDE = 1e3  # prior deviation of a law's coefficients, of columns of unit size


@dataclass(frozen=True, slots=True)
class LeftOut:
    """What a law does for parts that it was not fitted to.

    Args:
        inside: Share of the squares of all parts that it explains, fitted to them.
        share: The same of parts that it was not fitted to, as the others predict them.
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
        self._part, self._times = channel.part, channel.times
        self._scale = terms.level(columns_of(chosen, len(terms.data))).scale
        self._data, self._nuisance = self._rows(terms.data), self._rows(terms.nuisance)

    def judge(
        self, columns: Array, others: Sequence[Winner], *, has_placebo: bool = True
    ) -> LeftOut:
        """What (M, k) columns do beside other laws."""
        beside = _normed(self._rows(columns_of(others, len(columns))))
        nuisance = np.concatenate([self._nuisance, beside], axis=1)
        count = self._nuisance.shape[1]
        precision = np.concatenate([np.ones(count), np.full(beside.shape[1], _FREE)])
        own = _normed(self._rows(columns))
        out = self._judged(nuisance, precision, own)
        if not has_placebo:
            return out
        rng, best = np.random.default_rng(SEED), 0.0
        for _ in range(DRAWS):
            order, signs = shuffle(self._times, rng)
            best = max(best, self._judged(nuisance, precision, signs[:, None] * own[order]).share)
        return LeftOut(out.inside, out.share, best, out.agreeing, out.left)

    def _judged(self, nuisance: Array, precision: Array, own: Array) -> LeftOut:
        """What (R, k) columns do beside what is free, (R, K) with a prior precision (K,)."""
        rows = np.concatenate([nuisance, own], axis=1)
        kept = [self._part == k for k in np.unique(self._part)]
        parts = [Gram.of(rows[at], self._data[at]) for at in kept]
        whole, sizes = sum_of(parts), np.full(own.shape[1], _WIDE)
        every = whole.without(len(precision), precision)
        rests = [(whole - part).without(len(precision), precision) for part in parts]
        free = (np.full(len(sizes), -np.inf), np.full(len(sizes), np.inf))
        found = [Fold(rest, every - rest) for rest in rests]
        gains = np.array([score(f.rest, sizes, free, f.part).held_out for f in found])
        square = sum(f.part.square for f in found)
        return LeftOut(
            inside=score(every, sizes, free, None).gain / every.square,
            share=float(np.sum(gains)) / square,
            placebo=0.0,
            agreeing=float(np.mean(gains > 0.0)),
            left=square - float(np.sum(gains)),
        )

    def _rows(self, terms: Array) -> Array:
        return rows_of((terms.T / self._scale).T, len(self._times))


def _normed(columns: Array) -> Array:
    return columns / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
