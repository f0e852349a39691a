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

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...effects.external import pulse_shape
from ...estimation.refit import Fit
from ...types import Array
from .event_limits import LISTED_STEP

DURATIONS = (0.05, 0.3, 1.0, 3.0)
"""Of the bells of a scan [s]; a record shorter than one is not asked for it."""
_END = 0.3  # s before the end of a record in which no step is judged
_SAMPLES = 16  # times at which den is taken
_MOST = 20  # events
_QUANTILE = 0.3  # of z of all times, which few events leave alone
_DRAWS, _CLEAR = 12, 4.0  # of white noise; their deviations, beyond which a scatter is none of it
_SETTLED = 1.5  # s in which the filter still finds its state
EDGE = 0.5  # share of a bell in which it rises and falls
_ROUNDS = 4
_LONGEST = 6.0  # s: twice the longest bell; what lasts longer is a lasting cause
_SHARE = 0.3  # of a record that events may take, as their level is that of all other times
_USUAL, _WIDTH = 0.5, 1.3  # s, and deviation of its logarithm: most events last 0.04 to 6 s
_PASSES, _HALVINGS = 8, 3
_FARTHEST = 0.5  # durations that an event moves at once
_STEP = 0.02  # of a duration, for derivatives
_FEWEST = 3  # samples: a shorter bell is none to them
_GAINED = 0.05  # less of the cost is settled
AXES = 'xyz'
_TOUCHING = 0.1  # s between two that are one
_SEEN = 0.02  # of a template's square that columns must leave for it to say anything
TAIL = 0.05  # s after an event in which nothing is used


