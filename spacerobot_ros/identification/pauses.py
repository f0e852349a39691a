"""Pauses of sensors: which the identifier's splines bridge, and where another segment begins."""

from __future__ import annotations

import numpy as np

from ..recording.gaps import SPLIT_PERIODS
from ..recording.record import Record

LONGEST_PAUSE = 0.5
"""Longest time without joints or gyro that is bridged [s]. Up to 0.7 s estimates stay valid and
within 2.6 standard deviations (servicer, 100 Hz, two seeds); from 0.9 s without a gyro on chi2 no
longer explains itself. Of slow sensors four periods, as where recordings are split."""


def common_time(record: Record, end: float) -> float:
    """Time that joints and gyro have both been there [s]; zero without an attitude meanwhile."""
    if not (len(record.joint_time) and len(record.rate_time)):
        return 0.0
    begun = float(max(record.joint_time[0], record.rate_time[0]))
    seen = (record.attitude_time >= begun) & (record.attitude_time <= end)
    return end - begun if np.any(seen) else 0.0


def first_pause(record: Record) -> tuple[float, float]:
    """The first pause of joints or gyro that is not bridged [s]; at infinity without."""
    pauses = [(np.inf, np.inf)]
    for time in (record.joint_time, record.rate_time):
        steps = np.diff(time)
        longest = max(LONGEST_PAUSE, SPLIT_PERIODS * float(np.median(steps))) if len(steps) else 0
        pauses += [(float(time[k]), float(time[k + 1])) for k in np.flatnonzero(steps > longest)]
    return min(pauses)
