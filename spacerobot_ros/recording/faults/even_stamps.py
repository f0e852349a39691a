"""Stamps that scatter about the even clock of a sensor, as those of a message's arrival do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter1d

from ...types import Array
from ..record import Record, shown, to_stamps
from .neighbours import NORMAL, off_neighbours
from .signals import turns

_FEWEST = 200  # samples
_REACHES = (10, 100)  # samples apart
_LEAST, _MOST = 1e-3, 0.3  # of a period: smaller scatter does not matter, larger loses count
_SMOOTHER = 5.0
"""Deviations of chance by which samples are nearer to what their neighbours say at even times than
as stamped. Of samples that were really taken unevenly even times are as much farther."""
_WINDOW, _WANDERS = 101, 2.0
"""Samples whose mean scatter is looked at, and times by which it may be more than that of white
scatter: the clock is as even as stamps let see."""


def with_even_stamps(record: Record) -> Record:
    """The record with even stamps of joints, gyro and star tracker where data ask for them.

    Samples are taken evenly where that makes their motion smoother; the notes say so.
    """
    kept: dict[str, Any] = {}
    notes = []
    for sensor, time, values in _motions(record):
        even = _even(time)
        more = 1.0 + _SMOOTHER / np.sqrt(max(values.size, 1))
        if even is None or _roughness(even, values) * more > _roughness(time, values):
            continue
        stamps = record.origin_ns + to_stamps(even) - to_stamps(np.zeros(1))
        kept[sensor] = replace(getattr(record, sensor), stamp_ns=stamps)
        scatter = shown(float(np.std(time - even)))
        notes.append(f'{sensor}: stamps scatter by {scatter} about an even clock, which counts')
    return record.corrected(kept, *notes) if kept else record


def _motions(record: Record) -> Iterator[tuple[str, Array, Array]]:
    """Sensor, times (N,) and what it sees of a motion (N, m)."""
    if record.joints is not None and record.q.size:
        yield 'joints', record.joint_time, record.q
    yield 'rates', record.rate_time, record.omega
    yield 'attitudes', record.attitude_time, turns(record)


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
