"""Steps of a free base's angular momentum in what the torque-driven filter predicts.

The filter predicts every sample from the measured joint torques, so a torque from outside on the
base shows in the innovations for the few seconds in which the state is found again. What lasts
(wheels, bodies, biases) is fitted before: beside it a bell is short. The part that is linear would
show in translations alone, which nobody measures. A product of a template with any rows is one of
its shape with what one pass backwards through the filter makes of these rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ...effects.surroundings.external import pulse_shape
from ...estimation.fit import Fit
from ...types import Array
from ..limits import QUIET
from .matched import Filtered, MatchedFilter, Projection
from .transient import BASE, Shapes, Transient

DURATIONS = (0.05, 0.3, 1.0, 3.0)
"""Of the bells [s]; a record shorter than one is not asked for it."""
LONGEST = 6.0  # s: twice the longest bell; what lasts longer is a lasting cause
EDGE = 0.5  # share of a bell in which it rises and falls
_END, _SETTLED = 0.3, 1.5  # s before the end, and in which the filter still finds its state
_FEWEST = 3  # samples: a shorter bell is none to them
_APART = 0.05  # durations between the middles that are asked: half of it costs 0.5 % of z
_EVERY, _LOCAL = 2.0, 13  # s between templates whose own square is taken, and their least number
_CHUNK = 50  # templates at once
_DRAWS = 12  # of white noise


class BaseTemplates:
    """Pulses on a free base, beside a fit of what lasts; see `Templates`.

    Args:
        fit: The fit.
    """

    runs, shows = 1, LONGEST

    def __init__(self, fit: Fit) -> None:
        self.rows, self.time = fit.rows, fit.rows.motion.time
        self.joints: Sequence[int] = (BASE,)
        self.edges: tuple[float, ...] = (EDGE,)
        self.seconds = float(self.time[-1] - self.time[0])
        self._step = float(np.median(np.diff(self.time)))
        self.durations: tuple[float, ...] = tuple(
            d for d in DURATIONS if d < self.seconds - _SETTLED - _END
        )
        self.bounds = _FEWEST * self._step, LONGEST
        self.lasting, self.data = fit.tangents, fit.data
        self.projection = Projection.of(self.lasting.T @ self.lasting, self.lasting.T @ self.data)
        self._along = self.correlated(self.data[:, None])
        self._beside = self.correlated(self.lasting)
        self._columns: dict[tuple[float, float], Array] = {}
        self._correlations: dict[tuple[float, float], Array] = {}
        self._white: dict[float, tuple[float, float]] = {}
        self._squares: dict[tuple[float, int], Array] = {}

    def bells(self, run: int, duration: float) -> Shapes:
        """See `Templates`."""
        first, last = self.time[[0, -1]] + np.array([_SETTLED, -_END])
        step = max(_APART * duration, self._step)
        return Shapes.bells(np.arange(first, last, step), duration)

    def about(self, found: Sequence[Transient]) -> BaseTemplates:
        """The same: its noise is known."""
        return self

    def white(self, duration: float) -> tuple[float, float]:
        """By draws: where little is noise z of one time is nearly that of the next."""
        if duration not in self._white:
            self._white[duration] = self._drawn(duration)
        return self._white[duration]

    def _drawn(self, duration: float) -> tuple[float, float]:
        draws, correlated = self._draws
        shapes = self.bells(0, duration)
        f = MatchedFilter(self, ()).test(BASE, 0, shapes)
        coefficients = self.projection.solved(self.lasting.T @ draws)
        num = self.products(shapes, correlated)
        num -= np.tensordot(coefficients.T, self.products(shapes, self._beside), 1)
        z2 = np.einsum('wma,mab,wmb->wm', num, f.covariance, num)[:, f.z > 0.0]
        if not z2.size:
            return 0.0, np.inf
        logs = 0.5 * np.log(np.quantile(z2, QUIET, axis=1))
        return float(np.mean(logs)), float(np.std(logs))

    @cached_property
    def _draws(self) -> tuple[Array, Array]:
        draws = np.random.default_rng(_DRAWS).standard_normal((len(self.data), _DRAWS))
        return draws, self.correlated(draws)

    def column(self, p: Transient) -> Array:
        """See `Templates`."""
        key = p.start, p.end
        if key not in self._columns:
            self._columns[key] = self.whitened(Shapes.of(p))[:, :, 0]
        return self._columns[key]

    def _correlated(self, p: Transient) -> Array:
        key = p.start, p.end
        if key not in self._correlations:
            self._correlations[key] = self.correlated(self.column(p))
        return self._correlations[key]

    def test(self, beside: MatchedFilter, joint: int, run: int, shapes: Shapes) -> Filtered:
        """See `Templates`; nothing is said where the filter finds its state, or at the end."""
        every = np.concatenate([self._beside, *map(self._correlated, beside.found)])
        cross, along = self.products(shapes, every), self.products(shapes, self._along)
        found = beside.projection.filtered(cross, along[0], self.squares(shapes))
        off = shapes.centre - self.time[0] < _SETTLED
        found.z[off | (shapes.centre > self.time[-1] - _END)] = 0.0
        return found

    def correlated(self, columns: Array) -> Array:
        """(C, N, 3) torques along inertial axes that rows (R, C) want."""
        out = np.zeros((columns.shape[1], len(self.time), 3))
        for own, column in zip(out, columns.T, strict=True):
            wanted = self.rows.force_correlation(column)[:, 3:6]
            own[:] = np.einsum('nab,nb->na', self.rows.motion.rotation, wanted)
        return out

    def whitened(self, shapes: Shapes) -> Array:
        """(R, 3, M) columns of unit impulses along inertial axes."""
        forces = np.zeros((len(self.time), 6 + self.rows.robot.n_joints, 3 * len(shapes)))
        pulses = self._sampled(self.time, np.gradient(self.time), shapes)
        torque = np.einsum('nab,nm->nbam', self.rows.motion.rotation, pulses)
        forces[:, 3:6] = torque.reshape(len(self.time), 3, -1)
        white = self.rows.whitened(forces, {})
        return np.asarray(white.reshape(len(white), 3, -1))

    def products(self, shapes: Shapes, correlated: Array) -> Array:
        """(C, M, 3) of templates with rows by their correlations (C, N, 3)."""
        out = np.empty((len(correlated), len(shapes), 3))
        for first in range(0, len(shapes), _CHUNK):
            some = shapes[first : first + _CHUNK]
            ends = np.searchsorted(self.time, [np.min(some.start), np.max(some.end)])
            near = slice(max(ends[0] - 1, 0), ends[1] + 1)
            sampled = self._sampled(self.time[near], np.gradient(self.time)[near], some)
            product = np.tensordot(correlated[:, near], sampled, (1, 0))
            out[:, first : first + _CHUNK] = product.transpose(0, 2, 1)
        return out

    def squares(self, shapes: Shapes) -> Array:
        """(M, 3, 3) of templates by themselves, between some middles."""
        out = np.empty((len(shapes), 3, 3))
        for duration in np.unique(shapes.duration):
            own = shapes.duration == duration
            at = shapes.centre[own]
            count = max(int(np.ptp(at) / _EVERY), min(len(at), _LOCAL))
            some = np.linspace(np.min(at), np.max(at), count)
            key = float(duration), hash(some.tobytes())
            if key not in self._squares:
                white = self.whitened(Shapes.bells(some, duration))
                self._squares[key] = np.einsum('ram,rbm->mab', white, white).reshape(-1, 9)
            parts = [np.interp(at, some, x) for x in self._squares[key].T]
            out[own] = np.column_stack(parts).reshape(-1, 3, 3)
        return out

    @staticmethod
    def _sampled(time: Array, weight: Array, shapes: Shapes) -> Array:
        """(N, M) of unit impulse as sampled: some are hardly longer than samples are apart."""
        phase = (time[:, None] - shapes.centre) / shapes.duration + 0.5
        values = pulse_shape(phase, EDGE)
        return np.asarray(values / np.maximum(weight @ values, 1e-300))
