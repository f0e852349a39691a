"""Which causes recordings of an arm want: forward selection on Gram matrices.

Columns hold for effects of any size, so every hypothesis is algebra on sums over the rows. What
every machine has (its tolerance) stands beside all of them. A cause is worth its name where the
evidence of its plausible size over its tolerance exceeds what the number of hypotheses makes
likely by chance; `held_out_checks` asks the other parts of the data.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Sequence
from copy import copy

import numpy as np

from ...estimation.balance.arm_fit import Posterior
from ...estimation.balance.arm_priors import DRY, NOTHING, OF_LOAD, SHAPES, VISCOUS, is_kind_of
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.columns import Candidate
from ...estimation.inference.evidence import Fold, Gram, Score, log_evidence, score, sum_of
from ...types import Array, IntArray
from ..limits import FAMILYWISE, MOST_PRUNED, SIMPLER_MARGIN, SPECIAL, TELLING
from .least_size import as_many, by_few, multiple_of

_AFTER_FRICTION = (*SHAPES, OF_LOAD)
_LEANING = (OF_LOAD, 'joint_friction_curvature')
"""Of those, what has no dry or viscous torque of its own."""

_ROUNDING = 1e-9  # of sums over all rows, from which others were taken


class Selection:
    """Choice of causes.

    Args:
        rows: The recordings.
        parts: Gram matrices of the blocks of rows that may be held out.
        recording: (B,) number of the recording of each block.
        always: Sums that are never held out.
    """

    def __init__(
        self,
        rows: ArmRows,
        parts: Sequence[Gram],
        recording: IntArray,
        always: Gram | None = None,
    ) -> None:
        self.rows = rows
        self.whole = sum_of([*parts, *([] if always is None else [always])])
        self.parts = HeldOutParts(rows, parts, recording, self.whole)
        self.chosen: list[int] = []
        self._pruned: dict[int, int] = {}
        self._kept: dict[int, tuple[Gram, Posterior]] = {}
        self._kept_of: frozenset[int] = frozenset()
        self._information = np.diag(self.whole.matrix)
        self._is_own = np.zeros(len(self._information), dtype=bool)
        for candidate, at in zip(rows.candidates, rows.places, strict=True):
            self._is_own[at] = candidate.recordings is not None
        seen = np.diag(sum_of(parts).matrix) > 0.0
        self.live = [
            i for i, at in enumerate(rows.places) if seen[at].any() and rows.may_be_chosen(i)
        ]

    @classmethod
    def of(cls, rows: ArmRows, levels: Sequence[Array]) -> Selection:
        """Of whitened rows, by (8,) variances of the leftover of every set of `ArmRows.joints`."""
        return cls(rows, rows.parts(levels), rows.recording, rows.held)

    def posterior(self, chosen: Iterable[int], gram: Gram | None = None) -> Posterior:
        """Of causes beside all tolerances.

        What was asked of the last ones is kept. `Posterior.group` of a cause says the same
        whether it is one of them.

        Args:
            chosen: The causes.
            gram: Sums over the rows; None: over all of them.
        """
        gram, of = self.whole if gram is None else gram, frozenset(chosen)
        if of != self._kept_of:
            self._kept, self._kept_of = {}, of
        if id(gram) not in self._kept:
            self._kept[id(gram)] = gram, Posterior.of(gram, self.rows.deviations(of))
        return self._kept[id(gram)][1]

    def need(self, i: int) -> float:
        """Log evidence from which a cause is worth a name.

        What the machine has does not become less likely by what recordings may have of their own.
        """
        candidate, every = self.rows.candidates[i], self.rows.candidates
        others = [k for k in self.live if candidate.recordings or not every[k].recordings]
        size = min(len(candidate.sizes), 4)
        extra = SPECIAL.get(candidate.kind.id, 0.0) if candidate.along is None else 0.0
        return math.log(len(others)) + FAMILYWISE + 0.5 * (size - 1) + extra

    def gain(self, i: int) -> float:
        """Log evidence for a cause beside the chosen ones."""
        return self.gain_beside(self.posterior(self.chosen), i)

    def gain_beside(self, beside: Posterior, i: int) -> float:
        """Log evidence for a cause beside others, by what is known of all."""
        own = self.rows.places[i]
        free = (np.full(len(own), -np.inf), np.full(len(own), np.inf))
        gram = beside.group(own)
        tolerated = log_evidence(gram, self.rows.tolerances[own], free)
        candidate = self.rows.candidates[i]
        gain = log_evidence(gram, candidate.sizes, (candidate.lower, candidate.upper)) - tolerated
        return by_few(gain, self.rows.freedom(i))

    def score(self, i: int) -> Score:
        """All that is to be said of a cause beside the chosen ones."""
        return self._score(self.posterior(self.chosen), i)

    def limit(self, i: int, direction: Array, least: float = 0.0) -> float:
        """Multiple of a cause's coefficients (K,) from which it is named, beside nothing else.

        Its evidence must exceed that of its tolerance by the need; see `multiple_of`.

        Args:
            i: The cause.
            direction: (K,) of its coefficients.
            least: Log evidence that it must have beside its not being there at all.
        """
        own, sizes = self.rows.places[i], self.rows.candidates[i].sizes
        gram, need = self.posterior(()).group(own), as_many(self.need(i), self.rows.freedom(i))
        limit = multiple_of(gram, direction, need, sizes, self.rows.tolerances[own])
        if least <= 0.0:
            return limit
        return max(limit, multiple_of(gram, direction, least, sizes, NOTHING * sizes))

    def _score(self, beside: Posterior, i: int) -> Score:
        candidate, gram = self.rows.candidates[i], beside.group(self.rows.places[i])
        return score(gram, candidate.sizes, (candidate.lower, candidate.upper), None)

    def ranking(self, without: int | None = None) -> list[tuple[int, float]]:
        """Candidates that may be chosen, with the log evidence beyond their need, best first.

        Args:
            without: A chosen cause that is left out.
        """
        taken = [i for i in self.chosen if i != without]
        beside = self.posterior(self.chosen)
        if without is not None:
            own = self.rows.places[without]
            beside = beside.under(own, self.rows.tolerances[own])
        margins = [
            (i, self.gain_beside(beside, i) - self.need(i))
            for i in self.live
            if i not in taken and self._is_open(i, taken)
        ]
        return sorted(margins, key=lambda pair: -pair[1])

    def run(self) -> None:
        """Choose until nothing more is wanted."""
        while wanted := [(i, margin) for i, margin in self.ranking() if margin > 0.0]:
            candidates = self.rows.candidates
            i = simplest(wanted, candidates, self.rows.robot.last_links)
            wider = candidates[i].is_wider_than
            self.chosen = [*(k for k in self.chosen if not wider(candidates[k])), i]
            self._prune()

    def _is_open(self, i: int, chosen: Sequence[int]) -> bool:
        candidate = self.rows.candidates[i]
        taken = [self.rows.candidates[k] for k in chosen]
        if self._pruned.get(i, 0) >= MOST_PRUNED or candidate.contradicts(taken):
            return False
        here = [t.kind for t in taken if t.where == candidate.where]
        believed = self.rows.balances[0].effects
        here += [type(e) for e in believed if e.where == candidate.where]
        is_rubbing = any(is_kind_of(kind, law) for kind in here for law in (DRY, VISCOUS))
        return is_rubbing or candidate.kind.id not in _AFTER_FRICTION

    def _prune(self) -> None:
        while len(self.chosen) > 1:
            margins = {i: self.gain(i) - self.need(i) for i in self.chosen}
            worst = min(margins, key=margins.__getitem__)
            if margins[worst] > 0.0:
                return
            self.drop(worst)

    def drop(self, i: int) -> None:
        """Take a cause back."""
        self.chosen.remove(i)
        self._pruned[i] = self._pruned.get(i, 0) + 1

    def bar(self, which: Iterable[int]) -> None:
        """Choose causes no more."""
        self._pruned = {**self._pruned, **dict.fromkeys(which, MOST_PRUNED)}

    def ask_again(self, gone: Iterable[int]) -> bool:
        """Choose what had given way to causes that are gone, unless others give way to it.

        Returns:
            Whether there is any.
        """
        candidates = self.rows.candidates
        keys = {candidates[i].key for i in gone}
        self.bar(i for i in self.live if candidates[i].key in keys)
        other = copy(self)
        other.chosen = list(self.chosen)
        other.run()
        if not set(other.chosen) > set(self.chosen):
            return False
        self.take(other)
        return True

    def held_out(self, i: int) -> Array:
        """(F,) log evidence that a cause adds to the prediction of each part from the others.

        Beside its not being there at all: a part that is sharp on its own is predicted as well by
        what is only tolerated.
        """
        both = [*self.chosen, i]
        if self.is_stretched(i, both):
            others = [k for k in self.chosen if k != i]
            without, with_it = (self.held_out_misfits(c, i) for c in (others, both))
            return np.asarray(0.5 * (without - with_it))
        whole = self._score(self.posterior(both), i).evidence
        rests = [self.posterior(both, fold.rest) for fold in self.parts.folds(i)]
        return np.array([whole - self._score(rest, i).evidence for rest in rests])

    def instead_of(self, i: int, barred: Iterable[int]) -> Selection:
        """What is chosen in the place of a cause, others barred.

        Laws that gave way to it, or would, are open again.
        """
        other = copy(self)
        other.chosen = [k for k in self.chosen if k != i]
        other._pruned = {**self._pruned, **dict.fromkeys(self.alike(i), 0)}
        other.bar(barred)
        other.run()
        return other

    def alike(self, i: int) -> list[int]:
        """Special cases of a cause's law at its place, and laws that it is one of."""
        candidates = self.rows.candidates
        return [k for k in self.live if candidates[k].repeats([candidates[i]])]

    def leaning_on(self, i: int) -> int:
        """The weakest finer law chosen beside plain friction at its joint; else that cause.

        Such laws are asked for beside plain friction alone. Where a load or a rate hardly changes
        they are nearly the same, and it is they that go.
        """
        candidates = self.rows.candidates
        if candidates[i].kind.id not in (DRY, VISCOUS):
            return i
        here = (k for k in self.chosen if candidates[k].where == candidates[i].where)
        finer = (k for k in here if candidates[k].kind.id in _LEANING)
        return min(finer, key=self.gain, default=i)

    def take(self, other: Selection) -> None:
        """Choose as another does, and bar what it bars."""
        self.chosen, self._pruned = other.chosen, other._pruned

    def held_out_misfit(self, chosen: Sequence[int], i: int | None = None) -> float:
        """`held_out_misfits` of all parts together."""
        return float(np.sum(self.held_out_misfits(chosen, i)))

    def held_out_misfits(self, chosen: Sequence[int], i: int | None = None) -> Array:
        """(F,) squared rows of every part with the coefficients that all others give.

        What is of a part alone, such as its load, is not held against it: its most probable value
        there is.

        Args:
            chosen: What is beside the tolerances.
            i: The cause that the parts judge; None: all of them. It is not there at all where it
                is not chosen.
        """
        out = []
        for fold in self.parts.folds(i):
            if i is None or i in chosen:
                found = self.posterior(chosen, fold.rest)
            else:
                found = self.without(i, [*chosen, i], fold.rest)
            out.append(fold.part.misfit(self._with_own(found, fold)))
        return np.array(out)

    def _with_own(self, found: Posterior, fold: Fold) -> Array:
        """(K,) most probable coefficients, those of recordings of which only the part knows."""
        mean, information = found.mean.copy(), np.diag(fold.rest.matrix)
        own = np.flatnonzero(self._is_own & (information <= _ROUNDING * self._information))
        if len(own):
            mean[own] = 0.0
            part = fold.part.part(own)
            left = part.vector - fold.part.matrix[own] @ mean
            mean[own] = np.linalg.solve(part.matrix + np.diag(found.precision[own]), left)
        return mean

    def without(self, i: int, chosen: Iterable[int], gram: Gram | None = None) -> Posterior:
        """Of causes, one of which is not there at all; see `posterior`.

        Tolerances that would be stretched in its place stay what they are beside it.
        """
        own, both = self.rows.places[i], frozenset(chosen)
        beside = self.posterior(both, gram)
        if not self.is_stretched(i, both):
            return beside.under(own, NOTHING * self.rows.sizes[own])
        free = np.concatenate([own[:0], *(self.rows.places[k] for k in both - {i})])
        return beside.refitted(self.whole if gram is None else gram, own, free)

    def is_stretched(self, i: int, chosen: Iterable[int]) -> bool:
        """Whether tolerances stand in for a cause only where that alone is evidence enough.

        A scale of torques that is five of its tolerances off predicts every part as well as a link
        of another mass; that no machine has it is said by its prior, which is of no part.
        """
        if not self.rows.holds_tolerances:
            return False
        beside, own = self.posterior(chosen), self.rows.places[i]
        without = beside.under(own, NOTHING * self.rows.sizes[own])
        free = np.concatenate([own, *(self.rows.places[k] for k in chosen)])
        return without.implausibility(free) - beside.implausibility(free) > self.need(i)

    def implausibility(self, chosen: Iterable[int]) -> float:
        """`Posterior.implausibility` of all values beside what is chosen [nats]."""
        return self.posterior(chosen).implausibility()


