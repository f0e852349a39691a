"""Steps of a free base's angular momentum, found in what the torque-driven filter predicts.

The filter predicts every sample from the measured joint torques, so a torque from outside on the
base shows in the innovations for the few seconds in which the state is found again. What lasts
(wheels, bodies, biases) is fitted before: beside it a bell is short. The part that is linear would
show in translations alone, which nobody measures.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...estimation.fit import Fit
from ...types import Array
from .event_limits import KEPT_STEP, LISTED_STEP, QUIET, STEADY
from .impulse_fit import LONGEST, Impulse, ImpulseFit
from .impulse_sizes import DURATIONS, ImpulseSizes

_MOST = 20  # impulses of a record
_CLEAR = 4.0  # deviations of draws of white noise, beyond which a scatter is none of it
_ROUNDS = 4
_SHARE = 0.3  # of a record that events may take, as their level is that of all other times
AXES = 'xyz'


class ImpulseScan:
    """All steps of the angular momentum beside a fit.

    Args:
        fit: Of a free base.
    """

    def __init__(self, fit: Fit) -> None:
        time = fit.rows.motion.time
        self.seconds = float(time[-1] - time[0])
        self._sizes = ImpulseSizes(fit)
        self.durations = self._sizes.durations
        self.colours = dict.fromkeys(self.durations, 1.0)
        self._best = self._standing(self._searched(ImpulseFit(fit, times_of(()))))
        if self.is_steady:  # what fell may have kept two from being told apart
            self._best = self._standing(split(self._best))
        self.found = sorted(self._scaled(), key=lambda i: i.start)

    def _standing(self, best: ImpulseFit) -> ImpulseFit:
        """Without what does not stand beside all others.

        One at a time: what it takes is its neighbours', whose times it held.
        """
        self._colour(best)
        while (
            self.is_steady
            and (found := sorted(best.found, key=self._size))
            and self._size(found[0]) < KEPT_STEP
        ):
            best = best.at(apart(found[1:])).refined()
            self._colour(best)
        return best

    def _size(self, found: Impulse) -> float:
        """Z by the scatter of its duration."""
        return found.z / self.colour(found)

    def _scaled(self) -> Iterator[Impulse]:
        """What was found by the scatter of its duration."""
        for i in self._best.found:
            yield replace(i, std=i.std * self.colour(i), z=self._size(i))

    def middle_std(self, found: Impulse) -> float:
        """Standard deviation of the middle of one that was found [s]."""
        k = [i.start for i in self._best.found].index(found.start)
        return self._best.middle_std(k) * self.colour(found)

    def _searched(self, best: ImpulseFit) -> ImpulseFit:
        """With all impulses: the large ones first, then those that others hide."""
        for _ in range(_ROUNDS):
            best = best.refined()
            if len(times := apart(best.found)) < len(best.found):
                best = best.at(times).refined()
            self._colour(best)
            if self.is_steady:  # what changes all the time is no two steps either
                best = split(best)
            count = len(best.times)
            while len(best.times) < _MOST and (window := self._largest(best)):
                best = best.at(np.array([*best.times, window]))
            if len(best.times) == _MOST:
                self._colour(best)
                if not self.is_steady:
                    return best
            if len(best.times) == count:
                return best
        return best.at(apart(best.found)).refined()

    @property
    def is_steady(self) -> bool:
        """Whether what is left beside all that was found is noise, which a step can be told from.

        Where as many as are looked for leave more, none is: they are parts of what changes all
        the time, as a drift is.
        """
        return max(self.colours.values(), default=1.0) <= STEADY

    @property
    def standing_out(self) -> list[Impulse]:
        """What is large even by the scatter of what is left, at its likeliest times, and short."""
        large = [i for i in self._best.found if self._size(i) >= LISTED_STEP]
        found = self._best.at(apart(large)).refined().found
        return [i for i in found if i.end - i.start < max(DURATIONS)]

    @property
    def is_transient(self) -> bool:
        """Whether what was found comes and goes: no bell is long, and most times have none."""
        lengths = [i.end - i.start for i in self.found]
        return max(lengths, default=0.0) < LONGEST and sum(lengths) < _SHARE * self.seconds

    def _largest(self, best: ImpulseFit) -> tuple[float, float] | None:
        """Middle and log duration of the bell that stands out most of what a fit leaves."""
        least, hit = LISTED_STEP, None
        for duration, (z,) in self._sizes.beside(best).items():
            k = int(np.argmax(z))
            if z[k] > least:
                middle = float(self._sizes.middles[duration][k])
                least, hit = float(z[k]), (middle, float(np.log(duration)))
        return hit

    def _colour(self, best: ImpulseFit) -> None:
        """Set by how much z scatters more than in white noise, where nothing was found.

        Where little is noise z of one time is nearly that of the next, and its scatter one draw.
        """
        for duration, sizes in self._sizes.beside(best, with_noise=True).items():
            if np.any(sizes[0]):
                own, *white = (np.log(np.quantile(z[z > 0.0], QUIET)) for z in sizes)
                beyond = float(own - np.mean(white))
                is_clear = beyond > _CLEAR * np.std(white)
                self.colours[duration] = float(np.exp(max(0.0, beyond) * is_clear))

    def colour(self, found: Impulse) -> float:
        """That of the duration nearest to an impulse's."""
        length = found.end - found.start
        return self.colours[min(self.durations, key=lambda d: abs(np.log(d / length)))]

    def usual_std(self, duration: float) -> Array:
        """(3,) usual standard deviation of one more impulse by axis, beside all else [N m s]."""
        inverse = np.linalg.inv(self._sizes.square(duration, self._best.columns))
        usual = np.sqrt(np.median(np.diagonal(inverse, 0, 1, 2), axis=0))
        return np.asarray(self.colours[duration] * usual)


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
