"""The causes of what a predicting filter misses: the best set on columns, fitted as it really is.

Columns hold for small effects only. What a set loses most by is fitted, and columns are made anew
where these rows are far from what the old ones promised; until the set that columns want is the
one that was fitted, and its causes predict parts of the record. Columns along the recorded motion
promise all to a body that is gone where all forces may be gone, too: where the best set without
its largest new cause promises more than a fit has given, both are fitted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple, cast

import numpy as np

from ...effects.effect import Effect, Key
from ...estimation.columns import Candidate
from ...estimation.fit import Fit
from ...estimation.refit import refine
from ...estimation.runs import Run
from ...formats import counted
from ...inference.decisive import CONFOUNDED, FAMILYWISE
from ...inference.hypotheses import Hypotheses
from ...inference.hypothesis import Hypothesis
from ...inference.inferred import Inferred, InferredCause, infer
from ...inference.model_search import RISE, ChosenSet, best_set
from ...types import Array
from ..limits import CLEAR, CURVED, FITS
from .found import Found, rivals_of
from .linear_rows import CandidateColumns, LinearRows, Variant, variant_of
from .timing import log_odds_of, timings

MOST_CAUSES = 12
"""Causes of a record whose columns hold for small effects only: bounds the run time where nothing
fits, and is said. More than three at once were never told apart in 20 s."""

AT_ONCE, AHEAD = 4, 8
"""Causes that are fitted before columns are made anew, and that columns may want beyond a fit's,
to see them beside each other: both bound the run time of a model that is far off."""


@dataclass(frozen=True, slots=True, eq=False)
class _Wanted:
    """A set of causes that columns want.

    Args:
        timing: How efforts act there.
        causes: The set. mean: (K,) coefficients of all columns.
        losses: What dropping each loses [nats].
    """

    timing: str
    causes: list[Hypothesis]
    mean: Array
    losses: list[float]


@dataclass(frozen=True, slots=True, eq=False)
class _Timed:
    """Rows by one timing.

    Args:
        hypotheses: About them.
        few: The best set with one cause more than the fit's at most.
        is_good: Whether the fit's causes leave no more than a right model usually does.
    """

    hypotheses: Hypotheses
    few: ChosenSet
    is_good: bool


class _Attempt(NamedTuple):
    """A fit of other causes, and by how much it is better than the present one [nats]."""

    fit: Fit
    gap: float


class RelinearizedSearch:
    """Causes of one run.

    Args:
        run: The run.
        kinds: The catalogue, or a part of it.
        report: Called with what is being done and how far it is, from 0 to 1.
    """

    def __init__(
        self, run: Run, kinds: Sequence[type[Effect]], report: Callable[[str, float], None]
    ) -> None:
        self._kinds, self._report = kinds, report
        self._barred = set[Key]()  # for good: predicts nothing
        self._beaten = dict[Key, tuple[frozenset[Key], float]]()  # beside the present fit
        self._left = set[tuple[frozenset[Key], str]]()
        self._now = self._about(Fit(run, ()))

    def find(self) -> Found:
        """Move to better fits until there is none and every cause predicts."""
        run = self._now.fit.run
        while True:
            while self._moves_to_columns():
                pass
            blocks = self._now.blocks(self._now.data)
            inferred = infer(blocks, self._open(), MOST_CAUSES)
            if not self._moves_by(inferred):
                break
        now, rivals = self._now, self._rivals(inferred)
        null = Fit(run.timed(now.fit.run.timing), ())
        again = partial(refine, now.fit.run)
        return Found(null, now.fit, blocks, now.hypotheses, inferred, rivals, again)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Whose columns were made about the last model."""
        return self._now.columns.candidates

    def _about(self, fit: Fit) -> LinearRows:
        self._report('judging every effect at every place', 0.2)
        return LinearRows(fit, CandidateColumns.of(fit, self._kinds))

    def _open(self) -> list[Hypothesis]:
        """Hypotheses, those that proved to be none without a chance."""
        closed = {*self._barred, *self._beaten} - {c.key for c in self._now.fit.causes}
        return [
            replace(h, log_odds=-math.inf) if variant_of(h).key in closed else h
            for h in self._now.hypotheses
        ]

    def _hypotheses(self) -> Hypotheses:
        return Hypotheses(self._now.blocks(self._now.data), self._open())

    def _moves_to_columns(self) -> bool:
        """Whether there is another set to look at."""
        wanted = self._wanted()
        held = {c.key for c in self._now.fit.causes}
        keys = {variant_of(h).key for h in wanted.causes}
        if keys == held and wanted.timing == self._now.fit.run.timing:
            return False
        first = self._first(wanted)
        tried = self._fitted(first, wanted.mean, wanted.timing)
        new = [h for h in first if variant_of(h).key not in held]
        if new:
            other = self._wanted(new[0])
            instead = self._first(other)
            if self._promised(instead, other.timing) > max(tried.gap, RISE):
                both = tried, self._fitted(instead, other.mean, other.timing)
                tried = max(filter(self._leads, both), key=lambda it: it.gap, default=tried)
        return self._takes(tried)

    def _first(self, wanted: _Wanted) -> list[Hypothesis]:
        """Those of a set that the fit has, then the largest others."""
        held = {c.key for c in self._now.fit.causes}
        large = CURVED * max(wanted.losses, default=0.0)
        new = [
            h
            for h, loss in sorted(
                zip(wanted.causes, wanted.losses, strict=True), key=lambda it: -it[1]
            )
            if variant_of(h).key not in held and loss >= large
        ]
        return [*(h for h in wanted.causes if variant_of(h).key in held), *new[:AT_ONCE]]

    @property
    def timing(self) -> str:
        """How efforts act, most probably, with one cause more at most.

        A timing under which the model fits as it stands asks for no cause, which half an interval
        may look like.
        """
        every = self._by_timing
        fitting = [t for t, under in every.items() if under.is_good]
        return max(fitting or every, key=lambda t: every[t].few.objective + log_odds_of(t))

    @cached_property
    def _by_timing(self) -> dict[str, _Timed]:
        """What the rows of every timing want; columns of one serve for all."""
        now, out = self._now, dict[str, _Timed]()
        held, about = range(len(now.fit.causes)), self._hypotheses()
        for timing in timings(now.fit):
            under, fit = about, now.fit
            if timing != now.fit.run.timing:
                fit = Fit(now.fit.run.timed(timing), now.fit.causes)
                if len(fit.data) != len(now.fit.data):
                    continue
                under = about.with_data(now.blocks(now.data + fit.data - now.fit.data))
            few = best_set(under, held, is_thorough=False, most=len(held) + 1)
            p_value, _ = fit.rows.whiteness()
            out[timing] = _Timed(under, few, p_value is not None and p_value >= FITS)
        return out

    def _wanted(self, without: Hypothesis | None = None) -> _Wanted:
        """The best set under the most probable timing, or the best without a cause."""
        timing, held = self.timing, len(self._now.fit.causes)
        under = self._by_timing[timing]
        hypotheses = under.hypotheses
        barred = {
            i
            for i, h in enumerate(hypotheses.every)
            if without is not None and h.family == without.family
        }
        start = under.few.chosen - barred
        found = best_set(hypotheses, start, barred, is_thorough=False, most=held + AHEAD)
        chosen = sorted(found.chosen)
        losses = []
        for i in chosen:
            columns, change = hypotheses.exchange((), [i])
            gain = float(found.marginal.gains(columns[None], change[None])[0])
            losses.append(hypotheses.log_odds[i] - gain)
        mean = hypotheses.mean(found.marginal, found.chosen)
        return _Wanted(timing, [hypotheses.every[i] for i in chosen], mean, losses)

    def _moves_by(self, inferred: Inferred) -> bool:
        """Whether validation or a rival leads to another fit."""
        now = self._now.fit
        held = {c.key for c in now.causes}
        wanted = {variant_of(c).key for c in inferred.causes}
        excluded = {cast(Variant, key).key for key in inferred.excluded}
        self._barred |= excluded
        every = {variant_of(h): h for h in self._now.hypotheses}
        causes = [every[variant_of(c)] for c in inferred.causes]
        if wanted != held:
            is_less = wanted < held
            if is_less:
                self._barred |= held - wanted
            is_forced = is_less or bool(held & excluded)
            self._tries(causes, inferred.mean, now.run.timing, is_forced=is_forced)
            return True
        return any(
            self._moves_to([h for h in causes if h.key != cause.key], [every[k] for k in instead])
            for cause in inferred.causes
            for instead in _doubtful(cause)
        )

    def _moves_to(self, rest: list[Hypothesis], instead: list[Hypothesis]) -> bool:
        """Whether some causes with others in the place of one are a better fit."""
        now = self._now.fit
        if any(variant_of(h).key in self._beaten for h in instead):
            return False
        hypotheses = self._hypotheses()
        number = {h.key: i for i, h in enumerate(hypotheses.every)}
        chosen = ChosenSet.of(hypotheses, [number[h.key] for h in (*rest, *instead)])
        mean = hypotheses.mean(chosen.marginal, chosen.chosen)
        self._tries([*rest, *instead], mean, now.run.timing)
        return self._now.fit is not now

    def _tries(
        self, causes: Sequence[Hypothesis], mean: Array, timing: str, *, is_forced: bool = False
    ) -> bool:
        """Fit some causes as they are; whether anything changed for the next search."""
        return self._takes(self._fitted(causes, mean, timing), is_forced=is_forced)

    def _fitted(self, causes: Sequence[Hypothesis], mean: Array, timing: str) -> _Attempt:
        """Some causes as they are."""
        now = self._now.fit
        self._report(f'fitting {counted(len(causes), "cause")}', 0.4)
        run = now.run if timing == now.run.timing else now.run.timed(timing)
        fit = refine(run, self._now.guesses(causes, mean))
        if _steps(fit) == _steps(now):
            gap = self._objective(fit) - self._objective(now)
        else:  # a clock that is late puts samples on times of their own: other errors, not fewer
            gap = self._promised(causes, timing)
        return _Attempt(fit, gap)

    def _takes(self, tried: _Attempt, *, is_forced: bool = False) -> bool:
        """Whether a fit that was tried changes anything for the next search."""
        held, keys = _set_of(self._now.fit)[0], _set_of(tried.fit)[0]
        if is_forced or self._leads(tried):
            self._left.add(_set_of(self._now.fit))
            self._beaten.clear()
            self._now = self._moved(tried.fit)
        else:
            self._beaten |= dict.fromkeys(keys - held, (held - keys, -tried.gap))
        self.__dict__.pop('_by_timing', None)
        return self._now.fit is tried.fit or bool(keys - held)

    def _leads(self, tried: _Attempt) -> bool:
        """Whether a fit is better; a set that was left does not come back, so that this ends."""
        return tried.gap > RISE and _set_of(tried.fit) not in self._left

    def _promised(self, causes: Sequence[Hypothesis], timing: str) -> float:
        """By how much columns want a set more than the fit's."""
        now = self._now.fit
        number = {h.key: i for i, h in enumerate(self._now.hypotheses)}
        sets = (timing, [number[h.key] for h in causes]), (now.run.timing, range(len(now.causes)))
        ahead, here = (
            ChosenSet.of(self._by_timing[t].hypotheses, chosen).objective + log_odds_of(t)
            for t, chosen in sets
        )
        return ahead - here

    def _moved(self, fit: Fit) -> LinearRows:
        """About another fit, with the columns that there are where its rows are as promised."""
        now = self._now
        if len(fit.data) == len(now.fit.data) and _steps(fit) == _steps(now.fit):
            ahead = LinearRows(fit, now.columns)
            off = ahead.data - now.data
            if 0.5 * float(off @ off) < CONFOUNDED:
                return ahead
        return self._about(fit)

    def _objective(self, fit: Fit) -> float:
        """Log evidence and prior log odds."""
        price = FAMILYWISE + math.log(max(len(self._now.hypotheses), 1))
        return fit.evidence - price * len(fit.causes) + log_odds_of(fit.run.timing)

    def _rivals(self, inferred: Inferred) -> dict[Key, dict[Key, float]]:
        """By cause, what stands in its place with the log odds against it."""
        out = rivals_of(inferred)
        for key, (gone, gap) in self._beaten.items():
            for one in gone if gap < CONFOUNDED else ():
                out.get(one, {})[key] = gap
        return out


def _doubtful(cause: InferredCause) -> Iterator[list[Variant]]:
    """What may be a better fit in the place of a cause than its columns say.

    What they have near is; and, where a value is so large that columns need not hold back to
    none, nothing.
    """
    other = cause.alternatives[0]
    if other.log_odds < CURVED * float(np.sum(cause.gains)):
        if other.causes and other.log_odds >= CONFOUNDED:
            yield [cast(Variant, key) for key in other.causes]
        if cause.slabs > CLEAR:
            yield []


def _set_of(fit: Fit) -> tuple[frozenset[Key], str]:
    """What a fit is one of: its causes, its timing."""
    return frozenset(cause.key for cause in fit.causes), fit.run.timing


def _steps(fit: Fit) -> int:
    """Number of times at which a fit's filter sees samples."""
    return len(np.unique(fit.rows.row_times))
