"""Which laws of the grammar one joint's rows propose, and how often chance does as well as one."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from ...estimation.balance.arm_levels import leftover_level
from ...estimation.balance.leftover import KalmanGains
from ...estimation.inference.spectral_terms import (
    GroupBasis,
    SpectralTerms,
    Whitening,
    cosines,
    rows_of,
    ways_of_each,
)
from ...types import Array, IntArray
from .arm_motions import ArmMotions
from .possible_laws import NO_LAWS, REFINED, Law

_SHORTLIST, _ALIKE = 8, 2  # proposed; of one family
_STEPS = (1.6, 1.25, 1.1)  # by which options are refined
_WIDEST = 1e3  # times the data: a prior deviation beyond which nothing is tied any less
_UNSEEN = 1e-2  # of the noise, all rows together: what no evidence shows
_FREE = 10.0  # times what is left: an offset's prior deviation


class JointScreen:
    """Whitened rows of one joint as cosine terms, and those of all its laws.

    Args:
        motions: Of the arm.
        j: Number of the joint.
        causes: Numbers of the chosen causes.
        loud: Share of the noise that grows with the rate, see `ArmMotions.loudness`.

    Attributes:
        sizes: (R,) of the noise of rows. variances: (8,) of what is left, by these sizes: a drift
            of friction that is seen where the joint is slow, and the noise small, is none beside
            noise that is thought to be the same all along.
    """

    def __init__(self, motions: ArmMotions, j: int, causes: Collection[int], loud: float) -> None:
        self._motions, self.j, self.sizes = motions, j, motions.loudness(j, loud)
        own, rows = motions.rows.joints[j].over(self.sizes), motions.rows
        self.variances = leftover_level(rows, j, rows.deviations(causes), motions.friction, own)
        self._gains = KalmanGains.of(own.observed, own.gap, self.variances)
        offset = _FREE * float(np.sqrt(np.mean(own.torque**2))) / self.sizes
        every = cosines(self._gains.whitened(np.column_stack([own.torque, offset, own.columns])))
        self._data, self._offset, self._columns = every[:, 0], every[:, 1], every[:, 2:]

    @cached_property
    def laws(self) -> list[Law]:
        """Of the grammar."""
        return self._motions.laws(self.j)

    @cached_property
    def _directions(self) -> tuple[Array, list[IntArray]]:
        return self._ways_of(self.laws)

    def likelihood(self, causes: Collection[int], given: Sequence[Law]) -> float:
        """Log likelihood of the rows beside causes and laws, for comparison over `loud`."""
        level = self._terms(causes).level(self.columns(given))
        return level.likelihood - 0.5 * len(self._data) * float(np.mean(np.log(self._gains.every)))

    def columns(self, laws: Sequence[Law]) -> Array:
        """(M, c) terms of some laws."""
        torques = self._motions.torques(laws, self.j) / self.sizes[:, None]
        return cosines(self._gains.whitened(torques))

    def _ways_of(self, laws: Sequence[Law]) -> tuple[Array, list[IntArray]]:
        """(M, c) directions of each law, and which are whose."""
        ends = np.cumsum([len(law.form.powers) for law in laws])[:-1].tolist()
        ways = ways_of_each(np.split(self.columns(laws), ends, axis=1))
        edges = np.cumsum([0, *(own.shape[1] for own in ways)]).tolist()
        return np.concatenate(ways, axis=1), [np.arange(a, b) for a, b in pairwise(edges)]

    def _terms(self, causes: Collection[int]) -> SpectralTerms:
        """Beside causes, whose sizes are free, and tolerances."""
        deviations = self._motions.rows.deviations(causes)
        nuisance = np.column_stack([self._offset, self._columns * deviations])
        sizes = np.linalg.norm(nuisance, axis=0)
        most = _WIDEST * float(np.linalg.norm(self._data))
        seen = sizes > _UNSEEN
        return SpectralTerms(self._data, nuisance[:, seen] * np.minimum(1.0, most / sizes[seen]))

    def proposals(self, causes: Collection[int], given: Sequence[Law]) -> list[Law]:
        """The best laws beside causes and other laws, options refined; few say the same."""
        terms, beside = self._terms(causes), self.columns(given)
        scores = _Scores(terms, terms.level(beside).scale, beside)
        found = scores.of(*self._directions, self.laws)
        short = [g for g in self._shortlist(found) if found[g] > 0.0]
        return self._refined([self.laws[g] for g in short], found[short], scores)

    def _shortlist(self, scores: Array) -> list[int]:
        taken: dict[object, int] = {}
        out: list[int] = []
        for g in np.argsort(-scores).tolist():
            family = self.laws[g].family
            taken[family] = taken.get(family, 0) + 1
            if taken[family] <= _ALIKE:
                out.append(g)
            if len(out) == _SHORTLIST:
                break
        return out

    def _refined(self, laws: Sequence[Law], found: Array, scores: _Scores) -> list[Law]:
        """The same with the options of the largest scores."""
        out, best = [*laws], found.tolist()
        for factor in _STEPS:
            moved = [
                (n, replace(law, options={**law.options, option: step * law.options[option]}))
                for n, law in enumerate(out)
                for option in set(REFINED).intersection(law.options)
                for step in (factor, 1.0 / factor)
            ]
            tried = [law for _, law in moved]
            if not tried:
                break
            values = scores.of(*self._ways_of(tried), tried).tolist()
            for (n, law), value in zip(moved, values, strict=True):
                if value > best[n]:
                    out[n], best[n] = law, value
        return out

    def chance(self, law: Law, causes: Collection[int], given: Sequence[Law]) -> float:
        """Probability that the best of all laws, or of what is none, does as well by chance.

        By its gain in log likelihood, less its price, with the level that each hypothesis leaves
        itself: under the level that it leaves it would be larger, by all that is chance in it.

        Args:
            law: The law.
            causes: Numbers of all causes beside it.
            given: Other laws.
        """
        terms = self._terms(causes)
        beside, both = (self.columns(some) for some in (given, [*given, law]))
        level = terms.level(both)
        gain = level.likelihood - terms.level(beside).likelihood - law.price
        scores = _Scores(terms, level.scale, beside)
        is_law = law.kind not in NO_LAWS
        asked = [g for g, k in enumerate(self.laws) if k.kind not in NO_LAWS or not is_law]
        ways, groups = self._directions
        own = np.concatenate([groups[g] for g in asked])
        ends = np.cumsum([len(groups[g]) for g in asked])[:-1]
        basis = scores.basis(ways[:, own], np.split(np.arange(len(own)), ends))
        prices = np.array([self.laws[g].price for g in asked]) + basis.prices

        def largest(residuals: Array) -> Array:
            return np.asarray(np.max(_fits(basis, residuals) - prices[:, None], axis=0))

        left = _without(scores.white(both), scores.white(terms.data))
        return chance_of(gain, largest, left, len(self.sizes))


class _Scores:
    """What laws are worth beside others, under one level.

    Args:
        terms: With causes. scale: (M,) level. beside: (M, k) terms of other laws.
    """

    def __init__(self, terms: SpectralTerms, scale: Array, beside: Array) -> None:
        self.white, self._size = Whitening(terms.nuisance, scale), terms.size
        self._given = self.white(beside)
        self._data = _without(self._given, self.white(terms.data))

    def basis(self, ways: Array, groups: Sequence[IntArray]) -> GroupBasis:
        """Of directions (M, c) with a prior of the data's size."""
        return GroupBasis(self._size * _without(self._given, self.white(ways)), groups)

    def of(self, ways: Array, groups: Sequence[IntArray], laws: Sequence[Law]) -> Array:
        """(G,) gains in log likelihood, the level with them, beyond all prices [nats]."""
        basis = self.basis(ways, groups)
        prices = basis.prices + np.array([law.price for law in laws])
        return np.asarray(_fits(basis, self._data[:, None])[:, 0] - prices)


