"""When the filter steps and what it is given at each step: times, rows and effort intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import IdentificationError
from ...recording.faults.gaps import GAP_PERIODS, ONE_LOST, SEVERAL_LOST
from ...recording.record import Record
from ...types import Array, IntArray

_SAME = 1e-7  # s; stamps closer than this are one time: 3e-6 are seen in 20 s of a fast motion
_LONGEST = 0.02  # s; discretization and integrated attitudes stay below the sensors' noise
LONGEST_GAP = 60.0
"""Time without any sample that is still bridged [s]; beyond it: another run or a bad clock."""


@dataclass(frozen=True, slots=True, eq=False)
class RowIndex:
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

    def of(self, values: Mapping[str, Array]) -> Array:
        """(R, K) of channel arrays (samples, width, K); zero where a channel has none."""
        count = next(iter(values.values())).shape[2]
        out = np.zeros((len(self.state), count))
        for name, samples in values.items():
            at = np.flatnonzero(self.channel == CHANNELS.index(name))
            out[at] = samples[self.sample[at], self.axis[at]]
        return out

    def of_axes(self, channel: str, axes: Sequence[int]) -> RowIndex:
        """The same, of a channel the given axes alone."""
        is_kept = (self.channel != CHANNELS.index(channel)) | np.isin(self.axis, axes)
        first = np.append(0, np.cumsum(is_kept))[self.first]
        each = (self.state, self.channel, self.axis, self.sample)
        return RowIndex(first, *(values[is_kept] for values in each))


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
        usual: The median interval between effort samples [s].
    """

    times: Array
    rows: RowIndex
    interval: IntArray
    fresh: IntArray
    fraction: Array
    blind: np.ndarray
    usual: float


def make_time_base(record: Record, m: int, first: int) -> TimeBase:
    """The filter's times for a record.

    Args:
        record: Record.
        m: Number of velocities of the filter.
        first: 3 for a free base, 6 for a fixed one.
    """
    base = 6 - first
    states = {
        'joint_position': np.arange(base, m),
        'joint_velocity': m + np.arange(base, m),
        'gyro': m + np.arange(3),
        'attitude': np.arange(3),
    }
    stamps = channel_stamps(record)
    efforts = record.effort_time
    times = filter_times([*stamps.values(), efforts, lost_samples(efforts)], record.span)
    rows = measured_rows(times, stamps, states)
    rows = rows.of_axes('gyro', record.gyro_axes).of_axes('attitude', turning_axes(record))
    return TimeBase(times, rows, *_effort_intervals(times, record.effort_time))


def turning_axes(record: Record) -> list[int]:
    """Axes about which the attitude changes: a platform's on a table are two less."""
    if record.attitude is None:
        return []
    turned = np.ptp((record.attitude[0].inv() * record.attitude).as_rotvec(), axis=0)
    return [i for i in range(3) if turned[i] > 0.0 or not turned.any()]


def channel_stamps(record: Record) -> dict[str, Array]:
    """(samples,) times of every channel [s]; empty where it was not measured."""
    return {
        'joint_position': record.joint_time,
        'joint_velocity': record.joint_time if record.qd is not None else np.zeros(0),
        'gyro': record.rate_time,
        'attitude': record.attitude_time,
    }


def filter_times(stamps: Sequence[Array], span: tuple[float, float], same: float = _SAME) -> Array:
    """(N,) all stamps within the span in order, and more where a gap is longer than a step.

    Args:
        stamps: Times of samples [s].
        span: First and last time [s].
        same: Stamps closer than this become one time [s].
    """
    times = np.sort(np.concatenate(stamps))
    times = times[(times >= span[0] - _SAME) & (times <= span[1] + _SAME)]
    times = times[np.diff(times, prepend=-np.inf) > same]
    gaps = np.diff(times)
    extra = [
        np.linspace(times[k], times[k + 1], int(np.ceil(gaps[k] / _LONGEST)) + 1)[1:-1]
        for k in np.flatnonzero(gaps > 1.5 * _LONGEST)
    ]
    return np.sort(np.concatenate([times, *extra]))


def lost_samples(time: Array) -> Array:
    """(lost,) times at which single samples, at (N,) times, are missing among the others [s]."""
    steps = np.diff(time)
    usual = np.median(steps) if len(steps) else 0.0
    is_one = (steps > ONE_LOST * usual) & (steps <= SEVERAL_LOST * usual)
    return np.asarray(time[:-1][is_one] + usual)


def pauses(time: Array) -> tuple[tuple[float, float], ...]:
    """Starts and ends [s] of the gaps between samples, at (N,) times, that a note is made of."""
    steps = np.diff(time)
    long = np.flatnonzero(steps > GAP_PERIODS * np.median(steps)) if len(steps) else ()
    return tuple((float(time[k]), float(time[k + 1])) for k in long)


def measured_rows(
    times: Array, stamps: Mapping[str, Array], states: Mapping[str, IntArray]
) -> RowIndex:
    """RowIndex of the samples within some times, each at the time that is nearest.

    Args:
        times: (N,) [s].
        stamps: Channel to the times of its samples [s].
        states: Channel to the (width,) states that it measures.
    """
    parts = [np.zeros((0, 5), dtype=int)]
    for c, name in enumerate(CHANNELS):
        inside = (stamps[name] >= times[0] - _SAME) & (stamps[name] <= times[-1] + _SAME)
        samples, width = np.flatnonzero(inside), len(states[name])
        at = _nearest(times, stamps[name][samples])
        parts.append(
            np.column_stack(
                [
                    np.repeat(at, width),
                    np.tile(states[name], len(at)),
                    np.full(len(at) * width, c),
                    np.tile(np.arange(width), len(at)),
                    np.repeat(samples, width),
                ]
            )
        )
    table = np.concatenate(parts)
    table = table[np.argsort(table[:, 0], kind='stable')]
    return RowIndex(
        np.searchsorted(table[:, 0], np.arange(len(times) + 1)), *table[:, 1:].T.copy()
    )


def refuse_long_gaps(times: Array) -> None:
    """Refuse stamps that a filter can not bridge.

    Args:
        times: (N,) increasing [s].

    Raises:
        IdentificationError: a gap longer than `LONGEST_GAP`.
    """
    gaps = np.diff(times)
    if len(gaps) and np.max(gaps) > LONGEST_GAP:
        place = int(np.argmax(gaps))
        raise IdentificationError(
            f'no samples for {gaps[place]:.6g} s after t = {times[place]:.6g} s, at most '
            f'{LONGEST_GAP:g} s can be bridged: check the stamps, or use one part of the data'
        )


def _effort_intervals(
    times: Array, effort_time: Array
) -> tuple[IntArray, IntArray, Array, np.ndarray, float]:
    middle = 0.5 * (times[1:] + times[:-1])
    k = np.clip(np.searchsorted(effort_time, middle) - 1, 0, len(effort_time) - 2)
    lengths = np.diff(effort_time)
    fraction = np.clip((middle - effort_time[k]) / lengths[k], 0.0, 1.0)
    fresh = np.minimum(np.diff(k, prepend=-2), 2)
    usual = float(np.median(lengths))
    # a clock that is a little late or early makes no torque unknown
    outside = np.maximum(effort_time[0] - middle, middle - effort_time[-1]) > 0.5 * usual
    return k, fresh, fraction, (lengths[k] > SEVERAL_LOST * usual) | outside, usual


def _nearest(times: Array, stamps: Array) -> IntArray:
    after = np.clip(np.searchsorted(times, stamps), 1, len(times) - 1)
    before = after - 1
    return np.where(stamps - times[before] <= times[after] - stamps, before, after)
