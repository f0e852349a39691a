"""Stamps of another unit, of another clock, or of a clock that was set meanwhile."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...types import Array
from ..record import Record, shown
from . import thresholds
from .signals import turns
from .thresholds import DataFault


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