def _fits(basis: GroupBasis, residuals: Array) -> Array:
    """(G, F) gains in log likelihood of (M, F) residuals, of the level that each law leaves."""
    share = basis.gains(residuals) / np.sum(residuals**2, axis=0)
    return np.asarray(-0.5 * len(residuals) * np.log1p(-np.minimum(share, 1.0 - 1e-12)))


def _without(columns: Array, values: Array) -> Array:
    """Values with the best combination of columns taken off."""
    if not columns.shape[1]:
        return values
    q, _ = np.linalg.qr(columns)
    return np.asarray(values - q @ (q.T @ values))


FLIPS = 500  # of which the rarest tenth tells its slope to 1/sqrt(50), 14 %
_BLOCKS = 40  # in time: of 40 s a second each, over which noise that grows with the rate varies
_SEED = 13  # any serves
_RARE = 0.1

Statistic = Callable[[Array], Array]
"""(F,) largest score over all laws of (M, F) whitened residuals."""


def chance_of(
    score: float,
    largest: Statistic,
    left: Array,
    count: int,
) -> float:
    """Probability that the best of all laws scores so high by chance.

    Data without meaning are what the law itself leaves, with random signs: of its whitened cosine
    terms, which keeps the spectrum, lines included; and of blocks in time, which keeps noise that
    grows where the motion is fast. The more careful of the two counts.

    A score is a logarithm of odds, and chance exceeds it exponentially: by s nats more with
    exp(-s) at most, as odds do, or steeper as the rarest tenth of the repetitions says. Most laws
    are nearly what tolerances allow, which neither gain nor cost anything, so that the usual best
    score hardly varies from one repetition to the next and says nothing of its tail.

    Args:
        score: Of the law, with the level that each hypothesis leaves itself: under the level that
            it leaves it would be larger, by all that is chance in this level.
        largest: The search.
        left: (M,) whitened residual with the law.
        count: Of rows in time.
    """
    rng = np.random.default_rng(_SEED)
    signs = rng.choice([-1.0, 1.0], (len(left), FLIPS))
    rows = rows_of(left, count)
    block = (np.arange(len(rows)) * _BLOCKS) // len(rows)
    turned = rows[:, None] * rng.choice([-1.0, 1.0], (_BLOCKS, FLIPS))[block]
    return max(_tail(score, largest(draws)) for draws in (signs * left[:, None], cosines(turned)))


def _tail(score: float, draws: Array) -> float:
    """Probability of a score, from where the rarest draws begin and how they fall off."""
    start = float(np.quantile(draws, 1.0 - _RARE))
    if score < start:
        return float(np.mean(draws >= score))
    beyond = draws[draws > start] - start
    fall = min(float(np.mean(beyond)), 1.0) if len(beyond) else 1.0
    return _RARE * math.exp((start - score) / max(fall, 1e-3))
