"""Which effects the data want: forward selection over the whole catalogue, with second thoughts.

Each round scores every candidate beside the causes chosen so far, and asks each fifth of the
record whether it agrees with the estimate from the other four; the best few are fitted as they
really are, not as their columns, before one is chosen. A chosen cause is dropped when later ones
make it superfluous, and exchanged when another one now does better in its place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..effects.effect import Effect
from ..estimation.columns import Candidate, candidates, is_possible
from ..estimation.evidence import Gram, Score, cross_validated, folds, score, sum_of
from ..estimation.prediction import Innovations
from ..estimation.refit import Fit, Run, refine
from ..estimation.whiteness import fit_test, lines
from ..model.robot import Robot
from .timing import better_timing

_FOLDS = 5
_FALSE_ALARMS = 1e-3  # a record, over all candidates
_MOST_CAUSES = 6
_MOST_FILTERS = 120  # of one run, after which nothing new is tried
_HALVINGS = 12
_SUSPICIOUS = 0.1  # p-value of the fit below which the dear candidates are looked at, too
_SHORTLIST = 4
_CLOSE_SHARE, _CLOSE_GAP = 0.9, 25.0  # of the best one's evidence: who is fitted as well
_ALIKE_SHARE, _MOST_ALIKE = 0.5, 2
_FREEDOM = 3.0
_BATCH = 32  # candidates that pass through the filter at once
_TINY = 1e-12  # keeps a column without any effect from making the elimination singular
EQUIVALENT = 6.0  # gap in log evidence within which two causes are not told apart


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """A candidate with its score beside the chosen causes."""

    candidate: Candidate
    score: Score

    @property
    def applied(self) -> Effect:
        """The candidate with its estimated values."""
        return self.candidate.applied(self.candidate.values(self.score.estimate))

    def guess(self, robot: Robot) -> Effect:
        """Its estimated values, drawn towards no effect until a physical robot has them."""
        for k in range(_HALVINGS):
            values = self.candidate.values(0.5**k * self.score.estimate)
            if is_possible(applied := self.candidate.applied(values), robot):
                return applied
        return self.candidate.applied(self.candidate.directions[0])


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
        effects: The catalogue, or a part of it.
        report: Called with what is being done and how far it is, from 0 to 1.
        timings: Ways in which efforts act that are out of the question.
    """

    def __init__(
        self,
        run: Run,
        effects: Sequence[type[Effect]],
        report: Callable[[str, float], None],
        timings: Iterable[str] = (),
    ) -> None:
        self.run = run
        self.report = report
        self._effects = effects
        self._timings = {run.timing, *timings}

    def find(self) -> Found:
        """Select until nothing more is wanted."""
        null = fit = Fit(self.run, ())
        self.report('judging every effect at every place', 0.1)
        ranking = first = self.judge(null)
        choices: list[Choice] = []
        while len(choices) < _MOST_CAUSES and not self._is_spent:
            wanted = wanted_of(ranking)
            if not wanted:
                break
            self.report(f'fitting {wanted[0].candidate.kind.title}', 0.2 + 0.1 * len(choices))
            fit, choice = self._choose(fit, wanted)
            choices.append(choice)
            asks = len(choices) == 1 or fit_test(fit.filter, fit.data)[0] < _SUSPICIOUS
            if asks and (timing := better_timing(fit, self._timings)):
                run = self.run.timed(timing)
                return Search(run, self._effects, self.report, self._timings).find()
            if len(choices) > 1:
                fit, choices = self._reconsider(fit, choices)
            ranking = self.judge(fit)
        is_complete = not (self._is_spent and wanted_of(ranking))
        return Found(null, fit, tuple(choices), tuple(first), is_complete)

    @property
    def _is_spent(self) -> bool:
        return self.run.filters >= _MOST_FILTERS

    def judge(self, fit: Fit) -> list[Judged]:
        """Every candidate's score beside a fit's causes, best evidence first.

        Of each effect at each place only its best variant is kept. Effects with states of their
        own (springs, sloshing) are dear, and leave slow errors or lines that `fit_test` sees: they
        are looked at where it sees any.
        """
        chosen = {(c.id, c.where) for c in fit.causes}
        p_value, channels = fit_test(fit.filter, fit.data)
        effects = [e for e in self._effects if p_value < _SUSPICIOUS or not e.hidden]
        pool = [
            c
            for c in candidates(effects, fit.filter, fit.data, lines(channels))
            if c.key not in chosen
        ]
        judged = []
        for start in range(0, len(pool), _BATCH):
            judged += self._judge_batch(fit, pool[start : start + _BATCH])
        judged.sort(key=lambda j: -j.score.evidence)
        best = {j.candidate.key: j for j in reversed(judged)}
        return sorted(best.values(), key=lambda j: -j.score.evidence)

    def _judge_batch(self, fit: Fit, pool: Sequence[Candidate]) -> list[Judged]:
        """Scores of some candidates: as many as fit into the processor's cache."""
        directions = [
            (c.applied(d), s) for c in pool for d, s in zip(c.directions, c.steps, strict=True)
        ]
        columns = np.concatenate([fit.tangents, fit.signatures.whitened(directions)], axis=1)
        parts = [Gram.of(columns[rows], fit.data[rows]) for rows in blocks(fit.filter)]
        held, precision = len(fit.free), fit.precision + _TINY
        whole, others = sum_of(parts).without(held, precision), folds(parts, held, precision)
        judged, start = [], 0
        for candidate in pool:
            own = np.arange(start, start + len(candidate.steps))
            bounds = (candidate.lower, candidate.upper)
            found = score(whole.part(own), candidate.sizes, bounds, None)
            if found.evidence > 0.0:
                held_out = cross_validated([f.of(own) for f in others], candidate.sizes, bounds)
                found = replace(found, held_out=held_out)
            judged.append(Judged(candidate, found))
            start += len(own)
        return judged

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
        return refine(self.run, [*fit.causes, judged.guess(fit.filter.process.robot)])

    def _reconsider(self, fit: Fit, choices: list[Choice]) -> tuple[Fit, list[Choice]]:
        """Drop or exchange earlier causes in the light of the latest."""
        for i in reversed(range(len(choices) - 1)):
            if self._is_spent:
                break
            others = [c for k, c in enumerate(fit.causes) if k != i]
            rest = refine(self.run, others)
            ranking = self.judge(rest)
            wanted = wanted_of(ranking)
            kept = choices[:i] + choices[i + 1 :]
            if not wanted:
                fit, choices = rest, kept
            elif wanted[0].candidate.key != choices[i].key:
                other, choice = self._choose(rest, wanted)
                if other.evidence > fit.evidence:
                    fit, choices = other, [*kept, choice]
        return fit, choices


