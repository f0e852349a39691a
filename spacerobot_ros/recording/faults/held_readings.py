"""Readings that a logger repeats until the next one: of a slower sensor, or while none comes."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...types import Array, BoolArray, IntArray
from ..record import Record

_FEWEST = 20  # readings, from which a rate is one
_ALIKE = 0.9
"""Share of the readings that last as long as usual, or a sample more or less. Of an encoder at
rest, or of coarse steps, readings last as long as the motion makes them."""
_STALL = 2  # repeats in a row, from which none came; one less is what a clock beside another makes
_LEAP = 0.5
"""Of the way that a joint goes meanwhile, by the faster one of the steps beside, what it must be
off by when readings go on: one that stood, or crept by the steps of its encoder, is off by one."""


def without_repeats(record: Record) -> Record:
    """The record with every reading of joints, gyro and star tracker once, which its notes say.

    Repeated ones would pass for others, of a sensor without noise that does not follow the motion.
    """
    kept: dict[str, Any] = {}
    notes = []
    for name, values in _readings(record).items():
        first = first_of_each(values)
        if len(first) < len(values):
            kept[name] = getattr(record, name).at(first)
            times = len(values) / len(first)
            notes.append(f'{name}: every reading is there {times:.3g} times: taken once')
        elif name == 'joints':
            fresh = without_stalls(values, record.q)
            if len(fresh) < len(values):
                kept[name] = getattr(record, name).at(fresh)
                lost = len(values) - len(fresh)
                notes.append(f'{name}: {lost} readings repeated while it moved on: left out')
    return record.corrected(kept, *notes) if kept else record


def _readings(record: Record) -> dict[str, Array]:
    """All that a sensor says at once (N, m), by its name."""
    joints = record.joints
    channels = [] if joints is None else [joints.position, joints.velocity, joints.effort]
    columns = [x for x in channels if x is not None]
    return {
        'joints': np.hstack(columns) if columns else np.zeros((0, 0)),
        'rates': record.omega,
        'attitudes': record.attitude_xyzw if record.attitudes is not None else np.zeros((0, 4)),
    }


def first_of_each(values: Array) -> IntArray:
    """(M,) first samples of readings, of (N, m) values: all where none is repeated as a rule."""
    every = np.arange(len(values))
    if len(values) < 2 or not values.size:
        return every
    first = np.append(0, 1 + np.flatnonzero(~_repeated(values)))
    lengths = np.diff(first)[1:]  # the first may have begun before
    if len(lengths) < _FEWEST:
        return every
    usual = float(np.median(lengths))
    alike = float(np.mean(np.abs(lengths - usual) <= 1.0))
    return first if usual >= 2.0 and alike >= _ALIKE else every


def runs(which: BoolArray) -> list[tuple[int, int]]:
    """First sample of every run of those that are meant (N,), and the one after it."""
    edges = np.flatnonzero(np.diff(which.astype(int), prepend=0, append=0)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _repeated(values: Array) -> BoolArray:
    """(N - 1,) whether the next one of samples (N, m) says the same."""
    return ~np.any(np.diff(np.nan_to_num(values), axis=0), axis=1)


def without_stalls(values: Array, position: Array) -> IntArray:
    """(M,) samples of (N, m) values that are new, or stand because their joints (N, n) do."""
    is_new = np.ones(len(values), dtype=bool)
    for first, last in runs(_repeated(values)):
        if last - first < _STALL or first == 0 or last + 2 >= len(values):
            continue
        beside = np.abs(position[[first, last + 2]] - position[[first - 1, last + 1]])
        leap = np.abs(position[last + 1] - position[first])
        way = _LEAP * (last - first + 1) * np.max(beside, axis=0)
        if np.any((np.min(beside, axis=0) > 0.0) & (leap >= way)):
            is_new[first + 1 : last + 1] = False
    return np.flatnonzero(is_new)
