"""Signals that mean the same motion (what moved, the integral of its rate), and their clocks.

Stamps may be of another unit, of another clock, or of a clock that was set meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy

from ...types import Array, BoolArray, IntArray
from ..integral import integral, interpolated
from ..record import Record, shown
from . import thresholds
from .gaps import longest_pause
from .thresholds import AGREE, DISAGREE, FEWEST_WINDOWS, MOST_WINDOWS, MOVED, WINDOW, DataFault


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Motion over K windows, seen twice.

    Args:
        moved: (K, n) by positions or attitudes [rad].
        integrated: (K, n) by rates [rad].
        windows: (K, 2) first and last sample of each window.
    """

    moved: Array
    integrated: Array
    windows: IntArray

    @property
    def is_large(self) -> bool:
        """Whether it is more than noise."""
        rms = [np.sqrt(np.mean(np.sum(x**2, axis=1))) for x in (self.moved, self.integrated)]
        return bool(max(rms) > MOVED)


def joint_pair(record: Record) -> Pair | None:
    """Positions and rates of the joints; None where there is too little of either."""
    time, q = record.joint_time, record.q
    if record.qd is None:
        return None
    return _pair(lambda windows: q[windows[:, 1]] - q[windows[:, 0]], time, time, record.qd)


def base_pair(record: Record) -> Pair | None:
    """Attitudes and gyro; None where there is too little of either."""
    moved = partial(turned, record.attitude_xyzw)
    return _pair(moved, record.attitude_time, record.rate_time, record.omega)


def _pair(
    moved: Callable[[IntArray], Array], seconds: Array, rate_time: Array, rates: Array
) -> Pair | None:
    """Motion over windows (K, 2) of samples at some times, and the integral of rates at others."""
    windows = _windows(seconds, rate_time)
    if len(windows) < FEWEST_WINDOWS:
        return None
    sums = integral(rate_time, rates)
    first, last = (interpolated(ends, rate_time, sums) for ends in seconds[windows].T)
    return Pair(moved(windows), last - first, windows)


def turned(q_xyzw: Array, windows: IntArray, *, in_base: bool = True) -> Array:
    """(K, 3) rotation vectors from the first to the last attitude of each window [rad]."""
    rotation = scipy.spatial.transform.Rotation.from_quat(q_xyzw)
    first, last = rotation[windows[:, 0]], rotation[windows[:, 1]]
    turn = first.inv() * last if in_base else last * first.inv()
    return np.asarray(turn.as_rotvec())


