r"""How far one more step of the angular momentum stands out, at all times: a matched filter.

With h the whitened column of a bell of unit impulse along each inertial axis, r what a fit leaves
and B its columns, orthonormal,

    num = h' r,  den = h' h - h' B B' h  (3 x 3),  z^2 = num' den^-1 num.

h' of any column is one pass backwards through the filter. It is linear, so that of r comes from
that of the data and of the columns; h' h hardly changes along a record and is taken at some times.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import convolve1d

from ...effects.surroundings.external import pulse_shape
from ...estimation.fit import Fit
from ...types import Array
from .impulse_fit import EDGE, ImpulseFit, bells

DURATIONS = (0.05, 0.3, 1.0, 3.0)
"""Of the bells [s]; a record shorter than one is not asked for it."""
TAIL = 0.05  # s after an event in which nothing is used
_END = 0.3  # s before the end of a record in which no step is judged
_SAMPLES = 16  # times at which h' h is taken
_APART = 0.05  # durations between the middles that are asked: half of it costs 0.5 % of z
_DRAWS = 12  # of white noise
_SETTLED = 1.5  # s in which the filter still finds its state
_SEEN = 0.02  # of a template's square that columns must leave for it to say anything


class ImpulseSizes:
    """z of bells of all durations at all times, beside a fit.

    Args:
        fit: Of what lasts, on a free base.

    Attributes:
        durations: [s]. middles: (G,) by duration [s].
    """

    def __init__(self, fit: Fit) -> None:
        self._rows = fit.rows
        self._time = time = fit.rows.motion.time
        self._step = float(np.median(np.diff(time)))
        self._grid = np.arange(time[0], time[-1], self._step)
        searched = float(time[-1] - time[0]) - _SETTLED - _END
        self.durations = tuple(d for d in DURATIONS if d < searched)
        self._starts = {d: np.arange(0, len(self._grid), self._stride(d)) for d in self.durations}
        self.middles = {
            d: self._grid[s] + 0.5 * (self._stride(d) - 1) * self._step
            for d, s in self._starts.items()
        }
        self._squares = {d: self._between(d, self.square(d)) for d in self.durations}
        self._least = {d: np.linalg.eigvalsh(den)[:, 0] for d, den in self._squares.items()}
        white = np.random.default_rng(_DRAWS).standard_normal((len(fit.data), _DRAWS))
        self._records = np.column_stack([fit.data, white])
        self._correlated = self._correlations(self._records)
        self._lasting = self._correlations(fit.tangents)
        self._known: dict[bytes, Array] = {}  # correlations of the bells of the last fit, by times

    def _stride(self, duration: float) -> int:
        """Times of the grid in one that is asked."""
        return max(1, int(_APART * duration / self._step))

    def beside(self, best: ImpulseFit, *, with_noise: bool = False) -> dict[float, Array]:
        """(W, G) by duration: z beside a fit of the data, and of draws of white noise instead.

        0 at times of known impulses, and where nothing is said.
        """
        columns = self._of_columns(best)
        count = 1 + with_noise * _DRAWS
        share = best.coefficients(self._records[:, :count])
        wanted = self._correlated[:count] - np.tensordot(share.T, columns, 1)
        taken = np.tensordot(best.ways.T, columns, 1)
        return {d: self._sizes(wanted, taken, d, best) for d in self.durations}

    def square(self, duration: float, beside: Array | None = None) -> Array:
        """(S, 3, 3) h' h of bells at some times, beside columns (R, K) that take their share."""
        middles = self._sampled + 0.5 * duration
        times = np.column_stack([middles, np.full(_SAMPLES, np.log(duration))])
        columns = bells(self._rows, times)
        if beside is not None:
            basis = np.linalg.qr(beside)[0]
            columns -= basis @ (basis.T @ columns)
        blocks = columns.reshape(len(columns), 3, -1)
        return np.einsum('ras,rbs->sab', blocks, blocks)

    def _between(self, duration: float, squares: Array) -> Array:
        """(G, 3, 3) h' h at all middles, of (S, 3, 3) at some."""
        at = self._sampled + 0.5 * duration
        columns = [np.interp(self.middles[duration], at, x) for x in squares.reshape(-1, 9).T]
        return np.column_stack(columns).reshape(-1, 3, 3)

    @property
    def _sampled(self) -> Array:
        first = self._time[0] + _SETTLED
        last = self._time[-1] - _SETTLED - max(self.durations)
        return np.linspace(first, max(first, last), _SAMPLES)

    def _of_columns(self, best: ImpulseFit) -> Array:
        """(K, T, 3) correlations of a fit's columns."""
        first = len(self._lasting)
        bells_of = {
            time.tobytes(): slice(first + 3 * k, first + 3 * k + 3)
            for k, time in enumerate(best.times)
        }
        self._known = {
            key: self._known[key] if key in self._known else self._correlations(best.columns[:, k])
            for key, k in bells_of.items()
        }
        return np.concatenate([self._lasting, *(self._known[t.tobytes()] for t in best.times)])

    def _correlations(self, columns: Array) -> Array:
        """(C, T, 3) torques along inertial axes that rows (R, C) want, on a regular grid."""
        which = np.searchsorted(self._grid, self._time, 'right') - 1
        out = np.zeros((columns.shape[1], len(self._grid), 3))
        for binned, column in zip(out, columns.T, strict=True):
            wanted = self._rows.force_correlation(column)[:, 3:6]
            wanted = np.einsum('nab,nb->na', self._rows.motion.rotation, wanted)
            np.add.at(binned, np.clip(which, 0, len(self._grid) - 1), wanted)
        return out

    def _sizes(self, wanted: Array, taken: Array, duration: float, best: ImpulseFit) -> Array:
        """(W, G) z by correlations (W, T, 3) of records and (L, T, 3) of a basis of columns."""
        middles = self.middles[duration]
        num = self._smooth(wanted, duration).transpose(1, 2, 0)
        shares = self._smooth(taken, duration)
        left = self._squares[duration] - np.einsum('lga,lgb->gab', shares, shares)
        seen = np.linalg.eigvalsh(left)[:, 0] > _SEEN * self._least[duration]
        left[~seen] = np.eye(3)
        z = np.sqrt(np.maximum(np.sum(np.linalg.solve(left, num) * num, axis=1), 0.0)).T
        unseen = (middles < self._time[0] + _SETTLED) | (middles > self._time[-1] - _END)
        for found in best.found:
            unseen |= (middles > found.start - TAIL) & (middles < found.end + TAIL)
        return np.where(seen & ~unseen, z, 0.0)

    def _smooth(self, binned: Array, duration: float) -> Array:
        """(C, G, 3) correlations with bells, of those with samples (C, T, 3)."""
        step = self._stride(duration) * self._step
        count = max(1, round(duration / step)) | 1  # so that the middle is one of them
        bell = pulse_shape((np.arange(count) + 0.5) / count, EDGE)
        bell /= np.sum(bell) * step
        cells = np.add.reduceat(binned, self._starts[duration], axis=1)
        return np.asarray(convolve1d(cells, bell, axis=1, mode='constant'))
