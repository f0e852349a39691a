"""Least squares on the coefficients of a B-spline, compiled: a row has a few neighbours only."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...dynamics.compiling import compiled, inner
from ...types import Array, IntArray

_RIDGE = 1e-12  # of the largest weight


class Coefficients(NamedTuple):
    """What the rows say of the spline.

    Args:
        values: (c, m).
        chi2: Sum of the squares of what is left of the values.
    """

    values: Array
    chi2: float


@compiled
def rows_of(
    time: Array, is_derivative: Array, knots: Array, degree: int
) -> tuple[IntArray, Array]:
    """The splines that are not zero at times within the knots, by de Boor's recurrence.

    Args:
        time: (N,) [s], increasing but for a few.
        is_derivative: (N,) whether their first derivatives are wanted.
        knots: (c + degree + 1,), at the ends degree + 1 times.
        degree: Of the splines.

    Returns:
        (N,) index of the first, (N, degree + 1) their values.
    """
    first, rows = np.empty(len(time), np.int64), np.zeros((len(time), degree + 1))
    at, last = degree, len(knots) - degree - 2
    for n in range(len(time)):
        t, row = time[n], rows[n]
        if t < knots[at]:  # times of another sensor
            at = degree
        while at < last and t >= knots[at + 1]:
            at += 1
        first[n], row[0] = at - degree, 1.0
        for d in range(1, degree + 1):
            is_slope = is_derivative[n] and d == degree
            for j in range(d, 0, -1):
                share = row[j - 1] / (knots[at + j] - knots[at + j - d])
                up, down = t - knots[at + j - d], knots[at + j] - t
                row[j] += share * (d if is_slope else up)
                row[j - 1] = share * (-d if is_slope else down)
    return first, rows


@compiled
def fitted(first: IntArray, rows: Array, values: Array, count: int) -> Coefficients:
    """Least-squares coefficients of values, once refined.

    A coefficient without data nearby is held near zero by a ridge far below any row's weight.

    Args:
        first: (N,) index of a row's first coefficient.
        rows: (N, width), weighted.
        values: (N, m), weighted.
        count: Number of coefficients.

    Returns:
        The solution; its numbers are NaN where no row has any weight.
    """
    width, m = rows.shape[1], values.shape[1]
    normal = np.zeros((count, width))
    found, more = np.zeros((count, m)), np.zeros((count, m))
    for n in range(len(rows)):
        for i in range(width):
            for j in range(i + 1):
                normal[first[n] + i, i - j] += rows[n, i] * rows[n, j]
            for s in range(m):
                found[first[n] + i, s] += rows[n, i] * values[n, s]
    _factor(normal)
    _solve(normal, found)
    _misfit(first, rows, values, found, more)
    _solve(normal, more)
    for i in range(count):
        for s in range(m):
            found[i, s] += more[i, s]
    return Coefficients(found, _misfit(first, rows, values, found, more))


@inner
def _misfit(first: IntArray, rows: Array, values: Array, coefficients: Array, out: Array) -> float:
    """Add the transposed rows times what is left of the values to out (c, m); its squares' sum."""
    total = 0.0
    for n in range(len(rows)):
        for s in range(values.shape[1]):
            left = values[n, s]
            for i in range(rows.shape[1]):
                left -= rows[n, i] * coefficients[first[n] + i, s]
            for i in range(rows.shape[1]):
                out[first[n] + i, s] += rows[n, i] * left
            total += left * left
    return total


@inner
def _factor(band: Array) -> None:
    """Cholesky's factor of a normal matrix in place, with a ridge; band[i, d] is entry i, i-d."""
    count, width = band.shape
    ridge = 0.0
    for i in range(count):
        ridge = max(ridge, _RIDGE * band[i, 0])
    for i in range(count):
        band[i, 0] += ridge
        for d in range(min(i, width - 1), -1, -1):
            j = i - d
            total = band[i, d]
            for k in range(max(0, i - width + 1), j):
                total -= band[i, i - k] * band[j, j - k]
            band[i, d] = np.sqrt(total) if d == 0 else total / band[j, 0]


@inner
def _solve(factor: Array, right: Array) -> None:
    """Solve with a factor from `_factor`, in place of right (c, m)."""
    count, width = factor.shape
    for s in range(right.shape[1]):
        for i in range(count):
            for d in range(1, min(i, width - 1) + 1):
                right[i, s] -= factor[i, d] * right[i - d, s]
            right[i, s] /= factor[i, 0]
        for i in range(count - 1, -1, -1):
            for d in range(1, min(count - 1 - i, width - 1) + 1):
                right[i, s] -= factor[i + d, d] * right[i + d, s]
            right[i, s] /= factor[i, 0]
