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

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dtrtrs
from scipy.optimize import minimize

from ...dynamics.compiling import compiled, inner
from ...types import Array, IntArray

_TIMES = np.array([0.3, 1.5, 8.0, 30.0, 30.0, 30.0, 0.1])  # s
VARIANCES = len(_TIMES) + 1
_USUAL = 6  # of them are of what is there all along
_LEAST = 1e-3  # of a torque's rms: no torque sensor is as good
_MOST = 10.0  # times a torque's rms
_PASSES = 15
_RANK = 1e-6  # of the largest singular value of the columns that a joint sees


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
        out, logs = _whiten(np.ascontiguousarray(both), observed, self.gap, variances, times)
        return out[:, 0], out[:, 1:], float(logs)

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
) -> tuple[Array, float]:
    """Innovations by their standard deviations; each recording starts as if it always was."""
    (rows, width), count = values.shape, len(times)
    out = values.copy()
    state, cov = np.zeros((count, width)), np.zeros((count, count))
    decay, kept, fresh = np.zeros(count), np.zeros((count, count)), variances[1:].copy()
    h, gain = np.ones(count), np.empty(count)
    logs, last = 0.0, 0.0
    for k in range(rows):
        if gap[k] != last:  # most rows follow each other alike
            last = gap[k]
            for i in range(count):
                decay[i] = np.exp(-last / times[i]) if last > 0.0 else 0.0
                fresh[i] = variances[1 + i] * (1.0 - decay[i] ** 2)
                for j in range(i + 1):
                    kept[i, j] = decay[i] * decay[j]
        _predict(cov, kept, fresh)
        h[3:] = observed[k]
        variance = _update(cov, h, variances[0], gain)
        logs += np.log(variance)
        left, scale = out[k], 1.0 / np.sqrt(variance)
        for i in range(count):
            own, share = state[i], h[i] * decay[i]
            for c in range(width):
                left[c] -= share * own[c]
        for i in range(count):
            own, share, by = state[i], gain[i], decay[i]
            for c in range(width):
                own[c] = by * own[c] + share * left[c]
        for c in range(width):
            left[c] *= scale
    return out, logs


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
    count = 3 + len(drift)
    low = 2.0 * np.log(np.array([_LEAST, *[0.1 * _LEAST] * count]))
    high = 2.0 * np.log(np.maximum(np.array([*[_MOST] * 4, *(drift / scale)]), 1e-300))
    high = np.maximum(high, low + 1e-3)
    start = np.clip(2.0 * np.log(np.array([*[0.03] * 4, *[0.01] * len(drift)])), low, high)
    found = minimize(
        lambda x: _cost(values, observed, rows.gap, np.exp(x)),
        start,
        method='L-BFGS-B',
        bounds=list(zip(low, high, strict=True)),
        options={'maxiter': _PASSES, 'eps': 1e-3},
    )
    return scale**2 * np.exp(np.clip(found.x, low, high))


def _compressed(columns: Array) -> Array:
    """(M, r) with the same Gram matrix over rows: what coefficients of unit prior can make."""
    columns = columns[:, np.any(columns != 0.0, axis=0)]
    if not columns.size:
        return columns
    values, vectors = np.linalg.eigh(columns.T @ columns)
    return np.asarray(columns @ vectors[:, values > _RANK**2 * values[-1]])


def _cost(values: Array, observed: Array, gap: Array, variances: Array) -> float:
    """Minus twice the restricted log likelihood, but for a constant.

    Args:
        values: (M, r + 1) columns of unit prior, then the torque.
        observed: See `JointRows`.
        gap: Likewise.
        variances: By which they are whitened.
    """
    white, logs = _whiten(values, observed, gap, variances, _TIMES[: len(variances) - 1])
    gram = white.T @ white
    matrix, vector = gram[:-1, :-1], gram[:-1, -1]
    np.fill_diagonal(matrix, np.diag(matrix) + 1.0)
    factor = np.linalg.cholesky(matrix)
    part = dtrtrs(factor.T, vector, trans=1)[0] if len(vector) else vector
    logs += 2.0 * float(np.sum(np.log(np.diag(factor))))
    return float(gram[-1, -1]) - float(part @ part) + logs
