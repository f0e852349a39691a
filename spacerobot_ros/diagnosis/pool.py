"""Candidates beside a fit on Gram matrices: each one's score, and several together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise
from operator import add

import numpy as np

from ..effects.effect import Effect
from ..estimation.columns import Candidate, is_possible
from ..estimation.constrained import ConstrainedProblem, PhysicalBody
from ..estimation.evidence import Fold, Gram, Score, cross_validated, folds, score
from ..model.robot import Robot
from ..types import Array, IntArray

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
            if is_possible(applied := self.candidate.applied(values), robot):
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
        """Columns of every candidate."""
        ends = self.held + np.cumsum([len(c.steps) for c in self.candidates])
        starts = (end - len(c.steps) for c, end in zip(self.candidates, ends, strict=True))
        return [np.arange(a, b) for a, b in zip(starts, ends, strict=True)]

    def judge(self, companions: Sequence[Candidate]) -> list[Judged]:
        """Every candidate's score beside the fit's causes and some companions."""
        places = self.places()
        beside = {id(c) for c in companions}
        common = [at for c, at in zip(self.candidates, places, strict=True) if id(c) in beside]
        whole, others, position = self._marginal(common)
        out = []
        for c, own in zip(self.candidates, places, strict=True):
            sums = whole, others, position
            if id(c) in beside:  # it does not stand beside itself
                sums = self._marginal([at for at in common if at is not own], own)
            at = sums[2][own]
            out.append(_judged(c, sums[0].part(at), [fold.of(at) for fold in sums[1]]))
        return out

    def estimate(self, chosen: Sequence[Candidate], robot: Robot) -> list[Effect]:
        """Most probable effects of some candidates together, on one physical robot."""
        places = dict(zip(map(id, self.candidates), self.places(), strict=True))
        own = np.concatenate([places[id(c)] for c in chosen])
        whole, _, position = self._marginal([], own)
        gram = whole.part(position[own])
        sizes, lower, upper = (
            np.concatenate([getattr(c, name) for c in chosen])
            for name in ('sizes', 'lower', 'upper')
        )
        ends = np.cumsum([len(c.steps) for c in chosen]).tolist()
        parts = [slice(a, b) for a, b in pairwise([0, *ends])]
        names = [body.name for body in robot.bodies]
        bodies = tuple(
            PhysicalBody(
                np.arange(len(own))[part], robot.inertial_parameters[names.index(str(c.where))]
            )
            for c, part in zip(chosen, parts, strict=True)
            if c.kind.id == 'inertial_parameters'
        )
        information = gram.matrix + np.diag(sizes**-2.0)
        values = ConstrainedProblem(information, gram.vector, sizes, lower, upper, bodies).solve()
        return [c.applied(c.values(values[at])) for c, at in zip(chosen, parts, strict=True)]

    def _marginal(
        self, beside: Sequence[IntArray], wanted: IntArray | None = None
    ) -> tuple[Gram, list[Fold], IntArray]:
        """Sums of all rows and folds without the fit's and the companions' columns.

        The last is where each remaining column now is.
        """
        held = np.concatenate([np.arange(self.held), *beside])
        size = len(self.parts[0].vector)
        left = np.setdiff1d(np.arange(size) if wanted is None else wanted, held)
        sizes = np.concatenate([np.ones(self.held), *(c.sizes for c in self.candidates)])
        precision = np.concatenate([self.precision, sizes[held[self.held :]] ** -2.0])
        parts = [part.part(np.concatenate([held, left])) for part in self.parts]
        position = np.zeros(size, dtype=int)
        position[left] = np.arange(len(left))
        whole = reduce(add, parts).without(len(held), precision)
        return whole, folds(parts, len(held), precision), position


def _judged(candidate: Candidate, whole: Gram, others: Sequence[Fold]) -> Judged:
    bounds = (candidate.lower, candidate.upper)
    found = score(whole, candidate.sizes, bounds, None)
    if found.evidence > 0.0:
        found = replace(found, held_out=cross_validated(others, candidate.sizes, bounds))
    return Judged(candidate, found)
