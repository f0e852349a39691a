"""What the neighbours of a sample say that it is.

Cubics through them, five disjoint or one-sided ways: the median of the five standardized errors is
not moved by a neighbour that is bad itself.
"""

from __future__ import annotations

import numpy as np

from ...dynamics.compiling import compiled, inner
from ...types import Array

STENCILS = ((-2, -1, 1, 2), (-4, -3, 3, 4), (-6, -5, 5, 6), (-3, -2, -1, 0), (1, 2, 3, 0))
"""Neighbours that predict a sample; 0 is none."""
NORMAL = 1.4826
"""MAD-to-sigma factor."""

_STRETCHED = 2.0  # usual intervals between neighbours, beyond which they predict nothing


Stencils = tuple[tuple[int, int, int, int], ...]


def off_neighbours(
    time: Array, values: Array, good: Array, stencils: Stencils = STENCILS
) -> tuple[Array, Array]:
    """(N, m) errors as of one sample, and by how much predictions differ, likewise.

    Args:
        time: (N,) [s].
        values: (N, m).
        good: The same, bad samples replaced by what may be there, see `bridged`.
        stencils: Neighbours that predict a sample.
    """
    usual = float(np.median(np.diff(time)))
    arrays = (np.ascontiguousarray(x, dtype=float) for x in (time, values, good))
    error, differ = _off_neighbours(*arrays, _STRETCHED * usual, stencils)
    return error, NORMAL * differ


@compiled
def _off_neighbours(
    time: Array, values: Array, good: Array, far: float, stencils: Stencils
) -> tuple[Array, Array]:
    """`off_neighbours` less a factor; vectorised over samples it took several times as long."""
    error, differ = np.empty_like(values), np.empty_like(values)
    weights = np.zeros((len(stencils), 4))
    spread, off, away, in_order = np.ones((4, len(stencils)))
    for n in range(len(time)):
        for s in range(len(stencils)):
            spread[s] = _weigh(time, n, stencils[s], far, weights[s])
        for column in range(values.shape[1]):
            is_known = False
            for s in range(len(stencils)):
                off[s] = _error(values, good, n, column, stencils[s], weights[s], spread[s])
                is_known |= np.isfinite(off[s])
            if not is_known:  # alone on either side of a gap
                off[:] = 0.0
            middle = _median(off, in_order)
            for s in range(len(stencils)):
                away[s] = abs(off[s] - middle) / spread[s]
                off[s] /= spread[s]
            error[n, column] = _median(off, in_order)
            differ[n, column] = _median(away, in_order)
    return error, differ


@inner
def _weigh(time: Array, n: int, stencil: tuple[int, ...], far: float, weights: Array) -> float:
    """Write weights of a polynomial through neighbours; returns the spread of its error, or -1."""
    for i in range(len(stencil)):
        at = n + stencil[i]
        if at < 0 or at >= len(time) or not abs(time[at] - time[n]) <= far * abs(stencil[i]):
            return -1.0
    squares = 1.0
    for i in range(len(stencil)):
        weights[i] = _lagrange(time, n, stencil, i)
        squares += weights[i] ** 2
    return np.sqrt(squares)


@inner
def _lagrange(time: Array, n: int, stencil: tuple[int, ...], i: int) -> float:
    """A neighbour's polynomial at a sample."""
    if stencil[i] == 0:
        return 0.0
    own, out = time[n + stencil[i]] - time[n], 1.0
    for j in range(len(stencil)):
        if stencil[j] not in (0, stencil[i]):
            node = time[n + stencil[j]] - time[n]
            out *= node / (node - own)
    return out


@inner
def _error(
    values: Array,
    good: Array,
    n: int,
    column: int,
    stencil: tuple[int, ...],
    weights: Array,
    spread: float,
) -> float:
    """Of the prediction; NaN where there is none."""
    if spread < 0.0:
        return np.nan
    predicted = 0.0
    for i in range(len(stencil)):
        if stencil[i] != 0:
            predicted += weights[i] * good[n + stencil[i], column]
    return values[n, column] - predicted


@inner
def _median(numbers: Array, in_order: Array) -> float:
    """Median of some numbers without NaN, put in order; NaN of none."""
    count = 0
    for number in numbers:
        if not np.isnan(number):
            at = count
            while at > 0 and in_order[at - 1] > number:
                in_order[at] = in_order[at - 1]
                at -= 1
            in_order[at] = number
            count += 1
    return 0.5 * (in_order[(count - 1) // 2] + in_order[count // 2]) if count else np.nan


def bridged(time: Array, rates: Array, bad: np.ndarray) -> Array:
    """(N, m) rates, those that are bad replaced by a line between their neighbours."""
    if np.count_nonzero(~bad) < 2 or not rates.size:
        return np.zeros_like(rates)
    return np.column_stack([np.interp(time, time[~bad], x[~bad]) for x in rates.T])