@dataclass(frozen=True, slots=True, eq=False)
class Impulse:
    """An impulse (3,) along inertial axes [N m s] between two times.

    Args:
        start: [s]. end: [s]. value: (3,). std: (3,) its deviations. z: Size by these.
        middle_std: Standard deviation of the middle of its times [s].
    """

    start: float
    end: float
    value: Array
    std: Array
    z: float
    middle_std: float = 0.0

    @property
    def times(self) -> Array:
        """(2,) its middle, and the logarithm of its duration."""
        return np.array([0.5 * (self.start + self.end), np.log(self.end - self.start)])


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
        self._squares = {d: self._square(d) for d in self.durations}
        self.colours = dict.fromkeys(self.durations, 1.0)
        self.found: list[Impulse] = []
        self._data, self._lasting = fit.data, fit.tangents
        self._known: dict[bytes, Array] = {}  # `_wanted` of the columns of the last fit
        left = self._search()
        self._colour(left)
        if any(i.z / self.colour(i) < LISTED_STEP for i in self.found):
            kept = [i for i in self.found if i.z / self.colour(i) >= LISTED_STEP]
            self._colour(self._fitted(_apart(kept)))
        self.found = sorted(self._scaled(), key=lambda i: i.start)

    def _scaled(self) -> Iterator[Impulse]:
        """What was found by the scatter of its duration, with the deviation of its time."""
        matrix = self._by_times(_times(self.found))[1]
        stds = np.sqrt(np.diag(np.linalg.inv(matrix)))[: len(self.found)]
        for i, std in zip(self.found, stds.tolist(), strict=True):
            colour = self.colour(i)
            middle_std = std * (i.end - i.start) * colour
            yield replace(i, std=i.std * colour, z=i.z / colour, middle_std=middle_std)

    def _search(self) -> Array:
        """What all impulses leave: the large ones first, then those that others hide."""
        for _ in range(_ROUNDS):
            left = self._refined(_times(self.found))
            if len(apart := _apart(self.found)) < len(self.found):
                left = self._refined(apart)
            times = [i.times for i in self.found]
            count = len(times)
            while len(times) < _MOST and (window := self._largest(left, self._taken())):
                times.append(np.array(window))
                left = self._fitted(np.array(times))
            if len(times) == count:
                return left
        return self._refined(_apart(self.found))

    @property
    def is_transient(self) -> bool:
        """Whether what was found comes and goes: no bell is long, and most times have none."""
        lengths = [i.end - i.start for i in self.found]
        return max(lengths, default=0.0) < _LONGEST and sum(lengths) < _SHARE * self.seconds

    def _refined(self, times: Array) -> Array:
        """What is left with times and sizes of all events fitted together (Gauss and Newton)."""
        left = self._fitted(times)
        for _ in range(_PASSES if len(times) else 0):
            cost, step = self._cost(left, times), self._step(left, times)
            for k in range(_HALVINGS):
                moved = times + 0.5**k * step
                trial = self._fitted(moved)
                gained = cost - self._cost(trial, moved)
                if gained > 0.0:
                    break
            else:
                return self._fitted(times)
            left, times = trial, moved
            if gained < _GAINED:
                break
        return left

    def _cost(self, left: Array, times: Array) -> float:
        """Minus twice the log posterior."""
        return float(left @ left + np.sum(((times[:, 1] - np.log(_USUAL)) / _WIDTH) ** 2))

    def _step(self, left: Array, times: Array) -> Array:
        """(M, 2) towards the best times, sizes free beside them."""
        columns, matrix = self._by_times(times)
        beyond = (times - np.log(_USUAL)) * np.array([0.0, _WIDTH**-2.0])
        step = np.linalg.solve(matrix, columns.T @ left - beyond.T.ravel())
        middle, longer = np.clip(step, -_FARTHEST, _FARTHEST).reshape(2, -1)
        shortest = np.log(_FEWEST * (self._grid[1] - self._grid[0]))
        longer = np.clip(times[:, 1] + longer, shortest, np.log(_LONGEST)) - times[:, 1]
        ahead = np.clip(times[:, 0] + middle * np.exp(times[:, 1]), *self._time[[0, -1]])
        return np.column_stack([ahead - times[:, 0], longer])

    def _by_times(self, times: Array) -> tuple[Array, Array]:
        """(R, 2 M) rows by middles, in durations, and by logarithms of these; their information.

        Sizes are free beside them.
        """
        changes, values = [], np.reshape([i.value for i in self.found], (-1, 3))
        length = np.exp(times[:, 1:])
        for one in (np.append(length, 0.0 * length, axis=1), np.array([0.0, 1.0])):
            change = self._forces(times + _STEP * one) - self._forces(times - _STEP * one)
            change = change.reshape(*change.shape[:2], 3, len(times)) / (2.0 * _STEP)
            changes.append(np.einsum('nfak,ka->nfk', change, values))
        columns = self._rows.whitened(np.concatenate(changes, axis=2), {})
        columns -= self._basis @ (self._basis.T @ columns)
        return columns, columns.T @ columns + np.diag(np.repeat([1.0, _WIDTH**-2.0], len(times)))

    def _of(self, times: Array) -> Array:
        """(R, 3 M) whitened columns of unit impulses along the axes at M times."""
        return self._rows.whitened(self._forces(times), {})

    def _forces(self, times: Array) -> Array:
        """(N, 6 + n, 3 M) of unit impulses along inertial axes, at M times each.

        Of the sampled bell, which may be hardly longer than the samples are apart.
        """
        shapes = pulse_shape((self._time[:, None] - times[:, 0]) / np.exp(times[:, 1]) + 0.5, EDGE)
        shapes /= np.maximum(np.gradient(self._time) @ shapes, 1e-300)
        out = np.zeros((len(shapes), 6 + self._rows.robot.n_joints, 3 * len(times)))
        torque = np.einsum('nab,nk->nbak', self._rotation, shapes)
        out[:, 3:6] = torque.reshape(len(shapes), 3, -1)
        return out

    def _square(self, duration: float, beside: Array | None = None) -> Array:
        """(S, 3, 3) den of bells at some times, beside columns (R, K) that take their share."""
        middles = self._sampled + 0.5 * duration
        columns = self._of(np.column_stack([middles, np.full(_SAMPLES, np.log(duration))]))
        if beside is not None:
            basis = np.linalg.qr(beside)[0]
            columns -= basis @ (basis.T @ columns)
        blocks = columns.reshape(len(columns), 3, -1)
        return np.einsum('ras,rbs->sab', blocks, blocks)

    @property
    def _sampled(self) -> Array:
        first = self._time[0] + _SETTLED
        last = self._time[-1] - _SETTLED - max(self.durations)
        return np.linspace(first, max(first, last), _SAMPLES)

    def _largest(self, left: Array, taken: Sequence[Array]) -> tuple[float, float] | None:
        """Middle and log duration of the bell that stands out most, beside what columns take."""
        wanted = self._wanted(left)
        best, window = LISTED_STEP, None
        for duration in self.durations:
            (z,) = self._norms([wanted], taken, duration)
            k = int(np.argmax(z))
            if z[k] > best:
                best, window = float(z[k]), (float(self._grid[k]), float(np.log(duration)))
        return window

    def _wanted(self, left: Array) -> Array:
        """(G, 3) torque along inertial axes that the rows want, on a regular grid of times."""
        wanted = self._rows.force_correlation(left)[:, 3:6]
        wanted = np.einsum('nab,nb->na', self._rotation, wanted)
        which = np.searchsorted(self._grid, self._time, 'right') - 1
        binned = np.zeros((len(self._grid), 3))
        np.add.at(binned, np.clip(which, 0, len(self._grid) - 1), wanted)
        return binned

    def _taken(self) -> list[Array]:
        """The same of an orthonormal basis of all columns, whose share no template keeps."""
        columns = {column.tobytes(): column for column in self._columns.T}
        self._known = {
            key: self._known[key] if key in self._known else self._wanted(column)
            for key, column in columns.items()
        }
        wanted = [self._known[column.tobytes()] for column in self._columns.T]
        return list(np.tensordot(self._ways.T, np.reshape(wanted, (-1, len(self._grid), 3)), 1))

    def _colour(self, left: Array) -> None:
        """Set by how much z scatters more than in white noise, where nothing was found.

        Where little is noise z of one time is nearly that of the next, and its scatter one draw.
        """
        draws = np.random.default_rng(_DRAWS).standard_normal((len(left), _DRAWS))
        draws -= self._basis @ (self._basis.T @ draws)
        wanted, taken = [self._wanted(x) for x in (left, *draws.T)], self._taken()
        for duration in self.durations:
            sizes = self._norms(wanted, taken, duration)
            if np.any(sizes[0]):
                own, *white = (np.log(np.quantile(z[z > 0.0], _QUANTILE)) for z in sizes)
                beyond = float(own - np.mean(white))
                is_clear = beyond > _CLEAR * np.std(white)
                self.colours[duration] = float(np.exp(max(0.0, beyond) * is_clear))

    def colour(self, found: Impulse) -> float:
        """That of the duration nearest to an impulse's."""
        length = found.end - found.start
        return self.colours[min(self.durations, key=lambda d: abs(np.log(d / length)))]

    def _norms(self, wanted: Sequence[Array], taken: Sequence[Array], duration: float) -> Array:
        """(W, G) z of bells centred on the times of the grid, in W records."""
        step = self._grid[1] - self._grid[0]
        count = max(1, round(duration / step))
        bell = pulse_shape((np.arange(count) + 0.5) / count, EDGE)
        bell /= np.sum(bell) * step

        def smooth(binned: Array) -> Array:
            return np.column_stack([np.convolve(x, bell, 'same') for x in binned.T])

        num = np.stack([smooth(x) for x in wanted], axis=2)
        squares = self._squares[duration].reshape(_SAMPLES, 9)
        den = np.column_stack(
            [np.interp(self._grid, self._sampled + 0.5 * duration, x) for x in squares.T]
        )
        left = den.reshape(-1, 3, 3).copy()
        for share in map(smooth, taken):
            left -= share[:, :, None] * share[:, None, :]
        seen = (
            np.linalg.eigvalsh(left)[:, 0]
            > _SEEN * np.linalg.eigvalsh(den.reshape(-1, 3, 3))[:, 0]
        )
        left[~seen] = np.eye(3)
        z = np.sqrt(np.maximum(np.sum(np.linalg.solve(left, num) * num, axis=1), 0.0)).T
        unseen = (self._grid < self._time[0] + _SETTLED) | (self._grid > self._time[-1] - _END)
        for found in self.found:
            unseen |= (self._grid > found.start - TAIL) & (self._grid < found.end + TAIL)
        return np.where(seen & ~unseen, z, 0.0)

    def _fitted(self, times: Array) -> Array:
        """What impulses and what lasts leave, fitted together; sets the impulses."""
        columns = np.column_stack([self._lasting, self._of(times)])
        size = np.sqrt(np.sum(columns**2, axis=0))
        scale = 1.0 / np.where(size > 0.0, size, 1.0)
        squares, ways = np.linalg.eigh((columns * scale).T @ (columns * scale))
        is_seen = squares > squares[-1:] * len(squares) * np.finfo(float).eps
        ways = scale[:, None] * ways[:, is_seen] / np.sqrt(squares[is_seen])
        self._columns, self._ways = columns, ways
        self._basis, inverse = columns @ ways, ways @ ways.T
        values = inverse @ (columns.T @ self._data)
        self.found = []
        for k, (middle, duration) in enumerate(times.tolist()):
            own = self._lasting.shape[1] + k + len(times) * np.arange(3)
            value, covariance = values[own], inverse[np.ix_(own, own)]
            z2 = float(value @ np.linalg.pinv(covariance, hermitian=True) @ value)
            std = np.sqrt(np.diag(covariance))
            start, end = (middle + half * math.exp(duration) for half in (-0.5, 0.5))
            self.found.append(Impulse(start, end, value, std, float(np.sqrt(max(z2, 0.0)))))
        return np.asarray(self._data - columns @ values)

    def usual_std(self, duration: float) -> Array:
        """(3,) usual standard deviation of an impulse by axis, beside what lasts [N m s]."""
        inverse = np.linalg.inv(self._square(duration, self._lasting))
        usual = np.sqrt(np.median(np.diagonal(inverse, 0, 1, 2), axis=0))
        return np.asarray(self.colours[duration] * usual)


def _apart(found: Sequence[Impulse]) -> Array:
    """(M, 2) times of the impulses that touch no larger one."""
    out: list[Impulse] = []
    for i in sorted(found, key=lambda i: -i.z):
        if all(i.end + _TOUCHING < o.start or i.start - _TOUCHING > o.end for o in out):
            out.append(i)
    return _times(out)


def _times(found: Sequence[Impulse]) -> Array:
    """(M, 2) middles, and logarithms of durations."""
    return np.array([i.times for i in found]).reshape(-1, 2)
