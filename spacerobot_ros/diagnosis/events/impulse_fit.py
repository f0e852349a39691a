r"""Steps of a free base's angular momentum at given times: sizes beside what lasts, and times.

Sizes are linear: with W the whitened columns of bells of unit impulse along each inertial axis,
beside those of what lasts, least squares of the filter's innovations. Times are fitted about them
(variable projection; Golub and Pereyra, Inverse Problems 19 (2003)), with a wide prior of their
durations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...effects.surroundings.external import pulse_shape
from ...estimation.fit import Fit
from ...estimation.rows import Rows
from ...types import Array, IntArray

EDGE = 0.5  # share of a bell in which it rises and falls
LONGEST = 6.0  # s: twice the longest bell; what lasts longer is a lasting cause
_USUAL, _WIDTH = 0.5, 1.3  # s, and deviation of its logarithm: most events last 0.04 to 6 s
_PASSES, _HALVINGS = 8, 3
_FARTHEST = 0.5  # durations that an event moves at once
_STEP = 0.02  # of a duration, for derivatives
_FEWEST = 3  # samples: a shorter bell is none to them
_GAINED = 0.05  # less of the cost is settled
_LAGS, _LONGER = np.linspace(-6.0, 6.0, 25), 3.0  # deviations
_LENGTHS = 9


@dataclass(frozen=True, slots=True, eq=False)
class Impulse:
    """An impulse (3,) along inertial axes [N m s] between two times.

    Args:
        start: [s]. end: [s]. value: (3,). std: (3,) its deviations. z: Size by these.
    """

    start: float
    end: float
    value: Array
    std: Array
    z: float

    @property
    def times(self) -> Array:
        """(2,) its middle, and the logarithm of its duration."""
        return np.array([0.5 * (self.start + self.end), np.log(self.end - self.start)])


class ImpulseFit:
    """Impulses at M times and what lasts, fitted together.

    Args:
        fit: Of what lasts, on a free base.
        times: (M, 2) middles [s], and logarithms of durations.
        known: Whitened bells (R, 3) by the bytes of their times, as far as there are any.
        held: Impulses at other times, which stay; sizes of these and of what lasts are free.
    """

    def __init__(
        self,
        fit: Fit,
        times: Array,
        known: Mapping[bytes, Array] | None = None,
        held: ImpulseFit | None = None,
    ) -> None:
        self._fit, self.times, self._held = fit, times, held
        self._bells = _bells_of(fit.rows, times, known or {})
        each = (self._bells[time.tobytes()] for time in times)
        if held is None:
            lasting, data = fit.tangents, fit.data
            self.columns = np.column_stack([lasting, *each])
        else:
            lasting, data = np.zeros((len(held.left), 0)), held.left
            self.columns = held.beside(np.column_stack([lasting, *each]))
        gram = self.columns.T @ self.columns
        size = np.sqrt(np.diag(gram))
        scale = 1.0 / np.where(size > 0.0, size, 1.0)
        squares, ways = np.linalg.eigh(scale[:, None] * gram * scale)
        is_seen = squares > squares[-1:] * len(squares) * np.finfo(float).eps
        self.ways = scale[:, None] * ways[:, is_seen] / np.sqrt(squares[is_seen])
        """(K, L) that make an orthonormal basis of the columns (R, K)."""
        inverse = self.ways @ self.ways.T
        values = self.coefficients(data)
        self.left: Array = data - self.columns @ values
        self.found: list[Impulse] = []
        self.covariances: list[Array] = []
        for k, (middle, duration) in enumerate(times.tolist()):
            own = lasting.shape[1] + 3 * k + np.arange(3)
            value, covariance = values[own], inverse[np.ix_(own, own)]
            z2 = float(value @ np.linalg.pinv(covariance, hermitian=True) @ value)
            self.covariances.append(covariance)
            std = np.sqrt(np.diag(covariance))
            start, end = (middle + half * math.exp(duration) for half in (-0.5, 0.5))
            self.found.append(Impulse(start, end, value, std, float(np.sqrt(max(z2, 0.0)))))

    def at(self, times: Array) -> ImpulseFit:
        """The same beside impulses at other times."""
        return ImpulseFit(self._fit, times, self._bells, self._held)

    def with_held(self, times: Array) -> ImpulseFit:
        """Others at times (M, 2) beside these, whose times stay."""
        return ImpulseFit(self._fit, times, self._bells, self)

    def coefficients(self, columns: Array) -> Array:
        """(K, C) by which the fit's columns make up what they can of others (R, C)."""
        return np.asarray(self.ways @ (self.ways.T @ (self.columns.T @ columns)))

    def beside(self, columns: Array) -> Array:
        """What is left of columns (R, C) beside all impulses and what lasts."""
        return np.asarray(columns - self.columns @ self.coefficients(columns))

    def is_within(self, time: Array) -> Array:
        """(N,) whether times (N,) are the record's."""
        first, last = self._fit.rows.motion.time[[0, -1]]
        return np.asarray((time >= first) & (time <= last))

    def gains(self, times: Array, sets: IntArray) -> Array:
        """(S,) chi-square that more impulses take: sets (S, K) of those at times (M, 2)."""
        by_axis = self.beside(bells(self._fit.rows, times)).reshape(-1, 3, len(times))
        columns = by_axis.transpose(0, 2, 1).reshape(len(by_axis), -1)
        own = (3 * sets[:, :, None] + np.arange(3)).reshape(len(sets), -1)
        num = (columns.T @ self.left)[own]
        square = columns.T @ columns
        den = np.linalg.pinv(square[own[:, :, None], own[:, None, :]], hermitian=True)
        return np.asarray(np.einsum('sa,sab,sb->s', num, den, num))

    def refined(self) -> ImpulseFit:
        """With sizes and times fitted together (Gauss and Newton)."""
        fit = self
        for _ in range(_PASSES if len(self.times) else 0):
            step = fit._step()
            for k in range(_HALVINGS):
                trial = fit.at(fit.times + 0.5**k * step)
                gained = fit.cost - trial.cost
                if gained > 0.0:
                    break
            else:
                return fit
            fit = trial
            if gained < _GAINED:
                break
        return fit

    def middle_std(self, k: int) -> float:
        """Standard deviation of a middle [s], over all its times that are nearly as likely.

        Two bells of other lengths may do as well as one another, so that curvature is too little.
        Starts and ends are likely alike at all times, so that lengths are, up to `LONGEST`: by the
        lengths that are usual a long one passed for a short one, whose middle is known better.
        Asked at deviations of the middle, in durations, and of the logarithm of these.
        """
        shift, longer = self._time_stds[:, k].tolist()
        others = self.at(np.delete(self.times, k, axis=0))
        middle, duration = self.times[k].tolist()
        lags = shift * math.exp(duration) * _LAGS
        costs = []
        reach = _LONGER * longer
        shortest = max(duration - reach, self._shortest)
        for log in np.linspace(shortest, min(duration + reach, math.log(LONGEST)), _LENGTHS):
            times = np.column_stack([middle + lags, np.full(len(lags), log)])
            gain = others.gains(times, np.arange(len(lags))[:, None])
            costs.append(-2.0 * log - gain)
        weights = np.exp(-0.5 * (np.array(costs) - np.min(costs)))
        return math.sqrt(float(np.sum(weights * lags**2) / np.sum(weights)))

    @property
    def _shortest(self) -> float:
        """Logarithm of the shortest duration [s]."""
        return math.log(_FEWEST * float(np.median(np.diff(self._fit.rows.motion.time))))

    @cached_property
    def cost(self) -> float:
        """Minus twice the log posterior."""
        held = [] if self._held is None else [self._held.times]
        beyond = (np.concatenate([self.times, *held])[:, 1] - np.log(_USUAL)) / _WIDTH
        return float(self.left @ self.left + np.sum(beyond**2))

    @cached_property
    def _time_stds(self) -> Array:
        """(2, M) deviations of middles, in durations, and of logarithms of these."""
        return np.sqrt(np.diag(np.linalg.inv(self._by_times()[1]))).reshape(2, -1)

    def _step(self) -> Array:
        """(M, 2) towards the best times, sizes free beside them."""
        (columns, matrix), times = self._by_times(), self.times
        beyond = (times - np.log(_USUAL)) * np.array([0.0, _WIDTH**-2.0])
        step = np.linalg.solve(matrix, columns.T @ self.left - beyond.T.ravel())
        middle, longer = np.clip(step, -_FARTHEST, _FARTHEST).reshape(2, -1)
        longer = np.clip(times[:, 1] + longer, self._shortest, np.log(LONGEST)) - times[:, 1]
        ends = self._fit.rows.motion.time[[0, -1]]
        ahead = np.clip(times[:, 0] + middle * np.exp(times[:, 1]), *ends)
        return np.column_stack([ahead - times[:, 0], longer])

    def _by_times(self) -> tuple[Array, Array]:
        """(R, 2 M) rows by middles, in durations, and by logarithms of these; their information.

        Sizes of all are free beside them.
        """
        changes, values = [], np.reshape([i.value for i in self.found], (-1, 3))
        times, rows = self.times, self._fit.rows
        length = np.exp(times[:, 1:])
        for one in (np.append(length, 0.0 * length, axis=1), np.array([0.0, 1.0])):
            change = _forces(rows, times + _STEP * one) - _forces(rows, times - _STEP * one)
            change = change.reshape(*change.shape[:2], 3, len(times)) / (2.0 * _STEP)
            changes.append(np.einsum('nfak,ka->nfk', change, values))
        columns = rows.whitened(np.concatenate(changes, axis=2), {})
        if self._held is not None:
            columns = self._held.beside(columns)
        columns = self.beside(columns)
        prior = np.diag(np.repeat([1.0, _WIDTH**-2.0], len(times)))
        return columns, columns.T @ columns + prior


