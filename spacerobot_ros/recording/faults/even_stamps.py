"""Stamps that scatter about the even clock of a sensor, as those of a message's arrival do.

Those of a buffer that is read now and then come in bursts: ten within a millisecond, then none.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from ...types import Array
from ..record import SENSORS, Record, shown, to_stamps
from .neighbours import NORMAL, off_neighbours
from .signals import turns

_FEWEST = 200  # samples
_REACHES = (10, 100)  # samples apart
_LEAST, _MOST = 1e-3, 0.3  # of a period: smaller scatter does not matter, larger loses count
_SMOOTHER = 5.0
"""Deviations of chance by which samples are nearer to what their neighbours say at even times than
as stamped. Of samples that were really taken unevenly even times are as much farther."""
_CLOSE, _FEWEST_AT_ONCE, _READS = 0.2, 2.0, 20
"""Of the mean step, below which the usual one is within a burst, samples of one, and how often a
buffer is read: of fewer, a clock that jumps has as many."""
_WINDOW, _WANDERS = 101, 2.0
"""Samples whose mean scatter is looked at, and times by which it may be more than that of white
scatter: the clock is as even as stamps let see."""


def with_even_stamps(record: Record) -> Record:
    """The record with even stamps of joints, gyro and star tracker where data ask for them.

    Samples are taken evenly where that makes their motion smoother; what shows no motion and came
    in the same rows has the same clock. The notes say so.
    """
    kept: dict[str, Any] = {}
    notes, asked = [], set()
    for sensor, time, values in _motions(record):
        asked.add(sensor)
        size = _burst(time)
        in_bursts = size > _FEWEST_AT_ONCE
        even = _read_at_once(time) if in_bursts else _even(time)
        rough = _off_line if in_bursts else _roughness
        more = 1.0 + _SMOOTHER / np.sqrt(max(values.size, 1))
        if even is None or rough(even, values) * more > rough(time, values):
            continue
        stamps = record.origin_ns + to_stamps(even) - to_stamps(np.zeros(1))
        kept[sensor] = replace(getattr(record, sensor), stamp_ns=stamps)
        how = f'scatter by {shown(float(np.std(time - even)))}'
        how = f'come in bursts of {size:.0f}' if in_bursts else how
        notes.append(f'{sensor}: stamps {how} about an even clock, which counts')
    return _with_same_clock(record, asked, kept).corrected(kept, *notes) if kept else record


def _with_same_clock(record: Record, asked: set[str], kept: dict[str, Any]) -> Record:
    """Give what shows no motion the clock of what came in the same rows."""
    alike = {getattr(record, name).stamp_ns.tobytes(): own.stamp_ns for name, own in kept.items()}
    for name in set(SENSORS) - asked:
        series = getattr(record, name)
        if series is not None and series.stamp_ns.tobytes() in alike:
            kept[name] = replace(series, stamp_ns=alike[series.stamp_ns.tobytes()])
    inputs = {
        name: replace(series, stamp_ns=alike.get(series.stamp_ns.tobytes(), series.stamp_ns))
        for name, series in record.inputs.items()
    }
    return replace(record, inputs=inputs)


def _motions(record: Record) -> Iterator[tuple[str, Array, Array]]:
    """Sensor, times (N,) and what it sees of a motion (N, m)."""
    if record.joints is not None and record.q.size:
        yield 'joints', record.joint_time, record.q
    yield 'rates', record.rate_time, record.omega
    yield 'attitudes', record.attitude_time, turns(record)


def _burst(time: Array) -> float:
    """Samples in a usual burst of stamps; 1 where they do not come in bursts."""
    if len(time) < _FEWEST:
        return 1.0
    steps = np.diff(time)
    starts = np.count_nonzero(steps > np.mean(steps))
    is_split = starts >= _READS and np.median(steps) < _CLOSE * np.mean(steps)
    return len(time) / (1.0 + starts) if is_split else 1.0


def _read_at_once(time: Array) -> Array | None:
    """(N,) times of the even clock of a buffer whose newest sample is stamped when it is read.

    What a long pause lost is counted; None where bursts are of no such clock.
    """
    steps = np.diff(time)
    last = np.append(np.flatnonzero(steps > np.mean(steps)), len(time) - 1)
    sizes, pauses = np.diff(last), np.diff(time[last])
    period = float(np.median(pauses / sizes))
    lost = np.round(pauses / period) - sizes
    lost = np.where(lost > np.maximum(0.5 * sizes, 1.0), lost, 0.0)
    before = np.append(0.0, np.cumsum(lost))
    count = np.arange(len(time)) + np.repeat(before, np.diff(last, prepend=-1))
    period, first = np.polyfit(count[last], time[last], 1)
    if np.std(time[last] - first - period * count[last]) > period:
        return None
    return np.asarray(first + period * count)


def _even(time: Array) -> Array | None:
    """(N,) times of an even clock, lost samples counted; None where stamps are of none.

    A stamp that is late by periods tells no count: where none is lost, samples are counted.
    """
    if len(time) < _FEWEST:
        return None
    period = float(np.median(np.diff(time)))
    for reach in _REACHES:  # farther apart a period is known better, once it is known well enough
        spans = time[reach:] - time[:-reach]
        period = float(np.median(spans / np.maximum(np.round(spans / period), 1.0)))
    count = np.round((time - time[0]) / period)
    for _ in range(2):  # the first stamp may be off, too
        period, first = np.polyfit(count, time, 1)
        count = np.round((time - first) / period)
    if np.any(np.diff(count) < 1.0):
        count = np.arange(len(time))
        period, first = np.polyfit(count, time, 1)
    even = first + period * count
    scatter = time - even
    size = float(np.std(scatter))
    if not _LEAST * period < size < _MOST * period:
        return None
    wander = np.std(uniform_filter1d(scatter, _WINDOW, mode='nearest'))
    return np.asarray(even) if wander < _WANDERS * size / np.sqrt(_WINDOW) else None


def _roughness(time: Array, values: Array) -> float:
    """What neighbours leave of samples (N, m), the root mean square of usual ones."""
    error, _ = off_neighbours(time, values, values)
    return float(np.sqrt(np.mean((NORMAL * np.median(np.abs(error), axis=0)) ** 2)))


def _off_line(time: Array, values: Array) -> float:
    """How far samples (N, m) are off the line through their neighbours, the usual ones (rms)."""
    share = ((time[1:-1] - time[:-2]) / (time[2:] - time[:-2]))[:, None]
    off = values[1:-1] - (1.0 - share) * values[:-2] - share * values[2:]
    return float(np.sqrt(np.mean(off**2)))
