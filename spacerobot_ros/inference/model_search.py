"""The set of causes of the largest objective: moves that raise it, until there is none.

From a set, the gain of every hypothesis that comes, goes or takes another one's place is known
from one set of marginal sums. Bounds can only take from it, so that few moves need to be looked at
to find the best. Each move raises one objective: the search ends, and can not cycle.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Sequence, Set
from dataclasses import dataclass

import numpy as np

from ..types import Array, IntArray
from .hypotheses import Hypotheses
from .marginal import Marginal, SingleBounds

FOLLOWED = 3
"""Best exchanges for each cause beside which a further hypothesis is tried: bounds the run time;
`test/inference/test_model_search.py` has how often the search then misses the best set."""

BOUNDED = 10
"""Moves of largest gain without bounds that are looked at with them: bounds the run time, where
those of many bodies cost so much that any move might win some of it back."""

RISE = 1e-3
"""Nats that a move of the search must gain. Rounding of updates is below that (`UPDATES`), so no
move is taken back for it, and the search can not cycle."""

UPDATES = 8
"""Rank updates of the marginal sums before they are made anew. A slab is at most `MOST_RESOLVED`
times the number of rows, 1e5, wider than what they resolve: an update loses 1e8 times the rounding
of a gain, 1e-16 of 1e4 nats."""


@dataclass(frozen=True, slots=True, eq=False)
class ChosenSet:
    """A set of causes.

    Args:
        chosen: Numbers of hypotheses.
        marginal: All rows under it.
        objective: J.
        updates: How often the marginal sums were updated.
    """

    chosen: frozenset[int]
    marginal: Marginal
    objective: float
    updates: int = 0

    @classmethod
    def of(cls, hypotheses: Hypotheses, chosen: Iterable[int]) -> ChosenSet:
        """Made anew."""
        chosen = frozenset(chosen)
        marginal = hypotheses.marginal(chosen)
        return cls(chosen, marginal, hypotheses.objective(marginal, chosen))


@dataclass(frozen=True, slots=True)
class _Move:
    came: frozenset[int]
    gone: frozenset[int]


def best_set(
    hypotheses: Hypotheses,
    start: Iterable[int] = (),
    barred: Collection[int] = frozenset(),
    *,
    is_thorough: bool = True,
    most: float = math.inf,
) -> ChosenSet:
    """The best set that moves from a start reach.

    A hypothesis comes, or goes with what needs it; where neither helps, one takes the place of
    another; where that does not, two of one, one of two, or two come together.

    Args:
        hypotheses: All of them.
        start: The set to begin with, beside what is always in.
        barred: What may not come.
        is_thorough: Whether moves of three hypotheses are tried, or of two at most.
        most: Hypotheses in a set that no other joins; bounds the run time where nothing fits.
    """
    now = ChosenSet.of(hypotheses, hypotheses.always | frozenset(start))
    while True:
        ahead = _ahead(hypotheses, now, barred, is_thorough, most)
        if ahead is not None:
            now = ahead if ahead.updates < UPDATES else ChosenSet.of(hypotheses, ahead.chosen)
        elif now.updates:
            now = ChosenSet.of(hypotheses, now.chosen)
        else:
            return now


def _ahead(
    hypotheses: Hypotheses,
    now: ChosenSet,
    barred: Collection[int],
    is_thorough: bool,
    most: float,
) -> ChosenSet | None:
    """After the best move; None where none helps."""
    closed = hypotheses.always | frozenset(barred)
    free = [i for i in sorted(hypotheses.open - now.chosen) if i not in closed]
    may_go = sorted(now.chosen - hypotheses.always)
    joining = [
        _Move(frozenset([i]), frozenset())
        for i in (_joining(hypotheses, free, now.chosen) if len(now.chosen) < most else ())
    ]
    going = [_Move(frozenset(), hypotheses.dependents(now.chosen, [i])) for i in may_go]
    if best := _best(hypotheses, now, [*joining, *going]):
        return best
    exchanges = [*_exchanges(hypotheses, now, free, may_go)]
    if best := _best(hypotheses, now, exchanges):
        return best
    if not is_thorough:
        return None
    twofold = _twofold(hypotheses, now, free, may_go, [*joining, *exchanges])
    return _best(hypotheses, now, [m for m in twofold if _count(now, m) <= most])


def _count(now: ChosenSet, move: _Move) -> int:
    return len(now.chosen) + len(move.came) - len(move.gone)


def _joining(hypotheses: Hypotheses, free: Iterable[int], chosen: Set[int]) -> list[int]:
    return [i for i in free if hypotheses.may_join(i, chosen)]


def _exchanges(
    hypotheses: Hypotheses, now: ChosenSet, free: Sequence[int], may_go: Sequence[int]
) -> Iterator[_Move]:
    """One in the place of a cause with what needs it."""
    for i in may_go:
        gone = hypotheses.dependents(now.chosen, [i])
        for k in _joining(hypotheses, free, now.chosen - gone):
            yield _Move(frozenset([k]), gone)


def _twofold(
    hypotheses: Hypotheses,
    now: ChosenSet,
    free: Sequence[int],
    may_go: Sequence[int],
    exchanges: Sequence[_Move],
) -> Iterator[_Move]:
    """Beside the best exchanges for each cause, and for none, a further one goes or comes."""
    gains = _gains(hypotheses, now, exchanges)
    for gone in {m.gone for m in exchanges}:
        own = [k for k, m in enumerate(exchanges) if m.gone == gone]
        for k in sorted(own, key=lambda k: -gains[k])[:FOLLOWED]:
            came = exchanges[k].came
            for i in may_go:
                all_gone = hypotheses.dependents(now.chosen, gone | {i})
                if i not in gone and _fits(hypotheses, came, now.chosen - all_gone):
                    yield _Move(came, all_gone)
            for i in _joining(hypotheses, free, (now.chosen - gone) | came):
                if i not in came:
                    yield _Move(came | {i}, gone)


def _fits(hypotheses: Hypotheses, came: Iterable[int], chosen: Set[int]) -> bool:
    return all(hypotheses.may_join(i, chosen) for i in came)


def _best(hypotheses: Hypotheses, now: ChosenSet, moves: Sequence[_Move]) -> ChosenSet | None:
    """After the best of some moves, if it helps."""
    if not moves:
        return None
    lost = hypotheses.evidence(now.marginal, now.chosen) - now.marginal.log_density
    gains = (
        _gains(hypotheses, now, moves, RISE + lost) - lost
    )  # at most: all that bounds cost is won back
    best, most = None, RISE
    for k in np.argsort(-gains, kind='stable')[:BOUNDED].tolist():
        if gains[k] <= most:
            break
        gain = _objective_after(hypotheses, now, moves[k], now.objective + most) - now.objective
        if gain > most:
            best, most = moves[k], gain
    return None if best is None else _after(hypotheses, now, best)


def _gains(
    hypotheses: Hypotheses, now: ChosenSet, moves: Sequence[_Move], least: float = -math.inf
) -> Array:
    """(m,) by which the objective grows with each move at most, as bounds may cost more.

    Bounds of single coefficients are counted where a move gains more than `least` without them.
    """
    odds = np.array([hypotheses.prior(m.came) - hypotheses.prior(m.gone) for m in moves])
    out = odds + _evidence(now, [hypotheses.exchange(m.came, m.gone) for m in moves])
    kept = [i for i in hypotheses.constrained(now.chosen) if len(hypotheses.bases[i]) == 1]
    some = np.flatnonzero(out > least)
    pairs = [_beside(hypotheses, moves[k], kept) for k in some.tolist()]
    out[some] = odds[some] + _evidence(now, pairs, hypotheses.single_bounds)
    return out


def _evidence(
    now: ChosenSet,
    exchanges: Sequence[tuple[IntArray, Array]],
    bounds: SingleBounds | None = None,
) -> Array:
    """(m,) by which the log density grows with each exchange of priors."""
    by_size = defaultdict[int, list[int]](list)
    for k, (columns, _) in enumerate(exchanges):
        by_size[len(columns)].append(k)
    out = np.zeros(len(exchanges))
    for which in by_size.values():
        columns, change = (np.array([exchanges[k][i] for k in which]) for i in (0, 1))
        out[which] = now.marginal.gains(columns, change, bounds)
    return out


def _beside(hypotheses: Hypotheses, move: _Move, kept: Iterable[int]) -> tuple[IntArray, Array]:
    """Columns of a move and their changes, and those of causes whose bounds it may make dearer."""
    columns, change = hypotheses.exchange(move.came, move.gone)
    own = [hypotheses.every[i].columns for i in kept if i not in move.gone]
    columns = np.concatenate([columns, *own])
    return columns, np.append(change, np.zeros(len(columns) - len(change)))


def _objective_after(hypotheses: Hypotheses, now: ChosenSet, move: _Move, least: float) -> float:
    """J after a move, by its columns alone; where it is less than `least`, only that it is."""
    chosen = (now.chosen - move.gone) | move.came
    asked = {*hypotheses.constrained(chosen), *move.came, *move.gone}
    local = now.marginal.part(hypotheses.columns_of(asked))
    local = local.changed(*hypotheses.exchange(move.came, move.gone))
    return hypotheses.objective(local, chosen, least)


def _after(hypotheses: Hypotheses, now: ChosenSet, move: _Move) -> ChosenSet:
    chosen = (now.chosen - move.gone) | move.came
    marginal = now.marginal.changed(*hypotheses.exchange(move.came, move.gone))
    return ChosenSet(chosen, marginal, hypotheses.objective(marginal, chosen), now.updates + 1)
