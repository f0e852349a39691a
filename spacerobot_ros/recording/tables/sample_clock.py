"""Times of samples rebuilt from a counter, where the stamps of a log stand still or jump back.

A logger that is late writes a block of samples with one stamp, or mixes up two blocks. A counter
that goes up by one a sample knows better: in a run of consecutive numbers k the times are

    t = t_0 + T k,    T: median step of stamps whose numbers are consecutive,

with t_0 the median of what the run's stamps say. Stamps that are good stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordingError
from ...types import Array, IntArray
from ..record import shown

_ALIKE, _MOST = 0.01, 3  # of all stamps; of them together


def rebuilt(seconds: Array, index: Array, row: Callable[[int], str]) -> tuple[IntArray, Array]:
    """Rows in the order of the counter, and their times.

    Args:
        seconds: (N,) stamps [s].
        index: (N,) the counter.
        row: Name of a row, for messages.

    Returns:
        (N,) row of every sample, and (N,) its time [s]. Runs whose stamps go forward are left as
        they are; so is all where every stamp does.

    Raises:
        RecordingError: a number that comes twice, or stamps that the counter can not mend: the
            steps of it are not 1 there.
    """
    if np.all(np.diff(seconds) > 0.0):
        return np.arange(len(seconds)), seconds
    order = np.argsort(index, kind='stable')
    index, given = index[order], seconds[order]
    steps = np.diff(index)
    if np.any(steps == 0.0):
        twice = int(np.argmax(steps == 0.0)) + 1
        raise RecordingError(row(int(order[twice])), f'sample_index {index[twice]:g} comes twice')
    period = float(np.median(np.diff(given)[steps == 1.0])) if np.any(steps == 1.0) else 0.0
    out = given.copy()
    for run in np.split(
        np.arange(len(index)), np.flatnonzero(~_goes_on(given, steps, period)) + 1
    ):
        if len(run) > 1 and period > 0.0 and np.any(np.diff(given[run]) <= 0.0):
            out[run] = period * index[run] + np.median(given[run] - period * index[run])
    if np.any(np.diff(out) <= 0.0):
        bad = int(np.argmax(np.diff(out) <= 0.0)) + 1
        raise RecordingError(
            row(int(order[bad])),
            f'the clock does not go on at {shown(given[bad])}, '
            f'{shown(given[bad] - given[0])} after the first sample, and the counter does not '
            f'tell the time: it goes from {index[bad - 1]:g} to {index[bad]:g}',
        )
    return order, out


def parted(seconds: Array) -> Array:
    """(N,) stamps [s], of which those that are alike are spread evenly up to the next one.

    Stamps of arrival, or of too few digits, come twice now and then. Where more than `_ALIKE` of
    them do, or more than `_MOST` together, they are of blocks, and tell no times: then all stay.
    """
    first = np.flatnonzero(np.diff(seconds, prepend=-np.inf) != 0.0)
    counts = np.diff(np.append(first, len(seconds)))
    alike = len(seconds) - len(first)
    if not 0 < alike <= _ALIKE * len(seconds) or np.max(counts) > _MOST or counts[-1] > 1:
        return seconds
    places = np.append(first, len(seconds) - 1).astype(float)
    return np.asarray(np.interp(np.arange(len(seconds)), places, seconds[places.astype(int)]))


def _goes_on(given: Array, steps: Array, period: float) -> NDArray[np.bool_]:
    """(N-1,) whether the next sample belongs to the same run of the counter.

    A block that was written late is off by its own length at most: a stamp further off than all
    samples last belongs to another run, whatever the counter says.
    """
    off = np.abs(np.diff(given) - period * steps)
    return np.asarray((steps == 1.0) & (off < period * len(given)))
