"""What is measured beside a motion, such as a temperature, against the times of the motion."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..record import Record, shown
from ..robot_inputs import EXTRA
from .thresholds import DataFault

_OUTSIDE = 0.02  # of the times, that may lie before or after all samples
_HOLE = 0.2  # of the times, between two samples


def extra_faults(record: Record) -> Iterator[DataFault]:
    """Series that cover another time than the joints, or lack a part of it."""
    times = record.joint_time
    if not len(times):
        return
    start, end = float(times[0]), float(times[-1])
    for name, series in record.inputs.items():
        if not name.startswith(EXTRA):
            continue
        at = series.seconds(record.origin_ns)
        before, after = max(float(at[0]) - start, 0.0), max(end - float(at[-1]), 0.0)
        if before + after > _OUTSIDE * (end - start):
            message = (
                f'has samples from {shown(float(at[0]))} to {shown(float(at[-1]))}, the joints '
                f'from {shown(start)} to {shown(end)}: another clock? Give its times on theirs, '
                'or leave it out'
            )
            yield DataFault('clock', name, message)
            continue
        hole = int(np.argmax(np.diff(at))) if len(at) > 1 else 0
        if len(at) < 2 or at[hole + 1] - at[hole] > _HOLE * (end - start):
            after_that = shown(float(at[hole]))
            message = f'lacks samples after {after_that}: leave it out, or cut there'
            yield DataFault('absent', name, message)
