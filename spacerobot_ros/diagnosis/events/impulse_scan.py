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

from collections.abc import Sequence
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
_QUANTILE, _OF_NOISE = 0.3, 1.19
"""A quantile of the norm of three axes, and its value in white noise."""
_SETTLED = 1.5  # s in which the filter still finds its state
EDGE = 0.5  # share of a bell in which it rises and falls
_ROUNDS = 4
_LONGEST = 6.0  # s: twice the longest bell; what lasts longer is a lasting cause
_SHARE = 0.3  # of a record that events may take, as their level is that of all other times
_NEARBY = (-0.5, -0.25, 0.0, 0.25, 0.5)  # durations
_WIDER = 6.0
_SHORTEST = 0.02  # s
AXES = 'xyz'
_TOUCHING = 0.1  # s between two that are one
_SEEN = 0.02  # of a template's square that columns must leave for it to say anything
TAIL = 0.05  # s after an event in which nothing is used


@dataclass(frozen=True, slots=True, eq=False)
class Impulse:
    """An impulse (3,) along inertial axes [N m s] between two times, its std and z."""

    start: float
    end: float
    value: Array
    std: Array
    z: float


@dataclass(frozen=True, slots=True, eq=False)
class _Columns:
    """(R, K) columns and (K, G, 3) what they want of the torque, see `_wanted`."""

    whitened: Array
    wanted: Array


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
        self._data, self._lasting = fit.data, self._with_wanted(fit.tangents)
        self._steps: dict[tuple[float, float], _Columns] = {}
        left = self._search()
        self._colour(left)
        if any(i.z / self.colour(i) < LISTED_STEP for i in self.found):
            kept = [i for i in self.found if i.z / self.colour(i) >= LISTED_STEP]
            self._colour(self._fitted([(i.start, i.end) for i in kept]))
        self.found = [
            replace(i, std=i.std * self.colour(i), z=i.z / self.colour(i)) for i in self.found
        ]

    def _search(self) -> Array:
        """What all impulses leave: the large ones first, then those that others hide."""
        for _ in range(_ROUNDS):
            left = self._refined(_apart(self.found))
            spans = [(i.start, i.end) for i in self.found]
            count = len(spans)
            while len(spans) < _MOST and (window := self._largest(left)):
                spans.append(window)
                left = self._fitted(spans)
            if len(spans) == count:
                return left
        return self._refined(_apart(self.found))

    @property
    def is_transient(self) -> bool:
        """Whether what was found comes and goes: no bell is long, and most times have none."""
        lengths = [i.end - i.start for i in self.found]
        return max(lengths, default=0.0) < _LONGEST and sum(lengths) < _SHARE * self.seconds

    def _refined(self, spans: list[tuple[float, float]]) -> Array:
        """What is left with the times of every event fitted anew beside all others."""
        left = self._fitted(spans)
        for k, span in enumerate(spans):
            own = left + self._of([span]) @ self.found[k].value
            spans[k] = self._own_times(own, *span, (1.0, 0.35, 0.12))
            left = self._fitted(spans)
        return left

    def _of(self, spans: Sequence[tuple[float, float]]) -> Array:
        """(R, 3 M) whitened columns of unit impulses along the axes between M times."""
        start, end = np.asarray(spans).T
        bells = pulse_shape((self._time[:, None] - start) / (end - start), EDGE)
        area = np.gradient(self._time) @ bells
        bells /= np.where(area > 0.0, area, 1.0)
        forces = np.zeros((len(bells), 6 + len(self._rows.robot.joints), len(spans), 3))
        into_base = np.swapaxes(self._rotation, 1, 2)
        forces[:, 3:6] = into_base[:, :, None, :] * bells[:, None, :, None]
        return self._rows.whitened(forces.reshape(*forces.shape[:2], -1), {})

    def _square(self, duration: float, beside: Array | None = None) -> Array:
        """(S, 3, 3) den of bells at some times, beside columns (R, K) that take their share."""
        columns = self._of([(t, t + duration) for t in self._sampled])
        if beside is not None:
            basis = np.linalg.qr(beside)[0]
            columns -= basis @ (basis.T @ columns)
        return _squares(_blocks(columns))

    @property
    def _sampled(self) -> Array:
        first = self._time[0] + _SETTLED
        last = self._time[-1] - _SETTLED - max(self.durations)
        return np.linspace(first, max(first, last), _SAMPLES)

    def _largest(self, left: Array) -> tuple[float, float] | None:
        """Start and end of the bell that stands out most, beside what columns take of it."""
        wanted = self._wanted(left)
        best, window = LISTED_STEP, None
        for duration in self.durations:
            z = self._norms(wanted, duration)
            k = int(np.argmax(z))
            if z[k] > best:
                best, middle = float(z[k]), float(self._grid[k])
                window = middle - 0.5 * duration, middle + 0.5 * duration
        return window

    def _wanted(self, left: Array) -> Array:
        """(G, 3) torque along inertial axes that the rows want, on a regular grid of times."""
        wanted = self._rows.force_correlation(left)[:, 3:6]
        wanted = np.einsum('nab,nb->na', self._rotation, wanted)
        which = np.searchsorted(self._grid, self._time, 'right') - 1
        binned = np.zeros((len(self._grid), 3))
        np.add.at(binned, np.clip(which, 0, len(self._grid) - 1), wanted)
        return binned

    def _with_wanted(self, columns: Array) -> _Columns:
        wanted = [self._wanted(column) for column in columns.T]
        return _Columns(columns, np.array(wanted).reshape(-1, len(self._grid), 3))

    def _colour(self, left: Array) -> None:
        """Set by how much z scatters more than in white noise, where nothing was found."""
        wanted = self._wanted(left)
        for duration in self.durations:
            z = self._norms(wanted, duration)
            seen = z[z > 0.0]
            if len(seen):
                own = float(np.quantile(seen, _QUANTILE)) / _OF_NOISE
                self.colours[duration] = max(1.0, own)

    def colour(self, found: Impulse) -> float:
        """That of the duration nearest to an impulse's."""
        length = found.end - found.start
        return self.colours[min(self.durations, key=lambda d: abs(np.log(d / length)))]

    def _norms(self, wanted: Array, duration: float) -> Array:
        """(G,) z of bells centred on the times of the grid."""
        step = self._grid[1] - self._grid[0]
        count = max(1, round(duration / step))
        bell = pulse_shape((np.arange(count) + 0.5) / count, EDGE)
        bell /= np.sum(bell) * step

        def smooth(binned: Array) -> Array:
            return np.column_stack([np.convolve(x, bell, 'same') for x in binned.T])

        num = smooth(wanted)
        squares = self._squares[duration].reshape(_SAMPLES, 9)
        den = np.column_stack(
            [np.interp(self._grid, self._sampled + 0.5 * duration, x) for x in squares.T]
        )
        left = den.reshape(-1, 3, 3).copy()
        for share in map(smooth, self._taken):
            left -= share[:, :, None] * share[:, None, :]
        seen = (
            np.linalg.eigvalsh(left)[:, 0]
            > _SEEN * np.linalg.eigvalsh(den.reshape(-1, 3, 3))[:, 0]
        )
        left[~seen] = np.eye(3)
        value = np.linalg.solve(left, num[:, :, None])[:, :, 0] * seen[:, None]
        z = np.sqrt(np.maximum(np.sum(value * num, axis=1), 0.0))
        z[(self._grid < self._time[0] + _SETTLED) | (self._grid > self._time[-1] - _END)] = 0.0
        for found in self.found:
            z[(self._grid > found.start - TAIL) & (self._grid < found.end + TAIL)] = 0.0
        return z

    def _own_times(
        self, left: Array, start: float, end: float, reaches: Sequence[float] = (1.0, 0.35)
    ) -> tuple[float, float]:
        """Start and end of the bell that fits best nearby, looked for in ever smaller steps."""
        for reach in reaches:
            length, middle = end - start, 0.5 * (start + end)
            spans = [
                (middle + s * reach * length, max(_WIDER ** (f * reach) * length, _SHORTEST))
                for s in _NEARBY
                for f in _NEARBY
            ]
            own = [(max(m - 0.5 * d, 0.0), m + 0.5 * d) for m, d in spans]
            blocks = _blocks(self._of(own))
            num, den = blocks @ left, _squares(blocks)
            seen = np.linalg.det(den) > 0.0
            den[~seen] = np.eye(3)
            gain = np.einsum('sa,sa->s', np.linalg.solve(den, num[:, :, None])[:, :, 0], num)
            start, end = own[int(np.argmax(np.where(seen, gain, 0.0)))]
        return start, end

    def _fitted(self, spans: Sequence[tuple[float, float]]) -> Array:
        """What impulses and what lasts leave, fitted together; sets the impulses."""
        self._steps = {
            span: self._steps.get(span) or self._with_wanted(self._of([span])) for span in spans
        }
        every = [self._lasting, *(self._steps[span] for span in spans)]
        columns = np.column_stack([each.whitened for each in every])
        scale = 1.0 / np.maximum(np.sqrt(np.sum(columns**2, axis=0)), 1e-300)
        squares, basis = np.linalg.eigh((columns * scale).T @ (columns * scale))
        is_seen = squares > squares[-1:] * len(squares) * np.finfo(float).eps
        basis = scale[:, None] * basis[:, is_seen] / np.sqrt(squares[is_seen])
        self._taken = np.tensordot(basis.T, np.concatenate([e.wanted for e in every]), 1)
        inverse = basis @ basis.T
        values = inverse @ (columns.T @ self._data)
        self.found = []
        for k, (start, end) in enumerate(spans):
            own = slice(-3 * (len(spans) - k), columns.shape[1] - 3 * (len(spans) - k - 1))
            value, covariance = values[own], inverse[own, own]
            z2 = float(value @ np.linalg.solve(covariance, value))
            std = np.sqrt(np.diag(covariance))
            self.found.append(Impulse(start, end, value, std, float(np.sqrt(max(z2, 0.0)))))
        return np.asarray(self._data - columns @ values)

    def usual_std(self, duration: float) -> Array:
        """(3,) usual standard deviation of an impulse by axis, beside what lasts [N m s]."""
        inverse = np.linalg.inv(self._square(duration, self._lasting.whitened))
        usual = np.sqrt(np.median(np.diagonal(inverse, 0, 1, 2), axis=0))
        return np.asarray(self.colours[duration] * usual)


def _blocks(columns: Array) -> Array:
    """(S, 3, R) of columns (R, 3 S)."""
    return np.ascontiguousarray(columns.T).reshape(-1, 3, len(columns))


def _squares(blocks: Array) -> Array:
    """(S, 3, 3) products of the columns of each block."""
    return np.asarray(blocks @ np.swapaxes(blocks, 1, 2))


def _apart(found: Sequence[Impulse]) -> list[tuple[float, float]]:
    """Spans of the impulses that touch no larger one."""
    out: list[tuple[float, float]] = []
    for i in sorted(found, key=lambda i: -i.z):
        if all(i.end + _TOUCHING < a or i.start - _TOUCHING > b for a, b in out):
            out.append((i.start, i.end))
    return sorted(out)
