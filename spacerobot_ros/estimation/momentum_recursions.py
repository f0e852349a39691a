"""The momentum filter's recursion over samples, compiled.

A step is a dozen small matrix products: interpreted it costs 150 us, compiled 25 us (three joints,
25 unknowns, one core). Compilation takes some seconds once a machine; the result is cached.
"""

from __future__ import annotations

import numba
import numpy as np

from ..types import Array


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def forward(
    steps: tuple[Array, Array, Array],
    rate_by_state: Array,
    drives: Array,
    measured: tuple[Array, Array, Array, Array],
    columns: tuple[Array, Array, Array, Array],
    std: Array,
    skipped: int,
    affine: Array,
    covariance: Array,
) -> tuple[Array, Array, Array]:
    """Run through M times and whiten every innovation.

    Args:
        steps: Transition (M-1, d, d), drive of the attitude error (M-1, 3, c), noise (M-1, d, d).
        rate_by_state: (M, 3, 3 + 2 n) rate error by attitude error, joint positions and rates.
        drives: (M, 3, c) rate error by 1 and the constants.
        measured: q (N, n), qd (N, n), attitude (N, 3), gyro (N, 3); a row that begins with NaN was
            not measured. The first belongs to time index `skipped`.
        columns: Derivatives of q (N, n, m), qd (N, n, m), attitude (N, 3, m) and gyro (N, 3, m) by
            the last m constants.
        std: (4,) of joint position, joint rate, attitude and gyro.
        skipped: 1 where the first time was already used, else 0.
        affine: (d, c) mean as an affine function of the constants' errors.
        covariance: (d, d).

    Returns:
        New affine mean and covariance, and the whitened affine innovations (r, c).
    """
    q, qd, attitude, gyro = measured
    n, size, d = q.shape[1], affine.shape[1], affine.shape[0]
    rows = np.empty(((2 * n + 6) * len(q), size))
    used = 0
    H, values, sigma = np.empty((2 * n + 6, d)), np.empty((2 * n + 6, size)), np.empty(2 * n + 6)
    for k in range(len(rate_by_state)):
        if k > 0:
            affine = steps[0][k - 1] @ affine
            affine[:3] += steps[1][k - 1]
            covariance = steps[0][k - 1] @ covariance @ steps[0][k - 1].T + steps[2][k - 1]
        i = k - skipped
        if i < 0:
            continue
        H[:], values[:] = 0.0, 0.0
        count = 0
        if not np.isnan(q[i, 0]):
            count = _direct(q[i], columns[0][i], 3, std[0], count, H, values, sigma)
        if not np.isnan(qd[i, 0]):
            count = _direct(qd[i], columns[1][i], 3 + n, std[1], count, H, values, sigma)
        if not np.isnan(attitude[i, 0]):
            count = _direct(attitude[i], columns[2][i], 0, std[2], count, H, values, sigma)
        if not np.isnan(gyro[i, 0]):
            first = count
            count = _direct(gyro[i], columns[3][i], -1, std[3], count, H, values, sigma)
            H[first:count, : 3 + 2 * n] = rate_by_state[k]
            values[first:count] -= drives[k]
        if count > 0:
            affine, covariance = _update(
                H[:count], values[:count], sigma[:count], affine, covariance, rows[used:]
            )
            used += count
    return affine, covariance, rows[:used].copy()


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def _direct(
    data: Array,
    by_nuisance: Array,
    first: int,
    sigma: float,
    row: int,
    H: Array,
    values: Array,
    stds: Array,
) -> int:
    """Add rows that measure the states from `first` on (none of them where it is negative)."""
    start = values.shape[1] - by_nuisance.shape[1]
    for i in range(len(data)):
        values[row + i, 0] = data[i]
        for j in range(by_nuisance.shape[1]):
            values[row + i, start + j] -= by_nuisance[i, j]
        stds[row + i] = sigma
        if first >= 0:
            H[row + i, first + i] = 1.0
    return row + len(data)


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def _update(
    H: Array, values: Array, std: Array, affine: Array, covariance: Array, rows: Array
) -> tuple[Array, Array]:
    """Kalman update by Joseph's form, which keeps the covariance positive; whitens into `rows`."""
    innovation = values - H @ affine
    gain = H @ covariance
    spread = gain @ H.T
    for i in range(len(std)):
        spread[i, i] += std[i] ** 2
    lower = np.linalg.cholesky(spread)
    rows[: len(std)] = innovation
    _solve_lower(lower, rows[: len(std)])
    _solve_lower(lower, gain)
    _solve_lower_transposed(lower, gain)
    affine = affine + gain.T @ innovation
    rest = np.eye(len(covariance)) - gain.T @ H
    scaled = gain.copy()
    for i in range(len(std)):
        scaled[i] *= std[i] ** 2
    return affine, rest @ covariance @ rest.T + gain.T @ scaled


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def _solve_lower(lower: Array, b: Array) -> None:
    """Overwrite b by lower^-1 b."""
    for i in range(len(lower)):
        for j in range(i):
            b[i] -= lower[i, j] * b[j]
        b[i] /= lower[i, i]


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def _solve_lower_transposed(lower: Array, b: Array) -> None:
    """Overwrite b by lower^-T b."""
    for i in range(len(lower) - 1, -1, -1):
        for j in range(i + 1, len(lower)):
            b[i] -= lower[j, i] * b[j]
        b[i] /= lower[i, i]
