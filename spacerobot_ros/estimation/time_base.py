"""When the filter steps and what it is given at each step: times, rows and effort intervals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..recording.record import Record
from ..types import Array, IntArray

_SAME = 1e-5  # s; stamps closer than this are one time
_LONGEST = 0.02  # s


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Measured scalars in the order of their times.

    Args:
        first: (N + 1,) first row of every time.
        state: (R,) index of the state measured. channel: (R,) index into `CHANNELS`.
        axis: (R,) joint or axis. sample: (R,) index of the sample in its channel.
    """

    first: IntArray
    state: IntArray
    channel: IntArray
    axis: IntArray
    sample: IntArray


CHANNELS = ('joint_position', 'joint_velocity', 'gyro', 'attitude')


@dataclass(frozen=True, slots=True, eq=False)
class TimeBase:
    """Times of the filter.

    Args:
        times: (N,) [s].
        rows: What is measured at them.
        interval: (N-1,) effort interval [k, k+1] that each step lies in.
        fresh: (N-1,) by how many intervals it lies behind the last step's (2: two or more).
        fraction: (N-1,) place of the step's middle in its interval, from 0 to 1.
        blind: (N-1,) bool, where the effort was not measured nearby.
    """

    times: Array
    rows: Rows
    interval: IntArray
    fresh: IntArray
    fraction: Array
    blind: np.ndarray

    def by_row(self, values: Mapping[str, Array]) -> Array:
        """(R, K) of channel arrays (samples, width, K); zero where a channel has none."""
        count = next(iter(values.values())).shape[2]
        rows, out = self.rows, np.zeros((len(self.rows.state), count))
        for name, samples in values.items():
            at = np.flatnonzero(rows.channel == CHANNELS.index(name))
            out[at] = samples[rows.sample[at], rows.axis[at]]
        return out


def make_time_base(record: Record, m: int, first: int) -> TimeBase:
    """The filter's times for a record.

    Args:
        record: Record.
        m: Number of velocities of the filter.
        first: 3 for a free base, 6 for a fixed one.
    """
    start, end = record.span
    base = 6 - first
    n = m - base
    stamps = {
        'joint_position': record.joint_time,
        'joint_velocity': record.joint_time if record.qd is not None else np.zeros(0),
        'gyro': record.rate_time,
        'attitude': record.attitude_time,
    }
    states = {
        'joint_position': np.arange(base, m),
        'joint_velocity': m + np.arange(base, m),
        'gyro': m + np.arange(3),
        'attitude': np.arange(3),
    }
    inside = {
        name: np.flatnonzero((times >= start - _SAME) & (times <= end + _SAME))
        for name, times in stamps.items()
    }
    times = _merged([stamps[name][inside[name]] for name in CHANNELS] + [record.effort_time])
    times = _filled(times[(times >= start - _SAME) & (times <= end + _SAME)])
    parts = []
    for c, name in enumerate(CHANNELS):
        width = 3 if name in ('gyro', 'attitude') else n
        if not len(inside[name]):
            continue
        at = _nearest(times, stamps[name][inside[name]])
        parts.append(
            np.column_stack(
                [
                    np.repeat(at, width),
                    np.tile(states[name], len(at)),
                    np.full(len(at) * width, c),
                    np.tile(np.arange(width), len(at)),
                    np.repeat(inside[name], width),
                ]
            )
        )
    table = np.concatenate(parts)
    table = table[np.argsort(table[:, 0], kind='stable')]
    rows = Rows(np.searchsorted(table[:, 0], np.arange(len(times) + 1)), *table[:, 1:].T.copy())
    return TimeBase(times, rows, *_effort_intervals(times, record.effort_time))


def _effort_intervals(
    times: Array, effort_time: Array
) -> tuple[IntArray, IntArray, Array, np.ndarray]:
    middle = 0.5 * (times[1:] + times[:-1])
    k = np.clip(np.searchsorted(effort_time, middle) - 1, 0, len(effort_time) - 2)
    lengths = np.diff(effort_time)
    fraction = np.clip((middle - effort_time[k]) / lengths[k], 0.0, 1.0)
    fresh = np.minimum(np.diff(k, prepend=-2), 2)
    usual = float(np.median(lengths))
    outside = (middle < effort_time[0]) | (middle > effort_time[-1])
    return k, fresh, fraction, (lengths[k] > 2.5 * usual) | outside


def _merged(stamps: list[Array]) -> Array:
    times = np.sort(np.concatenate(stamps))
    return times[np.concatenate([[True], np.diff(times) > _SAME])]


def _filled(times: Array) -> Array:
    """Times with more of them where a gap is longer than a step may be."""
    gaps = np.diff(times)
    extra = [
        np.linspace(times[k], times[k + 1], int(np.ceil(gaps[k] / _LONGEST)) + 1)[1:-1]
        for k in np.flatnonzero(gaps > 1.5 * _LONGEST)
    ]
    return np.sort(np.concatenate([times, *extra]))


def _nearest(times: Array, stamps: Array) -> IntArray:
    after = np.clip(np.searchsorted(times, stamps), 1, len(times) - 1)
    before = after - 1
    return np.where(stamps - times[before] <= times[after] - stamps, before, after)
