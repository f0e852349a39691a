r"""What no cause explains of a joint's torque: its level against frequency, estimated along.

    d = white + OU(0.3 s) + OU(1.5 s) + OU(8 s) + OU(30 s) sign(q') + OU(30 s) tau
        + OU(30 s) late + OU(0.1 s) unsure

with OU an Ornstein-Uhlenbeck process (Gaussian, correlation exp(-|t|/T)): those with sign(q') and
tau are friction whose level drifts and a gain that drifts; the last two are dry friction that is
late wherever the joint turns round, and of any size there and beside rests: a joint that sticks
while it turns is later than its smooth motion says. A Kalman filter whitens torques and columns
alike, its gains do not depend on them, and rows that are missing are passed over. The eight
variances are those of the restricted likelihood (REML; Patterson and Thompson, Biometrika 58
(1971)): the coefficients of all columns are integrated out under their priors. White noise of a
sensor is the special case in which only the first is there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from ...dynamics.compiling import compiled, inner
from ...types import Array, IntArray

_TIMES = np.array([0.3, 1.5, 8.0, 30.0, 30.0, 30.0, 0.1])  # s
VARIANCES = len(_TIMES) + 1
_USUAL = 6  # of them are of what is there all along
_LEAST = 1e-3  # of a torque's rms: no torque sensor is as good
_MOST = 10.0  # times a torque's rms
_RANK = 1e-6  # of the largest singular value of the columns that a joint sees
_PASSES, _NEAR = 40, 1e-2  # until slopes by logarithms of variances are less than this
_STEPS, _HALVINGS = 20, 12
_LEVEL = 1e-8  # slopes of what is settled; their rounding is 1e-12
_TURN = 1e-4  # in logarithms, for what slopes do
_FLAT = 1e-6  # of a variance: the least that a step leaves; the least curvature
_ROUNDING = 1e-12  # of a cost

Cost = Callable[[Array], tuple[float, Array]]
"""Of logarithms of variances, with its slopes."""


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
        both = np.column_stack([self.torque, self.columns])
        times = _TIMES[: len(variances) - 1]
        observed = np.ascontiguousarray(self.observed[:, : len(times) - 3])
        out, every, _ = _whiten(np.ascontiguousarray(both), observed, self.gap, variances, times)
        return out[:, 0], out[:, 1:], float(np.sum(np.log(every)))

    def rms(self, variances: Array) -> Array:
        """(M,) of the leftover of every row, more where friction is unsure [N m]."""
        usual, unsure = variances[:_USUAL], variances[_USUAL:]
        turning = self.observed[:, _USUAL - 4 :][:, : len(unsure)]
        return np.sqrt(np.sum(usual) + turning**2 @ unsure)


@inner  # type: ignore[untyped-decorator]
def _predict(cov: Array, kept: Array, fresh: Array) -> None:
    """To the next row; of the covariance the lower triangle is kept."""
    for i in range(len(fresh)):
        for j in range(i + 1):
            cov[i, j] *= kept[i, j]
        cov[i, i] += fresh[i]


@inner  # type: ignore[untyped-decorator]
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


@compiled  # type: ignore[untyped-decorator]
def _whiten(
    values: Array, observed: Array, gap: Array, variances: Array, times: Array
) -> tuple[Array, Array, Array]:
    """Innovations by their standard deviations; their variances (M,) and gains (M, P).

    Each recording starts as if it always was.
    """
    (rows, width), count = values.shape, len(times)
    out, every, gains = values.copy(), np.empty(rows), np.empty((rows, count))
    state, cov = np.zeros((count, width)), np.zeros((count, count))
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
    return out, every, gains


@inner  # type: ignore[untyped-decorator]
def _kept(gap: float, times: Array, decay: Array) -> None:
    """Share (P,) of every process that is left after a gap, put into `decay`."""
    for i in range(len(times)):
        decay[i] = np.exp(-gap / times[i]) if gap > 0.0 else 0.0


@inner  # type: ignore[untyped-decorator]
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


@inner  # type: ignore[untyped-decorator]
def _back(to: Array, own: Array, here: float, by: float) -> float:
    """Sum of squares of r + h u of one process, put into `to` as the row before has it."""
    square = 0.0
    for c in range(len(own)):
        there = to[c] + here * own[c]
        square += there * there
        to[c] = by * there
    return square


@compiled  # type: ignore[untyped-decorator]
def _slopes(
    white: Array, every: Array, gains: Array, observed: Array, gap: Array, times: Array
) -> Array:
    r"""(8,) of tr(V^-1 V_i) - sum_c a_c' V^-1 V_i V^-1 a_c, for V_i the part of a unit variance.

    One pass backwards (Koopman and Shephard, Biometrika 79 (1992)), from r = 0 on, and likewise
    for covariances: with u = V^-1 a, v the innovations, F their variances, D the decay,

        u = v / F - G' r,   r <- D (r + h u).

    With `_whiten` 0.8 ms for 500 rows and 50 columns; nine of that alone, for quotients, 2.7 ms.

    Args:
        white: (M, C) all a_c, whitened: v / sqrt(F).
        every: See `_whiten`.
        gains: Likewise.
        observed: See `JointRows`.
        gap: Likewise.
        times: (P,) of the processes.
    """
    (rows, width), count = white.shape, len(times)
    out, h, decay, last = np.zeros(1 + count), np.ones(count), np.zeros(count), 0.0
    to, cov, through = np.zeros((count, width)), np.zeros((count, count)), np.empty(count)
    for k in range(rows - 1, -1, -1):
        h[3:] = observed[k]
        own = white[k] / np.sqrt(every[k])
        spread = 1.0 / every[k] + _smoothed(to, cov, gains[k], own, through)
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
    return out


def level_of(
    rows: JointRows, priors: Array, scale: float, drift: Array, held: Array | None = None
) -> Array:
    """(8,) variances of what the columns leave, by REML; (6,) without late and unsure friction.

    Args:
        rows: Of one joint.
        priors: (K,) standard deviation of every column's coefficient.
        scale: Rms of the joint's torque, in which everything is reckoned [N m].
        drift: (4,) largest standard deviations of drifting friction, a drifting gain, late and
            unsure friction [N m]; (2,) without the last two.
        held: (K, A) orthonormal directions, coefficients by their priors, that stay zero.
    """
    columns = rows.columns * (priors / scale)
    if held is not None:
        columns = columns - (columns @ held) @ held.T
    values = np.column_stack([_compressed(columns), rows.torque / scale])
    observed = np.ascontiguousarray(rows.observed[:, : len(drift)])
    most = drift / scale  # what would be less than the least white part is not there
    most[np.sqrt(np.mean(observed**2, axis=0)) * most < _LEAST] = 0.0
    count = 3 + len(drift)
    low = 2.0 * np.log(np.array([_LEAST, *[0.1 * _LEAST] * count]))
    high = 2.0 * np.log(np.maximum(np.array([*[_MOST] * 4, *most]), 1e-300))
    high = np.maximum(high, low + 1e-3)
    start = np.clip(2.0 * np.log(np.array([*[0.03] * 4, *[0.01] * len(drift)])), low, high)
    cost = partial(_cost, values, observed, rows.gap)
    found = minimize(
        cost,
        start,
        method='L-BFGS-B',
        jac=True,
        bounds=list(zip(low, high, strict=True)),
        options={'maxiter': _PASSES, 'ftol': 0.0, 'gtol': _NEAR},
    )
    return scale**2 * np.exp(_settled(cost, found.x, low, high))


def _settled(cost: Cost, x: Array, low: Array, high: Array) -> Array:
    """The lowest point near one that is nearly so, within bounds: Newton's, of variances.

    Slopes tell it to rounding, costs to the root of that alone. By variances, the slope towards
    one that is not there is straight, so that a step goes to its bound.
    """
    now, slope = cost(x)
    for _ in range(_STEPS):
        free = np.flatnonzero(~((x <= low) & (slope > 0.0) | (x >= high) & (slope < 0.0)))
        if not np.any(np.abs(slope[free]) > _LEVEL):
            break
        turns = [cost(x + d)[1] - slope for d in _TURN * np.eye(len(x))[free]]
        matrix = np.array(turns)[:, free] / _TURN - np.diag(slope[free])
        values, ways = np.linalg.eigh(0.5 * (matrix + matrix.T))
        step = np.zeros(len(x))
        step[free] = -ways @ (ways.T @ slope[free] / np.maximum(np.abs(values), _FLAT))
        for share in 0.5 ** np.arange(_HALVINGS):
            ahead = np.clip(x + np.log(np.clip(1.0 + share * step, _FLAT, 1.0 / _FLAT)), low, high)
            then, slope_there = cost(ahead)
            if then < now + _ROUNDING * abs(now):
                break
        else:
            break
        x, now, slope = ahead, then, slope_there
    return x


def _compressed(columns: Array) -> Array:
    """(M, r) with the same Gram matrix over rows: what coefficients of unit prior can make."""
    columns = columns[:, np.any(columns != 0.0, axis=0)]
    if not columns.size:
        return columns
    values, vectors = np.linalg.eigh(columns.T @ columns)
    return np.asarray(columns @ vectors[:, values > _RANK**2 * values[-1]])


def _cost(values: Array, observed: Array, gap: Array, x: Array) -> tuple[float, Array]:
    """Minus twice the restricted log likelihood, but for a constant, and its slopes (8,).

    Args:
        values: (M, r + 1) columns of unit prior, then the torque.
        observed: See `JointRows`.
        gap: Likewise.
        x: (8,) logarithms of the variances by which they are whitened.
    """
    variances, times = np.exp(x), _TIMES[: len(x) - 1]
    white, every, gains = _whiten(values, observed, gap, variances, times)
    columns, torque = white[:, :-1], white[:, -1]
    factor = np.linalg.cholesky(np.eye(columns.shape[1]) + columns.T @ columns)
    own = solve_triangular(factor, columns.T, lower=True, check_finite=False)  # (r, M)
    left = torque - own.T @ (own @ torque)
    cost = float(torque @ left) + float(np.sum(np.log(every)))
    cost += 2.0 * float(np.sum(np.log(np.diag(factor))))
    both = np.ascontiguousarray(np.vstack([own, left]).T)
    return cost, variances * _slopes(both, every, gains, observed, gap, times)
