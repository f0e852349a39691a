"""Readings that a logger faster than the sensor repeats until the next one."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...types import Array, IntArray
from ..record import Record

_FEWEST = 20  # readings, from which a rate is one
_ALIKE = 0.9
"""Share of the readings that last as long as usual, or a sample more or less. Of an encoder at
rest, or of coarse steps, readings last as long as the motion makes them."""


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
    return record.corrected(kept, *notes) if kept else record


def _readings(record: Record) -> dict[str, Array]:
    """All that a sensor says at once (N, m), by its name."""
    joints = record.joints
    said = [] if joints is None else [joints.position, joints.velocity, joints.effort]
    columns = [x for x in said if x is not None]
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
    first = np.append(
        0, 1 + np.flatnonzero(np.any(np.diff(np.nan_to_num(values), axis=0), axis=1))
    )
    lengths = np.diff(first)[1:]  # the first may have begun before
    if len(lengths) < _FEWEST:
        return every
    usual = float(np.median(lengths))
    alike = float(np.mean(np.abs(lengths - usual) <= 1.0))
    return first if usual >= 2.0 and alike >= _ALIKE else every
