"""Samples in a row that are off together, so that each is what its next neighbours say.

A window between two jumps is tested against a polynomial through the samples on both sides of it
(a generalized likelihood ratio, [BN93] of docs/references.md): left out where the mean of its
errors is beyond what noise does, and where a jump and a kink of the motion at one place, such as a
step of the torques makes, explain much less.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy

from ...types import Array
from .neighbours import NORMAL

LONGEST = 25
"""Samples of the longest window; of positions twice as many (`identification.outliers`)."""
_FLANK = 16  # samples on either side; 8 let the kink's place fit half of what a burst does
_SPAN = 0.75
"""Time over which a polynomial knows the motion [s]: the longest window with its flanks at 100 Hz.
Less than both flanks of a sensor of 20 Hz, whose rates held torques swing between samples."""
_DEGREE = 5
_SPARE = 4  # errors at least, from which the spread on both sides is known
_USUAL = 9  # differences whose median is the slope
_JUMP = math.erfc(2.5 / math.sqrt(2.0))
"""Chance of a jump as large: of 12 in a thousand differences of noise few make a pair."""
_CHANCE = math.erfc(6.0 / math.sqrt(2.0))
"""Of a mean error as large: as of one sample (`identification.outliers.FURTHEST`)."""
_BESIDE = math.erfc(3.0 / math.sqrt(2.0))
"""Chance of what else a jump and a kink leave, at the best of some 50 places: as of the noise of
the samples of the window, which a burst leaves out."""


class _Window(NamedTuple):
    """Where a burst may be.

    Args:
        start, stop: Of its samples.
        first, last: Of those with its flanks.
    """

    start: int
    stop: int
    first: int
    last: int

    @property
    def is_flank(self) -> np.ndarray:
        """(k,) of its samples and flanks, which are flanks."""
        n = np.arange(self.first, self.last)
        return (n < self.start) | (n >= self.stop)


def bursts(time: Array, values: Array, std: float) -> np.ndarray:
    """(N,) which samples are part of a burst of two to `LONGEST`.

    Args:
        time: (N,) [s].
        values: (N, m) of one sensor, such as rates.
        std: Standard deviation of their noise, at least.
    """
    bad = np.zeros(len(time), dtype=bool)
    for window in _windows(time, values, std):
        part = slice(window.start, window.stop)
        if not bad[part].any():
            rows = slice(window.first, window.last)
            bad[part] = _is_burst(time[rows], values[rows], window.is_flank, std)
    return bad


def _windows(time: Array, values: Array, std: float) -> Iterator[_Window]:
    """Windows between jumps that undo each other, the shortest first, whose flanks are enough."""
    if len(values) < 2 * _FLANK or not values.size:
        return
    jumps = _jumps(time, values, std)
    (at,) = np.nonzero(np.sum(jumps**2, axis=1) > scipy.special.chdtri(values.shape[1], _JUMP))
    length = at - at[:, None]
    pairs = np.argwhere((length >= 2) & (length <= LONGEST) & (jumps[at] @ jumps[at].T < 0.0))
    for start, stop in sorted((at[pairs] + 1).tolist(), key=lambda pair: pair[1] - pair[0]):
        first, last = max(start - _FLANK, 0), min(stop + _FLANK, len(values))
        if min(start - first, last - stop) > 2 and time[last - 1] - time[first] < _SPAN:
            yield _Window(start, stop, first, last)


def _jumps(time: Array, values: Array, std: float) -> Array:
    """(N - 1, m) differences less what the usual slope makes, in standard deviations."""
    steps, elapsed = np.diff(values, axis=0), np.diff(time)[:, None]
    rates = (steps / elapsed).T
    usual = [scipy.ndimage.median_filter(rate, _USUAL, mode='nearest') for rate in rates]
    jumps = steps - np.column_stack(usual) * elapsed
    scale = np.maximum(np.sqrt(2.0) * std, NORMAL * np.median(np.abs(jumps), axis=0))
    return np.asarray(jumps / scale)


def _is_burst(time: Array, values: Array, is_flank: np.ndarray, std: float) -> bool:
    """Whether samples (k, m) that are no flank are off, and not by a jump and a kink."""
    inside, count = int(np.sum(~is_flank)), values.shape[1]
    degree = min(_DEGREE, len(time) - inside - _SPARE - 1)
    place = (2.0 * time - time[0] - time[-1]) / (time[-1] - time[0])
    basis = np.asarray(np.polynomial.legendre.legvander(place, degree), dtype=float)
    flanks, middle = basis[is_flank], basis[~is_flank].mean(axis=0)
    errors = values - basis @ np.linalg.lstsq(flanks, values[is_flank], rcond=None)[0]
    squares = np.sum(errors[is_flank] ** 2, axis=0)
    scale = np.maximum(std, np.sqrt(squares / (len(flanks) - degree - 1)))
    mean = errors[~is_flank].mean(axis=0) / scale
    variance = 1.0 / inside + middle @ np.linalg.solve(flanks.T @ flanks, middle)
    if not mean @ mean > variance * scipy.special.chdtri(count, _CHANCE):
        return False
    left = _beside_a_kink(basis, place, values / scale) - np.sum(squares / scale**2)
    return bool(left > scipy.special.chdtri(inside * count, _BESIDE))


def _beside_a_kink(basis: Array, place: Array, values: Array) -> float:
    """Squares that a polynomial, a jump and a kink at the best place leave of values (k, m)."""
    orthonormal, _ = np.linalg.qr(basis)
    later = place[:, None] - place[1:-1]

    def beside(columns: np.ndarray) -> Array:
        rest = columns - orthonormal @ (orthonormal.T @ columns)
        return np.asarray(rest)

    jump, kink, left = beside((later >= 0.0) * 1.0), beside(later * (later > 0.0)), beside(values)
    jump /= np.linalg.norm(jump, axis=0)
    kink -= jump * np.sum(jump * kink, axis=0)
    kink /= np.maximum(np.linalg.norm(kink, axis=0), np.finfo(float).tiny)
    explained = np.sum((left.T @ jump) ** 2 + (left.T @ kink) ** 2, axis=0)
    return float(np.sum(left**2) - np.max(explained))
