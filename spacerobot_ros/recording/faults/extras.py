"""What a user's own columns (a mapping's `extra`) lack: refused where it is much, else said.

They are the inputs of laws that nobody knows, straight between their samples: a hole is bridged
unseen, and one bad sample is all that a column's range then says.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...formats import counted
from ...types import Array, BoolArray
from ..record import Record, shown
from ..robot_inputs import EXTRA
from ..series import InputSeries
from .gaps import SPLIT_PERIODS
from .spikes import spikes
from .thresholds import DataFault

_OUTSIDE = 0.02  # of the times, that may lie before or after all samples
_HOLE = 0.2  # of the times, between two samples
_FEWEST = 8  # samples that tell what is usual


def extra_faults(record: Record) -> Iterator[DataFault]:
    """Series that cover another time than the joints, or lack a part of it."""
    times = record.joint_time
    if not len(times):
        return
    start, end = float(times[0]), float(times[-1])
    for name, _, at in _extras(record):
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


def bridged_extras(record: Record) -> tuple[str, ...]:
    """A note on each series with a hole that a straight line stands for, as `extra_faults` has it.

    Longer than four of its periods, which lost samples may leave.
    """
    notes = []
    for name, _, at in _extras(record):
        steps = np.diff(at)
        if not len(steps) or (worst := float(np.max(steps))) <= SPLIT_PERIODS * np.median(steps):
            continue
        after_that = shown(float(at[int(np.argmax(steps))] - record.joint_time[0]))
        notes.append(
            f'{name}: a hole of {worst:.3g} s, {after_that} after the start, is taken as a '
            'straight line between the samples beside it'
        )
    return tuple(notes)


def without_extra_spikes(record: Record) -> Record:
    """The record less samples of such series that stand out, which its notes say."""
    kept: dict[str, InputSeries] = {}
    notes = []
    for name, series, time in _extras(record):
        bad = spikes(time, series.values) | _alone(series.values[:, 0])
        if bad.any():
            kept[name] = series.at(~bad)
            at = shown(float(time[np.flatnonzero(bad)[0]] - record.joint_time[0]))
            notes.append(
                f'{name}: {counted(int(bad.sum()), "sample")} of {len(bad)} left out, nowhere '
                f'near its neighbours, the first {at} after the start'
            )
    inputs = {**record.inputs, **kept}
    return replace(record, inputs=inputs, notes=(*record.notes, *notes)) if kept else record


def _alone(values: Array) -> BoolArray:
    """(N,) a sample farther from both neighbours than all others are from each other.

    Too few samples for their noise to be known tell that much.
    """
    out = np.zeros(len(values), dtype=bool)
    if len(values) < _FEWEST:
        return out
    padded = np.concatenate([values[1:2], values, values[-2:-1]])
    away = np.minimum(np.abs(values - padded[:-2]), np.abs(values - padded[2:]))
    first = int(np.argmax(away))
    others = float(np.ptp(np.delete(values, first)))
    out[first] = away[first] > others > 0.0
    return out


def _extras(record: Record) -> Iterator[tuple[str, InputSeries, Array]]:
    """Name, samples and their times, where there are joints to compare these with."""
    for name, series in record.inputs.items():
        if name.startswith(EXTRA) and len(series) and len(record.joint_time):
            yield name, series, series.seconds(record.origin_ns)