_LAST = ('joint_torque_ripple',)
"""Chosen where nothing else is wanted: a few periods follow any smooth curve of the angle. What
stands in its place until then is pruned."""
_BODY = 'inertial_parameters'


def simplest(
    wanted: Sequence[tuple[int, float]], candidates: Sequence[Candidate], last: Container[str]
) -> int:
    """The likeliest beforehand of those that do nearly as well as the best.

    That is the cause of fewest numbers at the same place; of bodies, whose columns are much the
    same as their neighbours', what hangs on the last link. There one number is a case of all ten,
    whose freedom the evidence has paid: the better one is chosen.

    Args:
        wanted: Numbers of candidates with their margins, best first.
        candidates: All of them.
        last: Names of the last links.
    """
    wanted = [pair for pair in wanted if candidates[pair[0]].kind.id not in _LAST] or wanted
    close = [(i, m) for i, m in wanted if m > SIMPLER_MARGIN * wanted[0][1]]
    best = candidates[wanted[0][0]]
    if best.kind.id == _BODY:
        bodies = [i for i, _ in close if candidates[i].kind.id == _BODY]
        return next((i for i in bodies if candidates[i].where in last), bodies[0])
    near = [(i, margin) for i, margin in close if candidates[i].where == best.where]
    return min(near, key=lambda pair: (len(candidates[pair[0]].sizes), -pair[1]))[0]