def _bells_of(rows: Rows, times: Array, known: Mapping[bytes, Array]) -> dict[bytes, Array]:
    """Whitened bells (R, 3) by the bytes of their times, those that are known as they are."""
    new = np.array([t for t in times if t.tobytes() not in known]).reshape(-1, 2)
    made = bells(rows, new).reshape(-1, 3, len(new)) if len(new) else np.empty((0, 3, 0))
    here = {**known, **{t.tobytes(): made[:, :, i] for i, t in enumerate(new)}}
    return {key: here[key] for key in (t.tobytes() for t in times)}


def bells(rows: Rows, times: Array) -> Array:
    """(R, 3 M) whitened columns of unit impulses along inertial axes at times (M, 2)."""
    return rows.whitened(_forces(rows, times), {})


def _forces(rows: Rows, times: Array) -> Array:
    """(N, 6 + n, 3 M) of unit impulses along inertial axes, at M times each.

    Of the sampled bell, which may be hardly longer than the samples are apart.
    """
    time, rotation = rows.motion.time, rows.motion.rotation
    shapes = pulse_shape((time[:, None] - times[:, 0]) / np.exp(times[:, 1]) + 0.5, EDGE)
    shapes /= np.maximum(np.gradient(time) @ shapes, 1e-300)
    out = np.zeros((len(shapes), 6 + rows.robot.n_joints, 3 * len(times)))
    torque = np.einsum('nab,nk->nbak', rotation, shapes)
    out[:, 3:6] = torque.reshape(len(shapes), 3, -1)
    return out
