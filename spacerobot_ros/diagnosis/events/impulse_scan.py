"""Steps of a free base's angular momentum, found in what the torque-driven filter predicts.

The filter predicts every sample from the measured joint torques, so a torque from outside on the
base shows in the innovations for the few seconds in which the state is found again. What lasts
(wheels, bodies, biases) is fitted before: beside it a bell is short. The part that is linear would
show in translations alone, which nobody measures.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...estimation.fit import Fit
from ...types import Array
from .event_limits import KEPT_STEP, LISTED_STEP, QUIET, STEADY
from .impulse_fit import LONGEST, Impulse, ImpulseFit
from .impulse_sizes import DURATIONS, ImpulseSizes
from .impulse_split import apart, split, times_of

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
