"""The filter's recursions, compiled: covariance once, then any number of columns through it.

Measurement noise is independent from row to row, so rows are processed one by one: each is a
scalar update, and its whitened innovation belongs to one channel.
"""

from __future__ import annotations

import numba
import numpy as np

from ..types import Array, IntArray


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def covariance_pass(
    transitions: Array,
    fresh: IntArray,
    effort_variance: Array,
    first_row: IntArray,
    row_state: IntArray,
    row_variance: Array,
    start: Array,
    extra: Array,
) -> tuple[Array, Array]:
    """Gains and standard deviations of all innovations.

    Args:
        transitions: (N-1, d, d) of [positions; velocities; effort errors at both ends].
        fresh: (N-1,) effort samples by which the step's interval lies behind the last one's: 0 the
            same, 1 the next, 2 farther.
        effort_variance: (N-1, n) of the effort samples that enter with the step.
        first_row: (N + 1,) of the rows of each time.
        row_state: (R,) state that each row measures.
        row_variance: (R,) variance of each row's noise.
        start: (d, d) covariance before the first row; on return that after the last.
        extra: (N-1, d) variance added to the states in each step.

    Returns:
        Gains (R, d) and innovation standard deviations (R,).
    """
    d, n = len(start), effort_variance.shape[1]
    p = start.copy()
    gains = np.empty((len(row_state), d))
    stds = np.empty(len(row_state))
    for k in range(len(first_row) - 1):
        if k > 0:
            if fresh[k - 1] > 0:
                _enter(p, fresh[k - 1], effort_variance[k - 1], d, n)
            f = transitions[k - 1]
            p = f @ p @ f.T
            for i in range(d):
                p[i, i] += extra[k - 1, i]
                for j in range(i):
                    mean = 0.5 * (p[i, j] + p[j, i])
                    p[i, j] = mean
                    p[j, i] = mean
        for r in range(first_row[k], first_row[k + 1]):
            s = row_state[r]
            variance = p[s, s] + row_variance[r]
            stds[r] = np.sqrt(variance)
            gain = p[:, s] / variance
            gains[r] = gain
            for i in range(d):
                for j in range(d):
                    p[i, j] -= gain[i] * gain[j] * variance
    start[:] = p
    return gains, stds


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _enter(p: Array, fresh: int, variance: Array, d: int, n: int) -> None:
    """A new effort interval: its start is the last one's end, its end a new sample."""
    first, second = d - 2 * n, d - n
    for i in range(n):
        if fresh == 1:
            p[first + i, :] = p[second + i, :]
    for i in range(n):
        if fresh == 1:
            p[:, first + i] = p[:, second + i]
        else:
            p[first + i, :] = 0.0
            p[:, first + i] = 0.0
            p[first + i, first + i] = variance[i]
    for i in range(n):
        p[second + i, :] = 0.0
        p[:, second + i] = 0.0
        p[second + i, second + i] = variance[i]


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def mean_pass(
    mean: Array,
    steps: tuple[int, int],
    durations: Array,
    transitions: Array,
    fresh: IntArray,
    accelerations: Array,
    kicks: Array,
    first_row: IntArray,
    row_state: IntArray,
    gains: Array,
    stds: Array,
    measured: Array,
    n: int,
) -> Array:
    """Whitened innovations of K columns over the times steps[0] <= k < steps[1].

    Args:
        mean: (d, K) state before the prediction to the first of these times; updated in place.
        steps: First time and the one behind the last.
        durations: (N-1,) [s].
        transitions: As in `covariance_pass`.
        fresh: As in `covariance_pass`.
        accelerations: (N, m, K) accelerations of the columns at the times.
        kicks: (N-1, 2 m) change of positions and velocities by each step, of column 0 alone; empty
            where there is none.
        first_row: As in `covariance_pass`.
        row_state: As in `covariance_pass`.
        gains: From `covariance_pass`.
        stds: From `covariance_pass`.
        measured: (rows of these times, K); empty where no column changes what is measured.
        n: Number of joints.

    Returns:
        (rows, K).
    """
    d, count = mean.shape
    m = accelerations.shape[1]
    offset = first_row[steps[0]]
    out = np.empty((first_row[steps[1]] - offset, count))
    innovation = np.empty(count)
    for k in range(steps[0], steps[1]):
        if k > 0:
            half = 0.5 * durations[k - 1]
            _shift(mean, fresh[k - 1], n)
            mean[m : 2 * m] += half * accelerations[k - 1]
            mean[:] = transitions[k - 1] @ mean
            mean[m : 2 * m] += half * accelerations[k]
            if len(kicks):
                mean[: 2 * m, 0] += kicks[k - 1]
        for r in range(first_row[k], first_row[k + 1]):
            innovation[:] = -mean[row_state[r]]
            if len(measured):
                innovation += measured[r - offset]
            out[r - offset] = innovation / stds[r]
            for i in range(d):
                gain = gains[r, i]
                for c in range(count):
                    mean[i, c] += gain * innovation[c]
    return out


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _shift(mean: Array, fresh: int, n: int) -> None:
    """Means of the effort errors when a step lies in a new effort interval."""
    d = len(mean)
    if fresh == 1:
        mean[d - 2 * n : d - n] = mean[d - n :]
    elif fresh > 1:
        mean[d - 2 * n : d - n] = 0.0
    if fresh > 0:
        mean[d - n :] = 0.0


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def adjoint_pass(
    durations: Array,
    transitions: Array,
    fresh: IntArray,
    first_row: IntArray,
    row_state: IntArray,
    gains: Array,
    stds: Array,
    weights: Array,
    m: int,
    n: int,
) -> Array:
    """Transpose of `mean_pass` by accelerations: sum of weights times innovations, per push.

    Args:
        durations: As in `mean_pass`.
        transitions: As in `covariance_pass`.
        fresh: As in `covariance_pass`.
        first_row: As in `covariance_pass`.
        row_state: As in `covariance_pass`.
        gains: From `covariance_pass`.
        stds: From `covariance_pass`.
        weights: (R,) weight of every whitened innovation.
        m: Number of velocities.
        n: Number of joints.

    Returns:
        (N, m); its product with the accelerations of a column, summed over times and velocities,
        is the weighted sum of the column's whitened innovations.
    """
    d = gains.shape[1]
    count = len(first_row) - 1
    out = np.zeros((count, m))
    adjoint = np.zeros(d)
    for k in range(count - 1, -1, -1):
        for r in range(first_row[k + 1] - 1, first_row[k] - 1, -1):
            innovation = weights[r] / stds[r]
            for i in range(d):
                innovation += gains[r, i] * adjoint[i]
            adjoint[row_state[r]] -= innovation
        if k > 0:
            half = 0.5 * durations[k - 1]
            out[k] += half * adjoint[m : 2 * m]
            adjoint = transitions[k - 1].T @ adjoint
            out[k - 1] += half * adjoint[m : 2 * m]
            if fresh[k - 1] == 1:
                adjoint[d - n :] = adjoint[d - 2 * n : d - n].copy()
                adjoint[d - 2 * n : d - n] = 0.0
            elif fresh[k - 1] > 1:
                adjoint[d - 2 * n :] = 0.0
    return out