class HeldOutParts:
    """Recordings, or blocks of them.

    Args:
        rows: The recordings.
        blocks: Gram matrices of the blocks of rows.
        recording: (B,) number of the recording of each block.
        whole: Sums over all rows, those that are never held out among them.
    """

    def __init__(
        self, rows: ArmRows, blocks: Sequence[Gram], recording: IntArray, whole: Gram
    ) -> None:
        self._rows, self._blocks, self._whole = rows, tuple(blocks), whole
        numbers, self._which = np.unique(recording, return_inverse=True)
        self._recordings = [
            sum_of([b for b, r in zip(blocks, self._which, strict=True) if r == k])
            for k in range(len(numbers))
        ]
        self._folds: dict[bytes, list[Fold]] = {}

    def labels(self, i: int | None = None) -> IntArray:
        """(B,) the part that each block belongs to; -1: to none that judges.

        Parts are recordings where two or more say something of a cause, else the blocks of the
        one that does. Where a load is declared they are the first, second, ... block of each: a
        loaded recording alone does not tell the load from the links.

        Args:
            i: The cause; None: all that is chosen.
        """
        own = slice(None) if i is None else self._rows.places[i]
        sizes, which = self._rows.sizes[own], self._which
        information = np.array([np.diag(r.matrix)[own] @ sizes**2 for r in self._recordings])
        judges = np.flatnonzero(information > TELLING * information.sum())
        if len(judges) < 2:
            judges = np.array([np.argmax(information)])
        elif not self._rows.has_load:
            return which
        place = np.arange(len(which)) - np.searchsorted(which, which)
        return np.where(np.isin(which, judges), place, -1)

    def are_recordings(self, i: int) -> bool:
        """Whether each of two recordings or more judges a cause."""
        several = len(self._recordings) > 1 and bool(np.all(self.labels(i) >= 0))
        return several and not self._rows.has_load

    def folds(self, i: int | None = None) -> list[Fold]:
        """Each part of the data beside all others, see `labels`."""
        labels = self.labels(i)
        key = labels.tobytes()
        if key not in self._folds:
            parts = [
                sum_of([b for b, label in zip(self._blocks, labels, strict=True) if label == part])
                for part in range(labels.max() + 1)
            ]
            self._folds[key] = [Fold(self._whole - part, part) for part in parts]
        return self._folds[key]
