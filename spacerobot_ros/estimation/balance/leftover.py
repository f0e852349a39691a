r"""What no cause explains of a joint's torque: its level against frequency, estimated along.

    d = white + OU(0.3 s) + OU(1.5 s) + OU(8 s) + OU(30 s) sign(q') + OU(30 s) tau
        + OU(30 s) late + OU(0.1 s) unsure

with OU an Ornstein-Uhlenbeck process (Gaussian, correlation exp(-|t|/T)): those with sign(q') and
tau are friction whose level drifts and a gain that drifts; the last two are dry friction that is
late wherever the joint turns round, and of any size there and beside rests: a joint that sticks
while it turns is later than its smooth motion says. A Kalman filter whitens torques and columns
alike, its gains do not depend on them, and rows that are missing are passed over. White noise of
a sensor is the special case in which only the first of the eight variances is there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...dynamics.compiling import compiled, inner
from ...types import Array, IntArray

TIMES = np.array([0.3, 1.5, 8.0, 30.0, 30.0, 30.0, 0.1])  # s
VARIANCES = len(TIMES) + 1
_USUAL = 6  # of them are of what is there all along
_NO_SHAPE = 1e-6  # rms of what a joint without turns and rests has near them


class KalmanGains(NamedTuple):
    """By which rows are whitened: no value of any row decides them.

    Args:
        every: (M,) variances of innovations.
        gain: (M, P) of the processes.
        observed: (M, P - 3) how they are seen; see `JointRows`.
        gap: (M,) time since the row before [s].
        times: (P,) of the processes [s].
    """

    every: Array
    gain: Array
    observed: Array
    gap: Array
    times: Array

    @classmethod
    def of(cls, observed: Array, gap: Array, variances: Array) -> KalmanGains:
        """Of rows by variances (8,), or (6,) without late and unsure friction."""
        times = TIMES[: len(variances) - 1]
        seen = np.ascontiguousarray(observed[:, : len(times) - 3])
        every, gain = _gains(seen, gap, variances, times)
        return cls(every, gain, seen, gap, times)

    def rows(self, some: slice) -> KalmanGains:
        """Of rows that follow each other, for what is zero before them."""
        every, gain, observed, gap, times = self
        return KalmanGains(every[some], gain[some], observed[some], gap[some], times)

    def whitened(self, values: Array) -> Array:
        """(M, C) of values of the rows."""
        return np.asarray(_innovations(np.ascontiguousarray(values), *self))

    def slopes(self, vectors: Array) -> tuple[Array, Array]:
        """See `_slopes`, of vectors (M, C) that were whitened."""
        out: tuple[Array, Array] = _slopes(np.ascontiguousarray(vectors), *self)
        return out

    def products(self, vector: Array) -> Array:
        """(M, 8) of V_i times a vector (M,), for V_i the part of a unit variance."""
        return np.asarray(_products(vector, self.observed, self.gap, self.times))


@dataclass(frozen=True, slots=True, eq=False)
class JointRows:
    """Rows of one joint, of all recordings one after another.

    Args:
        torque: (M,) that the model misses, in the band [N m].
        columns: (M, K) of the candidates [N m].
        observed: (M, 4) sign of the rate, the torque that the model needs by its own rms, and of
            unit rms the shapes of late and of unsure friction; without these (M, 2).
        block: (M,) number of the block of rows, not decreasing.
        gap: (M,) time since the row before [s]; 0 at the first of a recording, each of which is
            filtered for itself. Blocks are not: the slow part of what is left goes on in the next.
    """

    torque: Array
    columns: Array
    observed: Array
    block: IntArray
    gap: Array

    def whitened(self, variances: Array) -> tuple[Array, Array, float]:
        """(M,) torques and (M, K) columns, and the log determinant of their covariance.

        Args:
            variances: (8,) of the white part and the processes; (6,) without the last two
                [N^2 m^2].
        """
        gains = KalmanGains.of(self.observed, self.gap, variances)
        both = gains.whitened(np.column_stack([self.torque, self.columns]))
        return both[:, 0], both[:, 1:], float(np.sum(np.log(gains.every)))

    def over(self, sizes: Array) -> JointRows:
        """Rows by the sizes (M,) of their noise: what drifts keeps its own."""
        torque, by = self.torque / sizes, sizes[:, None]
        return JointRows(torque, self.columns / by, self.observed / by, self.block, self.gap)

    def rms(self, variances: Array) -> Array:
        """(M,) of the leftover of every row, more where friction is unsure [N m]."""
        usual, unsure = variances[:_USUAL], variances[_USUAL:]
        turning = self.observed[:, _USUAL - 4 :][:, : len(unsure)]
        return np.sqrt(np.sum(usual) + turning**2 @ unsure)


def shape_sizes(shapes: Array) -> Array:
    """(2,) rms of what friction leaves (M, 2) near turns and rests, see `JointRows`."""
    if not len(shapes):
        return np.ones(2)
    return np.maximum(np.sqrt(np.mean(shapes**2, axis=0)), _NO_SHAPE)


@inner
def _predict(cov: Array, kept: Array, fresh: Array) -> None:
    """To the next row; of the covariance the lower triangle is kept."""
    for i in range(len(fresh)):
        for j in range(i + 1):
            cov[i, j] *= kept[i, j]
        cov[i, i] += fresh[i]


@inner
def _update(cov: Array, h: Array, white: float, gain: Array) -> float:
    """Gain (7,) of a row, put into `gain`, and the variance of its innovation."""
    variance = white
    for i in range(len(h)):
        gain[i] = 0.0
        for j in range(len(h)):
            gain[i] += cov[max(i, j), min(i, j)] * h[j]
        variance += h[i] * gain[i]
    for i in range(len(h)):
        share = gain[i] / variance
        for j in range(i + 1):
            cov[i, j] -= share * gain[j]
    for i in range(len(h)):
        gain[i] /= variance
    return variance


@compiled
def _gains(observed: Array, gap: Array, variances: Array, times: Array) -> tuple[Array, Array]:
    """Variances (M,) of innovations and gains (M, P).

    Each recording starts as if it always was.
    """
    rows, count = len(gap), len(times)
    every, gains, cov = np.empty(rows), np.empty((rows, count)), np.zeros((count, count))
    decay, kept, fresh = np.zeros(count), np.zeros((count, count)), variances[1:].copy()
    h, last = np.ones(count), 0.0
    for k in range(rows):
        if gap[k] != last:  # most rows follow each other alike
            last = gap[k]
            _kept(last, times, decay)
            for i in range(count):
                fresh[i] = variances[1 + i] * (1.0 - decay[i] ** 2)
                for j in range(i + 1):
                    kept[i, j] = decay[i] * decay[j]
        _predict(cov, kept, fresh)
        h[3:] = observed[k]
        every[k] = _update(cov, h, variances[0], gains[k])
    return every, gains


@compiled
def _innovations(
    values: Array, every: Array, gains: Array, observed: Array, gap: Array, times: Array
) -> Array:
    """Innovations (M, C) of values by their standard deviations; see `KalmanGains`."""
    (rows, width), count = values.shape, len(times)
    out, state = values.copy(), np.zeros((count, width))
    decay, h, last = np.zeros(count), np.ones(count), 0.0
    for k in range(rows):
        if gap[k] != last:
            last = gap[k]
            _kept(last, times, decay)
        h[3:] = observed[k]
        left, scale = out[k], 1.0 / np.sqrt(every[k])
        for i in range(count):
            own, share = state[i], h[i] * decay[i]
            for c in range(width):
                left[c] -= share * own[c]
        for i in range(count):
            own, share, by = state[i], gains[k, i], decay[i]
            for c in range(width):
                own[c] = by * own[c] + share * left[c]
        for c in range(width):
            left[c] *= scale
    return out


@inner
def _kept(gap: float, times: Array, decay: Array) -> None:
    """Share (P,) of every process that is left after a gap, put into `decay`."""
    for i in range(len(times)):
        decay[i] = np.exp(-gap / times[i]) if gap > 0.0 else 0.0


@inner
def _smoothed(to: Array, cov: Array, gain: Array, own: Array, through: Array) -> float:
    """U = v / F - G' r, put into `own` for v / F, and what G' cov G adds to its variance."""
    added = 0.0
    for i in range(len(gain)):
        through[i] = 0.0
        for c in range(len(own)):
            own[c] -= gain[i] * to[i, c]
        for j in range(len(gain)):
            through[i] += cov[i, j] * gain[j]
        added += gain[i] * through[i]
    return added


@inner
def _back(to: Array, own: Array, here: float, by: float) -> float:
    """Sum of squares of r + h u of one process, put into `to` as the row before has it."""
    square = 0.0
    for c in range(len(own)):
        there = to[c] + here * own[c]
        square += there * there
        to[c] = by * there
    return square


@compiled
def _slopes(
    white: Array, every: Array, gains: Array, observed: Array, gap: Array, times: Array
) -> tuple[Array, Array]:
    r"""(8,) of tr(V^-1 V_i) - sum_c a_c' V^-1 V_i V^-1 a_c, for V_i the part of a unit variance.

    Beside them V^-1 a (M,) of the last of the vectors.

    One pass backwards (Koopman and Shephard, Biometrika 79 (1992)), from r = 0 on, and likewise
    for covariances: with u = V^-1 a, v the innovations, F their variances, D the decay,

        u = v / F - G' r,   r <- D (r + h u).

    With gains and innovations 0.8 ms for 500 rows and 50 columns; nine of these alone, for
    quotients, 2.7 ms.

    Args:
        white: (M, C) all a_c, whitened: v / sqrt(F).
        every: See `KalmanGains`, as all that follows.
        gains: (M, P).
        observed: (M, P - 3).
        gap: (M,) [s].
        times: (P,) [s].
    """
    (rows, width), count = white.shape, len(times)
    out, h, decay, last = np.zeros(1 + count), np.ones(count), np.zeros(count), 0.0
    to, cov, through = np.zeros((count, width)), np.zeros((count, count)), np.empty(count)
    inverse = np.empty(rows)
    for k in range(rows - 1, -1, -1):
        h[3:] = observed[k]
        own = white[k] / np.sqrt(every[k])
        spread = 1.0 / every[k] + _smoothed(to, cov, gains[k], own, through)
        inverse[k] = own[-1]
        out[0] += spread - np.sum(own * own)
        if gap[k] != last:
            last = gap[k]
            _kept(last, times, decay)
        for i in range(count):
            square, here, by = _back(to[i], own, h[i], decay[i]), h[i], decay[i]
            for j in range(count):
                cov[i, j] += spread * here * h[j] - here * through[j] - through[i] * h[j]
            out[1 + i] += (1.0 - by**2) * (cov[i, i] - square)
            for j in range(count):
                cov[i, j] *= by * decay[j]
    return out, inverse


@compiled
def _products(vector: Array, observed: Array, gap: Array, times: Array) -> Array:
    """(M, 8) of V_i times a vector (M,), for V_i the part of a unit variance; see `_slopes`."""
    rows, count = len(vector), len(times)
    out, h, own = np.zeros((rows, 1 + count)), np.ones(count), np.zeros(count)
    decay, last = np.zeros(count), 0.0
    out[:, 0] = vector
    for k in range(rows):
        if gap[k] != last:
            last = gap[k]
            _kept(last, times, decay)
        h[3:] = observed[k]
        for i in range(count):
            own[i] = decay[i] * own[i] + h[i] * vector[k]
            out[k, 1 + i] = own[i]
    own[:] = 0.0
    for k in range(rows - 1, -1, -1):
        h[3:] = observed[k]
        if gap[k] != last:
            last = gap[k]
            _kept(last, times, decay)
        for i in range(count):
            out[k, 1 + i] = h[i] * (out[k, 1 + i] + own[i])
            own[i] = decay[i] * (own[i] + h[i] * vector[k])
    return out
