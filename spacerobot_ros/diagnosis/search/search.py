"""Which effects the data want: forward selection over the whole catalogue, with second thoughts.

Each round scores every candidate beside the causes chosen so far, also on fifths of the record by
estimates from the other four. Columns hold for small effects only: the best few are fitted as
they really are before one is chosen; a chosen cause is dropped when later ones make it
superfluous, and exchanged when another one now does better in its place. Several that are
obvious, each as large as the errors of the others' columns, are taken together. What is no cause
by its own tests gives way to its rivals, where the model does not fit without.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ...effects.effect import Effect, Key
from ...estimation.columns import Candidate, candidates
from ...estimation.fit import Fit
from ...estimation.inference.evidence import LEAST_PRECISION, Gram
from ...estimation.inference.whiteness import spectral_lines
from ...estimation.refit import refine
from ...estimation.rows import blocks
from ...estimation.runs import Run
from ..limits import (
    BUDGETED,
    CLOSE_GAP,
    CLOSE_SHARE,
    EQUIVALENT,
    MISFIT,
    MOST,
    MOST_CAUSES,
    MOST_FALLS,
    MOST_MODELS,
    MOST_TURNS,
    OBVIOUS,
    SUSPICIOUS,
)
from .found import Choice, Found
from .pool import Judged, Pool
from .ranking import close_to, elsewhere, is_rival, may_rival, ranked, shortlist, wanted_of
from .soundness import soundness
from .timing import better_timing, is_simple

_BATCH = 32  # candidates whose columns are made at once: as many as fit into a processor's cache


class Search:
    """Forward selection on one run.

    Args:
        run: The run.
        kinds: The catalogue, or a part of it.
        report: Called with what is being done and how far it is, from 0 to 1.
        timings: Ways in which efforts act that are out of the question.
    """

    def __init__(
        self,
        run: Run,
        kinds: Sequence[type[Effect]],
        report: Callable[[str, float], None],
        timings: Iterable[str] = (),
    ) -> None:
        self.run = run
        self.report = report
        self._kinds = kinds
        self._excluded = {*timings}
        self._tried = {run.timing, *timings}
        self._barred: set[tuple[str, str, str | None]] = set()
        length = float(run.record.joint_time[-1] - run.record.joint_time[0])
        self._growth = math.sqrt(max(1.0, length / BUDGETED))
        self._most_models = math.inf  # of the timing that is looked at
        self._unsound: Found | None = None
        self._turns: list[float] = []  # evidence of what each turn ended with

    def find(self) -> Found:
        """Select until nothing more is wanted, and nothing that was selected is unsound."""
        self.report('judging every effect at every place', 0.1)
        self._most_models = self.run.models + MOST_MODELS * self._growth
        self._turns.clear()
        null = fit = Fit(self.run, ())
        ranking = first = self.judge(null)
        choices: list[Choice] = []
        while True:
            fit, choices = self._grown(fit, choices, ranking)
            if fit.run is not self.run:
                self.run = fit.run
                return self.find()
            found = self._found(null, fit, choices, first)
            ahead = self._given_way(found)
            if ahead is None:
                break
            self._unsound = self._unsound or found
            fit, choices = ahead
            again = (j for j in first if self._may_be(j.candidate))
            ranking = self.judge(fit) if choices else [*again]
        is_complete = not (self._is_ended(choices) and wanted_of(self.judge(found.sound)))
        if self._unsound and not self._pays(found):
            found = self._unsound
        return replace(found, is_complete=is_complete)

    def _found(
        self, null: Fit, fit: Fit, choices: Sequence[Choice], first: Sequence[Judged]
    ) -> Found:
        checks = tuple(soundness(fit, i) for i in range(len(choices)))
        return Found(null, fit, tuple(choices), checks, tuple(first), False)

    def _pays(self, found: Found) -> bool:
        """Whether what is sound explains the record, or most of it."""
        fit = found.sound
        before, after = (float(f.data @ f.data) - len(f.data) for f in (found.null, fit))
        return (fit.rows.whiteness()[0] or 0.0) >= MISFIT or after < (1.0 - MOST) * before

    def _grown(
        self, fit: Fit, choices: list[Choice], ranking: Sequence[Judged]
    ) -> tuple[Fit, list[Choice]]:
        """More causes, until nothing is wanted; or a fit of another timing that does better."""
        while not self._is_ended(choices) and (wanted := wanted_of(ranking)):
            self.report(f'fitting {wanted[0].candidate.kind.title}', 0.2 + 0.1 * len(choices))
            before = len(choices)
            ahead, chosen = self._more(fit, choices, wanted)
            if not ahead.evidence > fit.evidence:  # what columns promise does not hold
                tried = {choice.key for choice in chosen[before:]}
                ranking = [j for j in ranking if j.candidate.key not in tried]
                continue
            fit, choices = ahead, chosen
            asks = not before or (fit.rows.whiteness()[0] or 0.0) < SUSPICIOUS
            if asks and (timing := better_timing(fit, self._tried)):
                self._tried.add(timing)
                return Fit(self.run.timed(timing), ()), []
            if len(choices) > 1:
                fit, choices = self._reconsider(fit, choices, len(choices) - before)
            ranking = self.judge(fit)
        return fit, choices

    def _given_way(self, found: Found) -> tuple[Fit, list[Choice]] | None:
        """Larger causes to go on from, some unsound one barred; None where there is no need.

        Lesser ones may spoil a cause to which most of the misfit belongs: the largest that is
        unsound is asked again without them, and barred only where it is unsound alone.
        """
        choices, gains = found.choices, [check.held_out_gain for check in found.checks]
        unsound = [i for i, check in enumerate(found.checks) if not check.is_sound]
        most = MOST_TURNS * MOST_MODELS * self._growth  # whatever the timings: this loop ends
        if not unsound or self.run.models >= most:
            return None
        if (found.sound.rows.whiteness()[0] or 0.0) >= MISFIT or self._goes_down(found):
            return None
        self._most_models = max(self._most_models, most)
        self._tried = {self.run.timing, *self._excluded}
        largest = max(unsound, key=lambda i: gains[i])
        larger = [i for i, gain in enumerate(gains) if gain > gains[largest]]
        kept = [*larger, largest]
        trial = found.only(kept)
        if len(kept) < len(choices) and soundness(trial, len(larger)).is_sound:
            self._bar(choices[i] for i in unsound if i != largest)
            return trial, [choices[i] for i in kept]
        self._bar([choices[largest]])
        return found.only(larger), [choices[i] for i in larger]

    def _goes_down(self, found: Found) -> bool:
        """Whether every turn ends with less than the one before, `MOST_FALLS` times in a row.

        What stands in the place of an unsound cause then is as unsound, and tells less.
        """
        self._turns.append(found.fit.evidence)
        latest = self._turns[-MOST_FALLS - 1 :]
        return len(latest) > MOST_FALLS and all(b < a for a, b in pairwise(latest))

    def _bar(self, choices: Iterable[Choice]) -> None:
        self._barred |= {(self.run.timing, *choice.key) for choice in choices}

    def _only(self, fit: Fit, kept: Sequence[int]) -> Fit:
        """Some of a fit's causes, fitted again."""
        return refine(self.run, [fit.causes[i] for i in kept])

    def _is_ended(self, choices: Sequence[Choice]) -> bool:
        return self._is_spent or len(choices) >= MOST_CAUSES * self._growth

    @property
    def _is_spent(self) -> bool:
        return self.run.models >= self._most_models

    def judge(self, fit: Fit) -> list[Judged]:
        """Every candidate's score beside a fit's causes, best evidence first."""
        pool = self._candidates(fit)
        judged: list[Judged] = []
        for start in range(0, len(pool), _BATCH):
            judged += self._pool(fit, pool[start : start + _BATCH]).judge()
        return ranked(judged)

    def _candidates(self, fit: Fit) -> list[Candidate]:
        """What may be a cause beside a fit's.

        Effects with states of their own (springs, sloshing) are dear, and leave slow errors or
        spectral lines that a test of whiteness sees: they are looked at where it sees any, and
        not where there is no such test, since what swings by itself then looks like anything.
        """
        p_value, channels = fit.rows.whiteness()
        asks = p_value is not None and p_value < SUSPICIOUS
        kinds = [kind for kind in self._kinds if asks or not (kind.hidden or kind.is_rare)]
        found = candidates(kinds, fit.rows, spectral_lines(channels))
        return [c for c in found if not c.contradicts(fit.causes) and self._may_be(c)]

    def _may_be(self, candidate: Candidate) -> bool:
        """Whether it was not barred."""
        return (self.run.timing, *candidate.key) not in self._barred

    def _pool(self, fit: Fit, pool: Sequence[Candidate]) -> Pool:
        columns = fit.signatures.whitened([step for c in pool for step in c.small_steps])
        both = np.concatenate([fit.tangents, columns], axis=1)
        parts = [Gram.of(both[rows], fit.data[rows]) for rows in blocks(fit.rows.row_times)]
        return Pool(tuple(pool), tuple(parts), len(fit.free), fit.precision + LEAST_PRECISION)

    def _more(
        self, fit: Fit, choices: Sequence[Choice], wanted: Sequence[Judged]
    ) -> tuple[Fit, list[Choice]]:
        """The next cause, or several that are obvious."""
        obvious = self._obvious(fit, wanted)
        if len(obvious) > 1:
            together, added = self._all(fit, obvious)
            if together.evidence > fit.evidence:
                return together, [*choices, *added]
        fit, chosen = self._choose(fit, wanted)
        return fit, [*choices, *chosen]

    def _obvious(self, fit: Fit, wanted: Sequence[Judged]) -> list[Judged]:
        """Causes that their columns alone show together, where one is as good as any cause."""
        best = wanted[0].score.evidence
        least = max(OBVIOUS * best, CLOSE_GAP)
        large = [j for j in wanted if j.score.evidence > least and is_simple(j.candidate.kind)]
        if len(large) < 2 or large[0].score.evidence < CLOSE_SHARE * best:
            return []
        return self._pool(fit, [j.candidate for j in large[:_BATCH]]).together(least)

    def _choose(self, fit: Fit, wanted: Sequence[Judged]) -> tuple[Fit, list[Choice]]:
        """The best of the shortlist, and of its like elsewhere, each fitted as it really is.

        Several simpler ones take its place where they do better together by more than its freedom
        alone may have cost it.
        """
        tried, fits = shortlist(wanted), list[Fit]()
        for j in tried:
            fits.append(self._with(fit, j, beside=fits))
        best = max(range(len(fits)), key=lambda i: fits[i].evidence)
        alike = elsewhere(tried[best], wanted)
        tried += alike
        for j in alike:
            fits.append(self._with(fit, j, beside=fits))
        order = sorted(range(len(fits)), key=lambda i: -fits[i].evidence)
        top = order[0]
        if len(simpler := self._simpler(fit, wanted, tried[top])) > 1:
            together, choices = self._all(fit, simpler)
            if together.evidence > fits[top].evidence and not is_rival(fits[top], together):
                return together, choices
        rivals = tuple(
            (*tried[i].candidate.key, fits[top].evidence - fits[i].evidence)
            for i in order[1:]
            if is_rival(fits[i], fits[top])
        )
        return fits[top], [Choice(tried[top].candidate.key, tried[top].score, rivals)]

    def _simpler(self, fit: Fit, wanted: Sequence[Judged], one: Judged) -> list[Judged]:
        """Causes that tell as much as one does by fewer numbers, all theirs together."""
        most = len(one.candidate.parameters)
        few = [j for j in wanted if len(j.candidate.parameters) < most]
        pool = [j.candidate for j in few if is_simple(j.candidate.kind)][:_BATCH]
        found = self._pool(fit, pool).together(EQUIVALENT) if pool else []
        numbers = sum(len(j.candidate.parameters) for j in found)
        evidence = sum(j.score.evidence for j in found)
        return found if numbers < most and evidence >= close_to(one) else []

    def _with(self, fit: Fit, *judged: Judged, beside: Sequence[Fit] = ()) -> Fit:
        """A fit with more causes, given up where it stays behind the best of others."""
        top = max((other.evidence for other in beside), default=-math.inf)
        causes = [*fit.causes, *(j.guess(fit.rows.robot) for j in judged)]
        return refine(self.run, causes, is_worth=lambda ahead: may_rival(ahead, top))

    def _all(self, fit: Fit, judged: Sequence[Judged]) -> tuple[Fit, list[Choice]]:
        return self._with(fit, *judged), [Choice(j.candidate.key, j.score, ()) for j in judged]

    def _reconsider(self, fit: Fit, choices: list[Choice], added: int) -> tuple[Fit, list[Choice]]:
        """Drop or exchange causes in the light of the latest; of an exchange, all others again.

        Args:
            fit: All of them.
            choices: Why each, in the same order.
            added: How many are the latest: one that was chosen, or several that were not yet
                compared with what might stand in their place.
        """
        new = {choice.key for choice in choices[len(choices) - added :]} if added > 1 else set()
        asked = [choice.key for choice in choices[: len(choices) - (added == 1)]]
        while asked and not self._is_spent:
            key = asked.pop()
            i = next(k for k, choice in enumerate(choices) if choice.key == key)
            rest = self._only(fit, [k for k in range(len(choices)) if k != i])
            wanted = wanted_of(self.judge(rest))
            kept = choices[:i] + choices[i + 1 :]
            if not wanted:
                fit, choices = rest, kept
            elif key in new or self._is_challenged(rest, wanted, key):
                other, chosen = self._choose(rest, wanted)
                is_same = [choice.key for choice in chosen] == [key]
                if other.evidence > fit.evidence:
                    fit, choices = other, [*kept, *chosen]
                    asked = asked if is_same else [choice.key for choice in kept]
                elif is_same:
                    choices = [*choices[:i], *chosen, *choices[i + 1 :]]
        return fit, choices

    def _is_challenged(self, rest: Fit, wanted: Sequence[Judged], key: Key) -> bool:
        """Whether something does better in a cause's place, or is as good and simpler."""
        top = wanted[0]
        return top.candidate.key != key or bool(self._simpler(rest, wanted, top))
