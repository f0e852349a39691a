"""Which effects the data want: forward selection over the whole catalogue, with second thoughts.

Each round scores every candidate beside the causes chosen so far, and asks each fifth of the
record whether it agrees with the estimate from the other four. Columns hold for small effects
only: the best few are fitted as they really are before one is chosen; a chosen cause is dropped
when later ones make it superfluous, and exchanged when another one now does better in its place.
Several that are obvious, each as large as the errors of the others' columns, are taken together.
What is no cause by its own tests gives way to its rivals, where the model does not fit without.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..effects.effect import Effect
from ..estimation.columns import Candidate, candidates
from ..estimation.evidence import Gram
from ..estimation.refit import Fit, refine
from ..estimation.rows import blocks
from ..estimation.runs import Run
from ..estimation.whiteness import spectral_lines
from .found import Choice, Found
from .limits import (
    ALIKE_SHARE,
    BUDGETED,
    CLOSE_GAP,
    CLOSE_SHARE,
    EQUIVALENT,
    FALSE_ALARMS,
    FREEDOM,
    MISFIT,
    MOST,
    MOST_ALIKE,
    MOST_CAUSES,
    MOST_MODELS,
    MOST_TURNS,
    OBVIOUS,
    SHORTLIST,
    SUSPICIOUS,
)
from .pool import Judged, Pool
from .soundness import soundness
from .timing import better_timing, is_simple

_BATCH = 32  # candidates whose columns are made at once: as many as fit into a processor's cache
_TINY = 1e-12  # keeps a column without any effect from making the elimination singular


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
        self._most_models = MOST_MODELS * self._growth
        self._unsound: Found | None = None

    def find(self) -> Found:
        """Select until nothing more is wanted, and nothing that was selected is unsound."""
        self.report('judging every effect at every place', 0.1)
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
            ranking = self.judge(fit)
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
        most = MOST_TURNS * MOST_MODELS * self._growth
        if not unsound or self.run.models >= most:
            return None
        if (found.sound.rows.whiteness()[0] or 0.0) >= MISFIT:
            return None
        self._most_models = most
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
        barred, timing = self._barred, self.run.timing
        return [
            c for c in found if not c.contradicts(fit.causes) and (timing, *c.key) not in barred
        ]

    def _pool(self, fit: Fit, pool: Sequence[Candidate]) -> Pool:
        columns = fit.signatures.whitened([step for c in pool for step in c.small_steps])
        both = np.concatenate([fit.tangents, columns], axis=1)
        parts = [Gram.of(both[rows], fit.data[rows]) for rows in blocks(fit.rows.row_times)]
        return Pool(tuple(pool), tuple(parts), len(fit.free), fit.precision + _TINY)

    def _more(
        self, fit: Fit, choices: Sequence[Choice], wanted: Sequence[Judged]
    ) -> tuple[Fit, list[Choice]]:
        """The next cause, or several that are obvious."""
        obvious = self._obvious(fit, wanted)
        if len(obvious) > 1:
            guesses = [j.guess(fit.rows.robot) for j in obvious]
            together = refine(self.run, [*fit.causes, *guesses])
            if together.evidence > fit.evidence:
                added = [Choice(j.candidate.key, j.score, ()) for j in obvious]
                return together, [*choices, *added]
        fit, choice = self._choose(fit, wanted)
        return fit, [*choices, choice]

    def _obvious(self, fit: Fit, wanted: Sequence[Judged]) -> list[Judged]:
        """Causes that their columns alone show together, where one is as good as any cause."""
        best = wanted[0].score.evidence
        least = max(OBVIOUS * best, CLOSE_GAP)
        large = [j for j in wanted if j.score.evidence > least and is_simple(j.candidate.kind)]
        if len(large) < 2 or large[0].score.evidence < CLOSE_SHARE * best:
            return []
        return self._pool(fit, [j.candidate for j in large[:_BATCH]]).together(least)

    def _choose(self, fit: Fit, wanted: Sequence[Judged]) -> tuple[Fit, Choice]:
        """The best of the shortlist, and of its like elsewhere, each fitted as it really is."""
        tried = _shortlist(wanted)
        fits = [self._with(fit, j) for j in tried]
        best = max(range(len(fits)), key=lambda i: fits[i].evidence)
        alike = _elsewhere(tried[best], wanted)
        tried, fits = tried + alike, fits + [self._with(fit, j) for j in alike]
        order = sorted(range(len(fits)), key=lambda i: -fits[i].evidence)
        top = order[0]
        rivals = tuple(
            (*tried[i].candidate.key, fits[top].evidence - fits[i].evidence)
            for i in order[1:]
            if _is_rival(fits[i], fits[top])
        )
        return fits[top], Choice(tried[top].candidate.key, tried[top].score, rivals)

    def _with(self, fit: Fit, judged: Judged) -> Fit:
        return refine(self.run, [*fit.causes, judged.guess(fit.rows.robot)])

    def _reconsider(self, fit: Fit, choices: list[Choice], added: int) -> tuple[Fit, list[Choice]]:
        """Drop or exchange causes in the light of the latest.

        Args:
            fit: All of them.
            choices: Why each, in the same order.
            added: How many are the latest: one that was chosen, or several that were not yet
                compared with what might stand in their place.
        """
        old = len(choices) - added
        for i in reversed(range(len(choices) - (added == 1))):
            if self._is_spent:
                break
            rest = self._only(fit, [k for k in range(len(choices)) if k != i])
            wanted = wanted_of(self.judge(rest))
            kept = choices[:i] + choices[i + 1 :]
            if not wanted:
                fit, choices = rest, kept
            elif i >= old or wanted[0].candidate.key != choices[i].key:
                other, choice = self._choose(rest, wanted)
                if other.evidence > fit.evidence:
                    fit, choices = other, [*kept, choice]
                elif choice.key == choices[i].key:
                    choices = [*choices[:i], choice, *choices[i + 1 :]]
        return fit, choices


def ranked(judged: Iterable[Judged]) -> list[Judged]:
    """Best evidence first; of each effect at each place only one variant."""
    variants: dict[tuple[str, str | None], list[Judged]] = {}
    for j in sorted(judged, key=lambda j: -j.score.evidence):
        variants.setdefault(j.candidate.key, []).append(j)
    return sorted(
        (_first_guess(own) for own in variants.values()), key=lambda j: -j.score.evidence
    )


def _first_guess(variants: Sequence[Judged]) -> Judged:
    """The best; of frequencies that columns do not tell apart, that of the smallest effect.

    A stiff spring does what a softer one of a lesser body does, as long as its body is small: for
    others columns do not hold.
    """
    best = variants[0]
    if not best.candidate.kind.hidden:
        return best
    alike = [j for j in variants if j.score.evidence > best.score.evidence - EQUIVALENT]
    return min(alike, key=lambda j: float(np.linalg.norm(j.score.estimate / j.candidate.sizes)))


def wanted_of(ranking: Sequence[Judged]) -> list[Judged]:
    """Candidates that are significant among all, worth their parameters, and held up."""
    count = sum(j.candidate.trials for j in ranking)
    return [
        j
        for j in ranking
        if j.score.evidence > 0.0
        and j.score.bic_gain > 0.0
        and j.score.p_value * count < FALSE_ALARMS
        and j.score.held_out > 0.0
    ]


def _shortlist(wanted: Sequence[Judged]) -> list[Judged]:
    """The best and those nearly as good, each kind of effect at its best place."""
    best = wanted[0].score.evidence
    floor = min(CLOSE_SHARE * best, best - CLOSE_GAP)
    kinds = {j.candidate.kind.id: j for j in reversed(wanted)}
    close = sorted(kinds.values(), key=lambda j: -j.score.evidence)[:SHORTLIST]
    return [j for j in close if j.score.evidence >= floor]


def _elsewhere(best: Judged, wanted: Sequence[Judged]) -> list[Judged]:
    """The same effect at other places that do half as well: neighbours share its columns.

    What swings is looked at everywhere: its columns are those of first guesses, and a panel is
    seldom one of them.
    """
    floor = ALIKE_SHARE * best.score.evidence
    same = [j for j in wanted if j.candidate.kind is best.candidate.kind and j is not best]
    if best.candidate.kind.hidden:
        return same
    return [j for j in same if j.score.evidence >= floor][:MOST_ALIKE]


def _is_rival(other: Fit, top: Fit) -> bool:
    """Whether a fit can not be told from the best, or is as good by more freedom."""
    gap, more = top.evidence - other.evidence, other.misfit - top.misfit
    return gap < EQUIVALENT or (gap < FREEDOM * EQUIVALENT and more < EQUIVALENT)
