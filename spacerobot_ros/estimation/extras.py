"""What is measured beside a motion, such as a temperature, at the times of the motion."""

from __future__ import annotations

import numpy as np

from ..errors import RecordingError
from ..recording.record import Record, shown
from ..types import Array

EXTRA = 'extra/'
"""Beginning of the names of a record's inputs that a mapping's `extra` made."""

_OUTSIDE = 0.02  # of the times, that may lie before or after all samples
_HOLE = 0.2  # of the times, between two samples


def extras_at(record: Record, times: Array) -> dict[str, Array]:
    """(N,) values by name at times (N,) [s], straight between samples.

    Raises:
        RecordingError: one that covers another time than the motion, or lacks a part of it.
    """
    out = {}
    start, end = float(times[0]), float(times[-1])
    for name, series in record.inputs.items():
        if not name.startswith(EXTRA):
            continue
        at, place = series.seconds(record.origin_ns), f'{record.source or "recording"}: {name}'
        before, after = max(float(at[0]) - start, 0.0), max(end - float(at[-1]), 0.0)
        if before + after > _OUTSIDE * (end - start):
            raise RecordingError(
                place,
                f'has samples from {shown(float(at[0]))} to {shown(float(at[-1]))}, the joints '
                f'from {shown(start)} to {shown(end)}: another clock? Give its times on theirs, '
                'or leave it out',
            )
        hole = int(np.argmax(np.diff(at))) if len(at) > 1 else 0
        if len(at) < 2 or at[hole + 1] - at[hole] > _HOLE * (end - start):
            raise RecordingError(
                place, f'lacks samples after {shown(float(at[hole]))}: leave it out, or cut there'
            )
        out[name.removeprefix(EXTRA)] = np.interp(times, at, series.values[:, 0])
    return out