def turns(record: Record) -> Array:
    """(Na, 3) turns from attitude to attitude, added up [rad]."""
    if record.attitude is None:
        return np.zeros((0, 3))
    steps = (record.attitude[:-1].inv() * record.attitude[1:]).as_rotvec().reshape(-1, 3)
    return np.vstack([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def disagree(moved: Array, integrated: Array) -> bool:
    """Whether two accounts of one motion can't both be right."""
    return _share(moved, integrated) > DISAGREE


def agree(moved: Array, integrated: Array) -> bool:
    """Whether they are the same."""
    return _share(moved, integrated) < AGREE


def _share(moved: Array, integrated: Array) -> float:
    """Share of the motion that the rates don't explain, of the larger of the two."""
    scale = max(float(np.sum(moved**2)), float(np.sum(integrated**2)))
    return float(np.sum((moved - integrated) ** 2)) / scale if scale > 0.0 else 0.0


def _windows(seconds: Array, rates: Array) -> IntArray:
    """(K, 2) first and last sample of short stretches in which the rates have no long pause."""
    if len(seconds) < 2 or len(rates) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    longest = max(WINDOW, 2.0 * float(np.median(np.diff(seconds))))
    first = np.arange(len(seconds))
    last = np.searchsorted(seconds, seconds + WINDOW - 1e-9)
    ok = (last < len(seconds)) & (last > first)
    first, last = first[ok], last[ok]
    ok = seconds[last] - seconds[first] < 2.0 * longest
    ok &= (seconds[first] >= rates[0]) & (seconds[last] <= rates[-1])
    steps = np.diff(rates)
    pauses = np.concatenate([[0], np.cumsum(steps > max(longest, 3.0 * np.median(steps)))])
    before, after = (np.searchsorted(rates, seconds[k]) for k in (first, last))
    ok &= pauses[np.minimum(before, len(rates) - 1)] == pauses[np.minimum(after, len(rates) - 1)]
    stride = max(1, int(ok.sum()) // MOST_WINDOWS)
    return np.column_stack([first[ok], last[ok]])[::stride]


def clock_faults(record: Record) -> Iterator[DataFault]:
    """Every fault of the stamps of a record with joints, and a record that is too short."""
    signals = _signals(record)
    for place, seconds, values, rates in signals:
        period = float(np.median(np.diff(seconds))) if len(seconds) > 1 else 1.0
        if not thresholds.PERIODS[0] < period < thresholds.PERIODS[1]:
            message = f'a sample every {period:.3g} s: the stamps are not in seconds'
            yield DataFault('clock', place, message)
        elif values.size:
            yield from _jumps(place, seconds, values, rates)
    (_, joints, *_), *others = signals
    lasts = joints[-1] - joints[0]
    if lasts < thresholds.SHORTEST:
        needed = f'a diagnosis needs {thresholds.SHORTEST:g} s or more'
        yield DataFault('short', 'joints', f'the record lasts {lasts:.3g} s; {needed}')
    for place, seconds, *_ in others:
        shared = min(joints[-1], seconds[-1]) - max(joints[0], seconds[0])
        if shared < thresholds.OVERLAP * min(lasts, seconds[-1] - seconds[0]):
            apart = seconds[0] - joints[0]
            message = f'begins {shown(apart)} after the joints: their clocks are not the same'
            yield DataFault('clock', place, message)


def clock_jumps(record: Record) -> Iterator[DataFault]:
    """Clocks that were set forward meanwhile."""
    for signal in _signals(record):
        yield from _jumps(*signal)


def torn_positions(record: Record) -> Iterator[DataFault]:
    """Where a joint or the base moves as it never does: recordings that were joined.

    Over pauses, and from one sample to the next.

    A gyro tells of turns that a tracker did not see.
    """
    names = record.joints.names if record.joints else ()
    yield from _torn([f'joint_position/{name}' for name in names], record.joint_time, record.q)
    turned = float(np.max(np.linalg.norm(record.omega, axis=1), initial=0.0))
    yield from _torn(['attitude'] * 3, record.attitude_time, turns(record), turned)
    if (at := record.inputs.get('base_position')) is not None:
        yield from _torn(['base_position'] * 3, at.seconds(record.origin_ns), at.values)


def _torn(
    places: Sequence[str], time: Array, values: Array, known: float = 0.0
) -> Iterator[DataFault]:
    """Of positions (N, n) of which no rate is above a known one, or any that they have.

    Their fastest motion is that over `WINDOW`, or over two samples where these are longer apart.
    """
    steps = np.diff(time)
    if not values.size or len(steps) < FEWEST_WINDOWS:
        return
    moved = np.abs(np.diff(values, axis=0))
    is_pause = steps > longest_pause(time)
    # what no other step comes near: two runs joined without a pause, a sensor that was reset
    usual = thresholds.FASTER * np.quantile(moved, thresholds.ORDINARY, axis=0)
    leaps = ~is_pause & np.any(moved > np.maximum(usual, thresholds.LEAP), axis=1)
    fastest = _fastest(time, values, ~(is_pause | leaps))
    if fastest is None:
        return
    fastest = np.maximum(fastest, known)
    for k in np.flatnonzero(is_pause | leaps).tolist():
        least = MOVED if is_pause[k] else np.maximum(usual, thresholds.LEAP)
        excess = moved[k] - thresholds.FASTER * fastest * steps[k] - least
        axis = int(np.argmax(excess))
        if excess[axis] > 0.0:
            over = 'a pause of ' if is_pause[k] else ''
            message = (
                f'jumps by {moved[k, axis]:.3g} over {over}{shown(steps[k])}, '
                f'{shown(time[k] - time[0])} after the start, far more than it ever moves in such '
                'a time: recordings that were joined? '
            )
            mend = '--split-gaps takes them as several' if is_pause[k] else 'cut it there'
            yield DataFault('joined', places[axis], message + mend)


def _fastest(time: Array, values: Array, is_usual: BoolArray) -> Array | None:
    """(n,) largest rates over `WINDOW` of values (N, n), over steps (N-1,) that are usual."""
    steps = np.diff(time)
    count = max(int(WINDOW / np.median(steps)), 1)
    spans = time[count:] - time[:-count]
    odd = np.concatenate([[0], np.cumsum(~is_usual)])
    near = (spans < 2.0 * count * np.median(steps)) & (odd[count:] == odd[:-count])
    if not near.any():
        return None
    return np.asarray(
        np.max(np.abs(values[count:] - values[:-count])[near] / spans[near, None], 0)
    )


def _signals(record: Record) -> list[tuple[str, Array, Array, Array | None]]:
    """Place, times, smooth values and their rates of every sensor that has any, joints first."""
    signals = (
        ('joints', record.joint_time, record.q, record.qd),
        ('gyro', record.rate_time, record.omega, None),
        ('attitude', record.attitude_time, turns(record), None),
    )
    return [signal for signal in signals if len(signal[1])]


def _jumps(place: str, seconds: Array, values: Array, rates: Array | None) -> Iterator[DataFault]:
    """Pauses over which the values go on smoothly only if no time had passed.

    Where rates are known, values that moved as the rates say in the time that passed tell that it
    did: samples were lost.
    """
    steps = np.diff(seconds)
    if not len(steps):
        return
    period = float(np.median(steps))
    count = max(thresholds.FEWEST_NEAR, int(np.ceil(thresholds.NEAR / period)))
    for k in np.flatnonzero(steps > thresholds.JUMP_PERIODS * period).tolist():
        if not count <= k + 1 <= len(seconds) - count:
            continue
        if rates is not None:
            moved, rate = values[k + 1] - values[k], 0.5 * (rates[k] + rates[k + 1])
            by_clock, at_once = (np.linalg.norm(moved - rate * t) for t in (steps[k], period))
            if by_clock < at_once:
                continue
        near = np.arange(k + 1 - count, k + 1 + count)
        paused = seconds[near]
        unpaused = paused - np.where(near > k, steps[k] - period, 0.0)
        if _misfit(paused, values[near], 2) > thresholds.SEEN * _misfit(unpaused, values[near], 3):
            at = shown(seconds[k] - seconds[0])
            message = (
                f'the clock jumps by {shown(steps[k])}, {at} after the start: the values go on '
                'as if no time had passed'
            )
            yield DataFault('clock', place, message)


def _misfit(seconds: Array, values: Array, degree: int) -> float:
    """What a polynomial leaves of values, root mean square.

    Values and slopes at the two ends of a pause are four numbers: any cubic over it fits them.
    """
    reach = 0.5 * float(seconds[-1] - seconds[0])
    basis = np.vander((seconds - seconds[0]) / reach - 1.0, degree + 1)
    rest = values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0]
    return float(np.sqrt(np.mean(rest**2)))