def wanted_of(ranking: Sequence[Judged]) -> list[Judged]:
    """Candidates that are significant among all, worth their parameters, and held up."""
    count = sum(j.candidate.trials for j in ranking)
    return [
        j
        for j in ranking
        if j.score.evidence > 0.0
        and j.score.bic_gain > 0.0
        and j.score.p_value * count < _FALSE_ALARMS
        and j.score.held_out > 0.0
    ]


def _shortlist(wanted: Sequence[Judged]) -> list[Judged]:
    """The best and those nearly as good, each kind of effect at its best place."""
    best = wanted[0].score.evidence
    floor = min(_CLOSE_SHARE * best, best - _CLOSE_GAP)
    kinds = {j.candidate.kind.id: j for j in reversed(wanted)}
    close = sorted(kinds.values(), key=lambda j: -j.score.evidence)[:_SHORTLIST]
    return [j for j in close if j.score.evidence >= floor]


def _elsewhere(best: Judged, wanted: Sequence[Judged]) -> list[Judged]:
    """The same effect at other places that do half as well: neighbours share what they carry."""
    floor = _ALIKE_SHARE * best.score.evidence
    same = [j for j in wanted if j.candidate.kind is best.candidate.kind and j is not best]
    return [j for j in same if j.score.evidence >= floor][:_MOST_ALIKE]


def _is_rival(other: Fit, top: Fit) -> bool:
    """Whether a fit can not be told from the best, or is as good by more freedom."""
    gap = top.evidence - other.evidence
    return gap < EQUIVALENT or (gap < _FREEDOM * EQUIVALENT and other.cost - top.cost < EQUIVALENT)


def blocks(filtered: Innovations) -> list[slice]:
    """Rows of equal parts of the record, each of which is predicted from the others."""
    times = filtered.row_times
    ends = np.searchsorted(times, np.linspace(times[0], times[-1], _FOLDS + 1)[1:-1])
    return [slice(a, b) for a, b in pairwise([0, *ends.tolist(), len(times)])]
