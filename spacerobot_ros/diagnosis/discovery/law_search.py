"""Which laws of the grammar the terms of one channel want, one after another."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...estimation.inference.spectral_terms import (
    GroupBasis,
    Level,
    Whitening,
    cosines,
    rows_of,
    ways_of_each,
)
from ...types import Array, BoolArray, IntArray
from .arm_channels import JointChannel
from .discovery_limits import CHANCE, DEAD_HEAT, LEFT, MARGIN, MOST_LAWS
from .possible_laws import NO_LAWS, PLAIN, REFINED, SINE, Law

_SHORTLIST, _ALIKE = 8, 2  # refitted; of one family
_STEPS = (1.6, 1.25, 1.1)  # by which options are refined


@dataclass(frozen=True, eq=False)
class Winner:
    """A law that won.

    Args:
        law: A law, or what is none: a function of the time, an inertial error.
        columns: (M, k).
        margin: Gain in log likelihood beyond every price [nats].
        p_value: Of such a win by chance.
        rivals: Laws and margins that come close.
    """

    law: Law
    columns: Array
    margin: float
    p_value: float
    rivals: tuple[tuple[Law, float], ...] = ()

    @property
    def is_law(self) -> bool:
        """Whether it is neither a sine of the time, a drift, nor an inertial error."""
        return self.law.kind not in NO_LAWS

    @property
    def doubt(self) -> float:
        """Odds that the variables are others: all rivals with neither some of them nor more."""
        own = set(self.law.inputs)
        others = ((set(law.inputs), gap) for law, gap in self.rivals)
        return sum(math.exp(-gap) for it, gap in others if not (it <= own or own <= it))


def columns_of(steps: Sequence[Winner], count: int) -> Array:
    """(M, K) columns of all of them, M their number of terms."""
    return np.concatenate([np.zeros((count, 0)), *(step.columns for step in steps)], axis=1)


def worth(channel: JointChannel, laws: Sequence[Law], causes: Sequence[int] = ()) -> float:
    """Log likelihood of a channel with some laws, less their prices [nats].

    Args:
        channel: The channel.
        laws: They.
        causes: What has a prior as laws have, too.
    """
    columns = np.concatenate([channel.of_causes(causes), *channel.columns(laws)], axis=1)
    return channel.terms.level(columns).likelihood - sum(law.price for law in laws)


class LawSearch:
    """Forward choice of laws.

    Args:
        channel: The channel.
        chance: Probability below which a law is none.
    """

    def __init__(self, channel: JointChannel, chance: float = CHANCE) -> None:
        self.channel, self.terms, self.chance = channel, channel.terms, chance
        every = zip(channel.laws, channel.columns(channel.laws), strict=True)
        pairs = [(law, columns) for law, columns in every if np.any(columns)]
        self.laws = [law for law, _ in pairs]
        own = [columns for _, columns in pairs]
        ends = np.cumsum([0, *(c.shape[1] for c in own)])
        self.groups: list[IntArray] = [np.arange(a, b) for a, b in pairwise(ends.tolist())]
        nothing = np.zeros((len(self.terms.data), 0))
        self.columns = np.concatenate([nothing, *own], axis=1)
        self.ways = np.zeros_like(self.columns)
        # an offset is free: a spring's share of it tells nothing of how much of a law is left
        ways_of_own = ways_of_each([self.terms.beside_offset(columns) for columns in own])
        for at, ways in zip(self.groups, ways_of_own, strict=True):
            self.ways[:, at[: ways.shape[1]]] = ways

    def run(self) -> list[Winner]:
        """Laws in their order, sines of the time and inertial errors among them."""
        chosen: list[Winner] = []
        while self.groups and len(chosen) < MOST_LAWS:
            step = self._next(chosen)
            if step is None:
                break
            chosen.append(step)
        return chosen

    def best_of(self, chosen: Sequence[Winner], is_asked: Callable[[Law], bool]) -> Array | None:
        """(M, k) columns of the best of some laws beside chosen ones."""
        beside = columns_of(chosen, len(self.terms.data))
        judge = _Judge(self, self.terms.level(beside).scale, beside)
        scores = judge.scores(judge.data[:, None])[:, 0]
        asked = [g for g, law in enumerate(self.laws) if is_asked(law)]
        return self.columns[:, self.groups[max(asked, key=scores.__getitem__)]] if asked else None

    def _next(self, chosen: Sequence[Winner]) -> Winner | None:
        """The best further law; None where none is clear of chance."""
        beside = columns_of(chosen, len(self.terms.data))
        here = self.terms.level(beside)
        judge = _Judge(self, here.scale, beside)
        scores = judge.scores(judge.data[:, None])[:, 0]
        refitted = self._refitted(self._shortlist(scores), beside, here)
        margin, g, level = refitted[0]
        if margin < MARGIN:
            return None
        is_law = self.laws[g].kind not in NO_LAWS
        if is_law and self._belongs_to_causes(margin, judge, beside, here):
            return None
        p_value = self._chance(g, margin, beside, level, judge.usable)
        if p_value > self.chance:
            return None
        margin, g = self._plainer(refitted)
        close = [(k, m) for m, k, _ in refitted if k != g and margin - m < DEAD_HEAT]
        rivals = tuple((self.laws[k], margin - m) for k, m in close)
        law, columns, margin = self._refined(g, beside, here, margin)
        return Winner(law, columns, margin, p_value, rivals)

    def _beside(self, g: int, beside: Array) -> Array:
        """(M, K) columns of a law beside those of others."""
        return np.concatenate([beside, self.columns[:, self.groups[g]]], axis=1)

    def _plainer(self, refitted: Sequence[tuple[float, int, Level]]) -> tuple[float, int]:
        """Margin and number of the best law, or of a polynomial in the place of a part of a sine.

        Nobody has seen a sine of which the motion shows no whole period. Along angles beyond it
        turns back, where a polynomial goes on (a stiffening spring: R2 0.97 on another motion, of
        sines half a nat ahead 0.49).
        """
        margin, g, _ = refitted[0]
        best = self.laws[g]
        if best.form.name == SINE and self.channel.extent.turns(best) < 1.0:
            for other, k, _ in refitted:
                law = self.laws[k]
                if (
                    law.inputs == best.inputs
                    and law.form.name == PLAIN
                    and margin - other < DEAD_HEAT
                ):
                    return other, k
        return margin, g

    def _refitted(
        self, groups: Sequence[int], beside: Array, here: Level
    ) -> list[tuple[float, int, Level]]:
        """Margin, law and level of each, the best first."""
        out = []
        for g in groups:
            level = self.terms.level(self._beside(g, beside))
            out.append((level.likelihood - here.likelihood - self.laws[g].price, g, level))
        return sorted(out, key=lambda entry: -entry[0])

    def _belongs_to_causes(self, margin: float, judge: _Judge, beside: Array, here: Level) -> bool:
        """Whether a law that is nearly a free cause explains more than the best that is asked.

        Then the cause is of a slightly other shape, which a law of other variables would follow.
        """
        every = _Judge(self, here.scale, beside, np.ones(self.ways.shape[1], dtype=bool))
        scores = every.scores(every.data[:, None])[:, 0]
        known = [np.any(judge.usable[at]) for at in self.groups]
        near = self._shortlist(np.where(known, -np.inf, scores), _ALIKE)
        near = [g for g in near if not known[g]]
        return any(m > margin for m, _, _ in self._refitted(near, beside, here))

    def _chance(
        self, g: int, margin: float, beside: Array, level: Level, usable: BoolArray
    ) -> float:
        """Of its margin, among the laws that were asked."""
        both = self._beside(g, beside)
        judge = _Judge(self, level.scale, beside, usable)
        return chance_of(
            margin,
            judge.largest,
            _without(judge.white(both), judge.white(self.terms.data)),
            len(self.channel.times),
        )

    def _refined(
        self, g: int, beside: Array, here: Level, margin: float
    ) -> tuple[Law, Array, float]:
        """The law with the options that the likelihood likes best."""
        law, columns = self.laws[g], self.columns[:, self.groups[g]]
        for option in [name for name in REFINED if name in law.options]:
            for factor in _STEPS:
                for step in (factor, 1.0 / factor):
                    tried = replace(
                        law, options={**law.options, option: step * law.options[option]}
                    )
                    (moved,) = self.channel.columns([tried])
                    level = self.terms.level(np.concatenate([beside, moved], axis=1))
                    gain = level.likelihood - here.likelihood - self.laws[g].price
                    if gain > margin:
                        law, columns, margin = tried, moved, gain
        return law, columns, margin

    def _shortlist(self, scores: Array, count: int = _SHORTLIST) -> list[int]:
        taken: dict[object, int] = {}
        out: list[int] = []
        for g in np.argsort(-scores).tolist():
            family = self.laws[g].family
            taken[family] = taken.get(family, 0) + 1
            if taken[family] <= _ALIKE:
                out.append(g)
            if len(out) == count:
                break
        return out


class _Judge:
    """All laws beside chosen ones, under one level.

    Args:
        search: The search. scale: (M,) level. beside: (M, k) columns of the chosen laws.
        usable: (C,) directions that are asked; None: of which free causes and chosen laws leave
            enough under this level.
    """

    def __init__(
        self, search: LawSearch, scale: Array, beside: Array, usable: BoolArray | None = None
    ) -> None:
        terms = search.terms
        self.white = Whitening(terms.nuisance, scale)
        own = self.white(beside)
        self.data = _without(own, self.white(terms.data))
        ways = _without(own, self.white(search.ways))
        if usable is None:
            tolerated = Whitening(terms.nuisance[:, ~terms.is_free], scale)
            before = np.sum(tolerated(search.ways) ** 2, axis=0)
            usable = np.sum(ways**2, axis=0) > LEFT * before
        self.usable = usable
        self._basis = GroupBasis(terms.size * ways * usable, search.groups)
        prices = np.array([law.price for law in search.laws])
        self._prices = self._basis.prices + prices

    def scores(self, residuals: Array) -> Array:
        """(G, F) log likelihood beyond all prices, of (M, F) residuals."""
        share = self._basis.gains(residuals) / np.sum(residuals**2, axis=0)
        fit = -0.5 * len(residuals) * np.log1p(-np.minimum(share, 1.0 - 1e-12))
        return np.asarray(fit - self._prices[:, None])

    def largest(self, residuals: Array) -> Array:
        """(F,) of the best law."""
        return np.asarray(np.max(self.scores(residuals), axis=0))


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
