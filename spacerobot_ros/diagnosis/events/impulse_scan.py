r"""Steps of a free base's angular momentum, found in what the torque-driven filter predicts.

The filter predicts every sample from the measured joint torques, so a torque from outside on the
base shows in the innovations r for the few seconds in which the state is found again. With h the
whitened column of a bell of unit impulse along each inertial axis,

    num = h' r,  den = h' h (3 x 3),  impulse = den^-1 num,  z^2 = num' den^-1 num.

num of all times is one pass backwards; den hardly changes along a record and is taken at some.
What lasts (wheels, bodies, biases) is fitted before: beside it h is short. The part that is linear
would show in translations alone, which nobody measures.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...effects.surroundings.external import pulse_shape
from ...estimation.refit import Fit
from ...types import Array
from .event_limits import KEPT_STEP, LISTED_STEP, STEADY
from .impulse_fit import EDGE, LONGEST, Impulse, ImpulseFit, bells
from .impulse_split import apart, split, times_of

DURATIONS = (0.05, 0.3, 1.0, 3.0)
"""Of the bells of a scan [s]; a record shorter than one is not asked for it."""
_END = 0.3  # s before the end of a record in which no step is judged
_SAMPLES = 16  # times at which den is taken
_MOST = 20  # impulses of a record
_QUANTILE = 0.3  # of z of all times, which few events leave alone
_DRAWS, _CLEAR = 12, 4.0  # of white noise; their deviations, beyond which a scatter is none of it
_SETTLED = 1.5  # s in which the filter still finds its state
_ROUNDS = 4
_SHARE = 0.3  # of a record that events may take, as their level is that of all other times
AXES = 'xyz'
_SEEN = 0.02  # of a template's square that columns must leave for it to say anything
TAIL = 0.05  # s after an event in which nothing is used


class ImpulseScan:
    """All steps of the angular momentum beside a fit.

    Args:
        fit: Of a free base.
    """

    def __init__(self, fit: Fit) -> None:
        self._rows = fit.rows
        self._time = fit.rows.motion.time
        self._rotation = fit.rows.motion.rotation
        self.seconds = float(self._time[-1] - self._time[0])
        self._grid = np.arange(
            self._time[0], self._time[-1], float(np.median(np.diff(self._time)))
        )
        searched = self.seconds - _SETTLED - _END
        self.durations = tuple(d for d in DURATIONS if d < searched)
        self._lasting = fit.tangents
        self._squares = {d: self._between(d, self._square(d)) for d in self.durations}
        self._least = {d: np.linalg.eigvalsh(den)[:, 0] for d, den in self._squares.items()}
        self.colours = dict.fromkeys(self.durations, 1.0)
        self._known: dict[bytes, Array] = {}  # `_wanted` of the columns of the last fit
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

    def _square(self, duration: float, beside: Array | None = None) -> Array:
        """(S, 3, 3) den of bells at some times, beside columns (R, K) that take their share."""
        middles = self._sampled + 0.5 * duration
        times = np.column_stack([middles, np.full(_SAMPLES, np.log(duration))])
        columns = bells(self._rows, times)
        if beside is not None:
            basis = np.linalg.qr(beside)[0]
            columns -= basis @ (basis.T @ columns)
        blocks = columns.reshape(len(columns), 3, -1)
        return np.einsum('ras,rbs->sab', blocks, blocks)

    def _between(self, duration: float, squares: Array) -> Array:
        """(G, 3, 3) den at all times of the grid, of (S, 3, 3) at some."""
        at = self._sampled + 0.5 * duration
        columns = [np.interp(self._grid, at, x) for x in squares.reshape(_SAMPLES, 9).T]
        return np.column_stack(columns).reshape(-1, 3, 3)

    @property
    def _sampled(self) -> Array:
        first = self._time[0] + _SETTLED
        last = self._time[-1] - _SETTLED - max(self.durations)
        return np.linspace(first, max(first, last), _SAMPLES)

    def _largest(self, best: ImpulseFit) -> tuple[float, float] | None:
        """Middle and log duration of the bell that stands out most of what a fit leaves."""
        wanted, taken, hit = [self._wanted(best.left)], self._taken(best), None
        least = LISTED_STEP
        for duration in self.durations:
            (z,) = self._norms(wanted, taken, duration, best)
            k = int(np.argmax(z))
            if z[k] > least:
                least, hit = float(z[k]), (float(self._grid[k]), float(np.log(duration)))
        return hit

    def _wanted(self, left: Array) -> Array:
        """(G, 3) torque along inertial axes that the rows want, on a regular grid of times."""
        wanted = self._rows.force_correlation(left)[:, 3:6]
        wanted = np.einsum('nab,nb->na', self._rotation, wanted)
        which = np.searchsorted(self._grid, self._time, 'right') - 1
        binned = np.zeros((len(self._grid), 3))
        np.add.at(binned, np.clip(which, 0, len(self._grid) - 1), wanted)
        return binned

    def _taken(self, best: ImpulseFit) -> list[Array]:
        """The same of an orthonormal basis of a fit's columns, whose share no template keeps."""
        columns = {column.tobytes(): column for column in best.columns.T}
        self._known = {
            key: self._known[key] if key in self._known else self._wanted(column)
            for key, column in columns.items()
        }
        wanted = [self._known[column.tobytes()] for column in best.columns.T]
        return list(np.tensordot(best.ways.T, np.reshape(wanted, (-1, len(self._grid), 3)), 1))

    def _colour(self, best: ImpulseFit) -> None:
        """Set by how much z scatters more than in white noise, where nothing was found.

        Where little is noise z of one time is nearly that of the next, and its scatter one draw.
        """
        draws = np.random.default_rng(_DRAWS).standard_normal((len(best.left), _DRAWS))
        draws = best.beside(draws)
        wanted, taken = [self._wanted(x) for x in (best.left, *draws.T)], self._taken(best)
        for duration in self.durations:
            sizes = self._norms(wanted, taken, duration, best)
            if np.any(sizes[0]):
                own, *white = (np.log(np.quantile(z[z > 0.0], _QUANTILE)) for z in sizes)
                beyond = float(own - np.mean(white))
                is_clear = beyond > _CLEAR * np.std(white)
                self.colours[duration] = float(np.exp(max(0.0, beyond) * is_clear))

    def colour(self, found: Impulse) -> float:
        """That of the duration nearest to an impulse's."""
        length = found.end - found.start
        return self.colours[min(self.durations, key=lambda d: abs(np.log(d / length)))]

    def _norms(
        self, wanted: Sequence[Array], taken: Sequence[Array], duration: float, best: ImpulseFit
    ) -> Array:
        """(W, G) z of bells centred on the times of the grid, in W records; 0 at known ones."""
        step = self._grid[1] - self._grid[0]
        count = max(1, round(duration / step))
        bell = pulse_shape((np.arange(count) + 0.5) / count, EDGE)
        bell /= np.sum(bell) * step

        def smooth(binned: Array) -> Array:
            return np.column_stack([np.convolve(x, bell, 'same') for x in binned.T])

        num = np.stack([smooth(x) for x in wanted], axis=2)
        left = self._squares[duration].copy()
        for share in map(smooth, taken):
            left -= share[:, :, None] * share[:, None, :]
        seen = np.linalg.eigvalsh(left)[:, 0] > _SEEN * self._least[duration]
        left[~seen] = np.eye(3)
        z = np.sqrt(np.maximum(np.sum(np.linalg.solve(left, num) * num, axis=1), 0.0)).T
        unseen = (self._grid < self._time[0] + _SETTLED) | (self._grid > self._time[-1] - _END)
        for found in best.found:
            unseen |= (self._grid > found.start - TAIL) & (self._grid < found.end + TAIL)
        return np.where(seen & ~unseen, z, 0.0)

    def usual_std(self, duration: float) -> Array:
        """(3,) usual standard deviation of one more impulse by axis, beside all else [N m s]."""
        inverse = np.linalg.inv(self._square(duration, self._best.columns))
        usual = np.sqrt(np.median(np.diagonal(inverse, 0, 1, 2), axis=0))
        return np.asarray(self.colours[duration] * usual)
