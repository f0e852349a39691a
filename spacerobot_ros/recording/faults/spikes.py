"""Single samples that are nowhere near their neighbours: a bad byte, a dropped frame.

One of them among thousands would otherwise be the largest thing that a record says. What lasts is
no such fault, and what several neighbours do not agree on is none that can be seen.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...formats import counted
from ...types import Array, BoolArray
from ..record import Record, shown
from .held_readings import runs
from .neighbours import NORMAL, bridged, off_neighbours
from .signals import turns

_REACH, _USUAL = 10, 0.98  # samples, and the share of times that a sensor goes less far in them
_FAR = 0.6
"""Of that way, from which a sample is looked at. Of 200,000 samples of ten machines none is left
out at 0.6, one at 0.4 (a rate of an arm that is pushed while it stands), 9 of that arm at 0.2."""
_CLEAR = 30.0
"""Times that what neighbours leave of each other, and noise around, by which it leaves them: five
times what online screening asks, which knows the noise."""
_ROUGH = 8.0  # times the median by which samples leave the middle of those beside them
_MANY = 0.1  # of the samples: a rough signal, in which none stands out
_AROUND = 30  # samples whose noise is looked at
_LONGEST = 3  # samples in a row


def without_spikes(record: Record) -> Record:
    """The record less such samples of joints, gyro and star tracker, which its notes say."""
    bad: dict[str, BoolArray] = {}
    notes = []
    for sensor, name, time, values in _channels(record):
        found = spikes(time, values) & ~record.stopped(time, time).any(axis=1)
        if found.any():
            bad[sensor] = bad.get(sensor, np.zeros_like(found)) | found
            at = shown(float(time[np.flatnonzero(found)[0]] - time[0]))
            notes.append(
                f'{sensor}: {counted(int(found.sum()), "sample")} of {len(found)} left out, whose '
                f'{name} is nowhere near its neighbours, the first {at} after the start'
            )
    kept = {name: getattr(record, name).at(~out) for name, out in bad.items()}
    return record.corrected(kept, *notes) if bad else record


def _channels(record: Record) -> Iterator[tuple[str, str, Array, Array]]:
    """Sensor, quantity, times (N,) and values (N, m) of what a record has."""
    if record.joints is not None:
        for name in ('position', 'velocity', 'effort'):
            values = getattr(record.joints, name)
            if values is not None:
                yield 'joints', name, record.joint_time, values
    yield 'rates', 'rate', record.rate_time, record.omega
    yield 'attitudes', 'attitude', record.attitude_time, turns(record)


def spikes(time: Array, values: Array) -> BoolArray:
    """(N,) samples, of values (N, m) of one kind, that leave what all neighbours say.

    Args:
        time: (N,) [s].
        values: (N, m) of one unit; NaN where there is none.
    """
    bad = np.zeros(len(time), dtype=bool)
    if len(time) <= 2 * _AROUND or not values.size:
        return bad
    values = np.nan_to_num(values)
    way = np.quantile(np.abs(values[_REACH:] - values[:-_REACH]), _USUAL, axis=0)
    limit = _FAR * float(np.max(way))
    if limit <= 0.0:
        return bad
    share = ((time[1:-1] - time[:-2]) / (time[2:] - time[:-2]))[:, None]
    off = np.abs(values[1:-1] - values[:-2] - share * (values[2:] - values[:-2]))
    for j in range(values.shape[1]):
        looked_at = np.zeros(len(time), dtype=bool)
        rough = _ROUGH * float(np.median(off[:, j]))
        looked_at[1:-1] = off[:, j] > max(limit / 3.0, rough)  # a motion may hide some of it
        if np.mean(looked_at) < _MANY:
            bad |= _standing_out(time, values[:, j : j + 1], looked_at, limit)
    return bad


def _standing_out(time: Array, values: Array, looked_at: BoolArray, limit: float) -> BoolArray:
    """(N,) which of some samples of values (N, 1) stand out."""
    out = np.zeros(len(time), dtype=bool)
    places = np.flatnonzero(looked_at)
    for group in np.split(places, np.flatnonzero(np.diff(places) > _REACH) + 1):
        if not len(group):
            continue
        near = slice(max(int(group[0]) - _AROUND, 0), int(group[-1]) + _AROUND + 1)
        doubtful = looked_at[near]
        good = bridged(time[near], values[near], doubtful)
        error, differ = (x[:, 0] for x in off_neighbours(time[near], values[near], good))
        noise = NORMAL * float(np.median(np.abs(error[~doubtful])))
        leaves = np.abs(error) > np.maximum(limit, _CLEAR * np.maximum(noise, differ))
        out[near] |= doubtful & leaves
    for start, end in runs(out):
        out[start:end] = end - start <= _LONGEST
    return out
