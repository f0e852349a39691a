"""What the neighbours of a sample say that it is.

Cubics through them, five disjoint or one-sided ways: the median of the five standardized errors is
not moved by a neighbour that is bad itself.
"""

from __future__ import annotations

import numpy as np

from ...types import Array, IntArray

_NEIGHBOURS = ((-2, -1, 1, 2), (-4, -3, 3, 4), (-6, -5, 5, 6), (-3, -2, -1), (1, 2, 3))
STENCILS = tuple(np.array(offsets) for offsets in _NEIGHBOURS)
NORMAL = 1.4826
"""Standard deviation of normal numbers by their median magnitude."""

_STRETCHED = 2.0  # usual intervals between neighbours, beyond which they predict nothing


def off_neighbours(time: Array, values: Array, good: Array) -> tuple[Array, Array]:
    """(N, m) errors as of one sample, and by how much predictions differ, likewise.

    Args:
        time: (N,) [s].
        values: (N, m).
        good: The same, bad samples replaced by what may be there, see `bridged`.
    """
    usual = float(np.median(np.diff(time)))
    errors, spreads = zip(*(_errors(time, usual, values, good, s) for s in STENCILS), strict=True)
    error, spread = np.stack(errors), np.stack(spreads)[..., None]
    known = np.isfinite(error).any(axis=0)
    error[:, ~known] = 0.0  # alone on either side of a gap
    differences = (error - _median(error)) / spread
    return _median(error / spread), NORMAL * _median(np.abs(differences))


def _median(stack: Array) -> Array:
    """Median over the first axis without NaN, in a quarter of the time of `np.nanmedian`."""
    in_order = np.sort(stack, axis=0)  # NaN last
    count = np.count_nonzero(~np.isnan(stack), axis=0)[None]
    low, high = (np.take_along_axis(in_order, k // 2, axis=0)[0] for k in (count - 1, count))
    return np.asarray(0.5 * (low + high))


def _errors(
    time: Array, usual: float, values: Array, good: Array, stencil: IntArray
) -> tuple[Array, Array]:
    """Of a polynomial through good neighbours: (N, m) error, NaN where none, (N,) spread."""
    spread = np.ones(len(time))
    out = np.full(values.shape, np.nan)
    low, high = max(0, -stencil.min()), len(time) - max(0, stencil.max())
    at = np.arange(low, high)
    nodes = time[at[:, None] + stencil] - time[at, None]
    near = np.all(np.abs(nodes) <= _STRETCHED * usual * np.abs(stencil), axis=1)
    at, nodes = at[near], nodes[near]
    weights = np.ones_like(nodes)
    for i in range(len(stencil)):  # Lagrange's polynomials at zero
        for j in range(len(stencil)):
            if i != j:
                weights[:, i] *= nodes[:, j] / (nodes[:, j] - nodes[:, i])
    predicted = np.einsum('ns,nsm->nm', weights, good[at[:, None] + stencil])
    spread[at] = np.sqrt(1.0 + np.sum(weights**2, axis=1))
    out[at] = values[at] - predicted
    return out, spread


def bridged(time: Array, rates: Array, bad: np.ndarray) -> Array:
    """(N, m) rates, those that are bad replaced by a line between their neighbours."""
    if np.count_nonzero(~bad) < 2 or not rates.size:
        return np.zeros_like(rates)
    return np.column_stack([np.interp(time, time[~bad], x[~bad]) for x in rates.T])
