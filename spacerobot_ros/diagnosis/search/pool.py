"""Candidates beside a fit on Gram matrices: each one's score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...effects.effect import Effect
from ...estimation.columns import Candidate
from ...estimation.inference.evidence import (
    Fold,
    Gram,
    Score,
    cross_validated,
    folds,
    score,
    sum_of,
)
from ...estimation.possible import is_physical
from ...model.robot import Robot
from ...types import Array, IntArray
from ..limits import OWN_SHARE

_HALVINGS = 12


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
            if is_physical([applied := self.candidate.applied(values)], robot):
                return applied
        return self.candidate.applied(self.candidate.directions[0])


@dataclass(frozen=True, slots=True, eq=False)
class Pool:
    """Candidates beside a fit, and what the data say of them.

    Args:
        candidates: C of them.
        parts: Gram matrices of each block of rows, the fit's own columns first.
        held: Number of the fit's own columns. precision: (held,) prior precision of each.
    """

    candidates: tuple[Candidate, ...]
    parts: tuple[Gram, ...]
    held: int
    precision: Array

    def places(self) -> list[IntArray]:
        """Columns of every candidate, the fit's own left out."""
        ends = np.cumsum([len(c.steps) for c in self.candidates])
        starts = (end - len(c.steps) for c, end in zip(self.candidates, ends, strict=True))
        return [np.arange(a, b) for a, b in zip(starts, ends, strict=True)]

    def judge(self) -> list[Judged]:
        """Every candidate's score beside the fit's causes."""
        whole = sum_of(self.parts).without(self.held, self.precision)
        others = folds(self.parts, self.held, self.precision)
        return [
            _judged(c, whole.part(own), [fold.of(own) for fold in others])
            for c, own in zip(self.candidates, self.places(), strict=True)
        ]

    def together(self, least: float) -> list[Judged]:
        """Candidates that add to each other, each the best beside those before it.

        One that loses most of its evidence beside another is its rival, not its companion.

        Args:
            least: Evidence below which none is taken.
        """
        pool, found, judged = self, list[Judged](), self.judge()
        enough = {j.candidate: max(least, OWN_SHARE * j.score.evidence) for j in judged}
        while companions := [j for j in judged if j.score.evidence > enough[j.candidate]]:
            best = max(companions, key=lambda j: j.score.evidence)
            if not best.score.held_out > 0.0:
                break
            found.append(best)
            pool = pool.beside(best.candidate)
            judged = pool.judge()
        return found

    def beside(self, chosen: Candidate) -> Pool:
        """Candidates that may stand beside one of them, which is held like the fit's own."""
        which = self.candidates.index(chosen)
        rest = [
            k
            for k, c in enumerate(self.candidates)
            if not (k == which or c.contradicts([chosen]) or c.repeats([chosen]))
        ]
        own = [self.held + place for place in self.places()]
        order = np.concatenate([np.arange(self.held), own[which], *(own[k] for k in rest)])
        return Pool(
            tuple(self.candidates[k] for k in rest),
            tuple(part.part(order) for part in self.parts),
            self.held + len(own[which]),
            np.concatenate([self.precision, chosen.sizes**-2.0]),
        )


def _judged(candidate: Candidate, whole: Gram, others: Sequence[Fold]) -> Judged:
    bounds = (candidate.lower, candidate.upper)
    found = score(whole, candidate.sizes, bounds, None)
    if found.evidence > 0.0:
        found = replace(found, held_out=cross_validated(others, candidate.sizes, bounds))
    return Judged(candidate, found)
