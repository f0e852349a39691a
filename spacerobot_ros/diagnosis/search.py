"""Which effects the data want: forward selection over the whole catalogue, with second thoughts.

Each round scores every candidate beside the causes chosen so far, and asks each fifth of the
record whether it agrees with the estimate from the other four. Columns hold for small effects
only: the best few are fitted as they really are before one is chosen; a chosen cause is dropped
when later ones make it superfluous, and exchanged when another one now does better in its place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..effects.effect import Effect
from ..estimation.columns import Candidate, candidates
from ..estimation.evidence import Gram, Score
from ..estimation.refit import Fit, refine
from ..estimation.rows import blocks
from ..estimation.runs import Run
from ..estimation.whiteness import spectral_lines
from .limits import (
    ALIKE_SHARE,
    CLOSE_GAP,
    CLOSE_SHARE,
    EQUIVALENT,
    FALSE_ALARMS,
    FREEDOM,
    MOST_ALIKE,
    MOST_CAUSES,
    MOST_MODELS,
    SHORTLIST,
    SUSPICIOUS,
)
from .pool import Judged, Pool
from .timing import better_timing

_BATCH = 32  # candidates whose columns are made at once: as many as fit into a processor's cache
_TINY = 1e-12  # keeps a column without any effect from making the elimination singular


@dataclass(frozen=True, slots=True, eq=False)
class Choice:
    """A chosen cause, why, and what might stand in its place.

    Args:
        key: Effect and place.
        score: Its score when it was chosen.
        rivals: (effect, place, gap in log evidence) that fit nearly as well.
    """

    key: tuple[str, str | None]
    score: Score
    rivals: tuple[tuple[str, str | None, float], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Result of the search.

    Args:
        null: The model as it stands.
        fit: The model with all causes.
        choices: One a cause of `fit`, in the same order.
        first: Every candidate's score against the model as it stands, best first.
        is_complete: Whether the search ended because nothing more was wanted.
    """

    null: Fit
    fit: Fit
    choices: tuple[Choice, ...]
    first: tuple[Judged, ...]
    is_complete: bool


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
        self._timings = {run.timing, *timings}

    def find(self) -> Found:
        """Select until nothing more is wanted."""
        self.report('judging every effect at every place', 0.1)
        null = fit = Fit(self.run, ())
        ranking = first = self.judge(null)
        choices: list[Choice] = []
        while len(choices) < MOST_CAUSES and not self._is_spent:
            wanted = wanted_of(ranking)
            if not wanted:
                break
            self.report(f'fitting {wanted[0].candidate.kind.title}', 0.2 + 0.1 * len(choices))
            fit, choice = self._choose(fit, wanted)
            choices.append(choice)
            asks = len(choices) == 1 or (fit.rows.whiteness()[0] or 0.0) < SUSPICIOUS
            if asks and (timing := better_timing(fit, self._timings)):
                run = self.run.timed(timing)
                return Search(run, self._kinds, self.report, self._timings).find()
            if len(choices) > 1:
                fit, choices = self._reconsider(fit, choices)
            ranking = self.judge(fit)
        is_complete = not (self._is_spent and wanted_of(ranking))
        return Found(null, fit, tuple(choices), tuple(first), is_complete)

    @property
    def _is_spent(self) -> bool:
        return self.run.models >= MOST_MODELS

    def judge(self, fit: Fit) -> list[Judged]:
        """Every candidate's score beside a fit's causes, best evidence first."""
        pool = self._candidates(fit)
        judged: list[Judged] = []
        for start in range(0, len(pool), _BATCH):
            judged += self._pool(fit, pool[start : start + _BATCH]).judge()
        return _ranked(judged)

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
        return [c for c in found if not c.contradicts(fit.causes)]

    def _pool(self, fit: Fit, pool: Sequence[Candidate]) -> Pool:
        columns = fit.signatures.whitened([step for c in pool for step in c.small_steps])
        both = np.concatenate([fit.tangents, columns], axis=1)
        parts = [Gram.of(both[rows], fit.data[rows]) for rows in blocks(fit.rows.row_times)]
        return Pool(tuple(pool), tuple(parts), len(fit.free), fit.precision + _TINY)

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

    def _reconsider(self, fit: Fit, choices: list[Choice]) -> tuple[Fit, list[Choice]]:
        """Drop or exchange earlier causes in the light of the latest."""
        for i in reversed(range(len(choices) - 1)):
            if self._is_spent:
                break
            others = [c for k, c in enumerate(fit.causes) if k != i]
            rest = refine(self.run, others)
            wanted = wanted_of(self.judge(rest))
            kept = choices[:i] + choices[i + 1 :]
            if not wanted:
                fit, choices = rest, kept
            elif wanted[0].candidate.key != choices[i].key:
                other, choice = self._choose(rest, wanted)
                if other.evidence > fit.evidence:
                    fit, choices = other, [*kept, choice]
        return fit, choices


def _ranked(judged: Iterable[Judged]) -> list[Judged]:
    """Best evidence first; of each effect at each place only its best variant."""
    order = sorted(judged, key=lambda j: -j.score.evidence)
    best = {j.candidate.key: j for j in reversed(order)}
    return sorted(best.values(), key=lambda j: -j.score.evidence)


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
    gap = top.evidence - other.evidence
    return gap < EQUIVALENT or (gap < FREEDOM * EQUIVALENT and other.cost - top.cost < EQUIVALENT)
