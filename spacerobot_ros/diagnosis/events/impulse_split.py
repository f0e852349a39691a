"""Steps of the angular momentum that passed for one, told apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...types import Array
from .event_limits import KEPT_STEP
from .impulse_fit import LONGEST, Impulse, ImpulseFit

_TOUCHING = 0.1  # s between two that are one
_SPACING = 0.5  # s between the middles that are tried, and their duration: the usual one

_ALONE = 0.5
"""Of what two must gain, that they gain where all others stay: moved with them 37 pairs about 13
and 15 steps of a record gained 0 to 5 more, of 26. It takes a third to a half of the time."""


def split(best: ImpulseFit) -> ImpulseFit:
    """Two impulses in place of one that covers both, or lies between, where they explain more.

    One between two is a valley of its own: no step of Gauss and Newton leads out of it, so pairs
    at all times about it are tried; those that beside all others, where these are, gain less
    than half of what two must are none.
    """
    for k in range(len(best.times)):
        others = best.at(np.delete(best.times, k, axis=0))
        for pair in pairs(others, best.times[k]):
            alone = others.with_held(pair).refined()
            if best.cost - alone.cost < _ALONE * KEPT_STEP**2:
                continue
            trial = others.at(np.array([*others.times, *alone.times])).refined()
            stands = min(i.z for i in trial.found) >= KEPT_STEP
            is_apart = len(apart(trial.found)) > len(best.times)
            if stands and is_apart and best.cost - trial.cost > KEPT_STEP**2:
                return split(trial)
    return best


def apart(found: Sequence[Impulse]) -> Array:
    """(M, 2) times of the impulses that touch no larger one."""
    out: list[Impulse] = []
    for i in sorted(found, key=lambda i: -i.z):
        if all(i.end + _TOUCHING < o.start or i.start - _TOUCHING > o.end for o in out):
            out.append(i)
    return times_of(out)


def times_of(found: Sequence[Impulse]) -> Array:
    """(M, 2) middles, and logarithms of durations."""
    return np.array([i.times for i in found]).reshape(-1, 2)


def pairs(others: ImpulseFit, time: Array) -> Iterator[Array]:
    """(2, 2) times of two in place of one (2,): its halves, and the best of usual length about."""
    middle, duration = time.tolist()
    quarter, half = 0.25 * np.exp(duration), duration - np.log(2.0)
    yield np.array([[middle - quarter, half], [middle + quarter, half]])
    tried = middle + np.arange(-LONGEST, LONGEST + _SPACING, _SPACING)
    for i in others.found:
        tried = tried[(tried + _SPACING < i.start) | (tried - _SPACING > i.end)]
    tried = tried[others.is_within(tried)]
    times = np.column_stack([tried, np.full(len(tried), np.log(_SPACING))])
    first, second = np.triu_indices(len(times), 2)  # neighbours would touch
    if len(first):
        best_pair = int(np.argmax(others.gains(times, np.column_stack([first, second]))))
        yield times[[first[best_pair], second[best_pair]]]
