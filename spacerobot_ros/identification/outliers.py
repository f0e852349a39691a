"""Samples that contradict their neighbours, left out before a fit, and pauses that end it.

A rate is predicted by its neighbours (`recording.faults.neighbours`). A position (or an
attitude) less the integral of its rate moves slowly; it is compared with its running median, which
a burst of up to half the window does not move. Both scales are the larger of the stated noise and
the median absolute error, so that a motion rougher than thought is not taken for outliers
(Hampel 1974).
"""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

import numpy as np
import scipy

from ..estimation.trajectory.reference import NoiseLevels, integrated_rotation
from ..formats import counted
from ..recording.faults.bursts import bursts
from ..recording.faults.gaps import SPLIT_PERIODS
from ..recording.faults.joint_limits import without_steps
from ..recording.faults.neighbours import NORMAL, STENCILS, bridged, off_neighbours
from ..recording.integral import integral
from ..recording.record import Record
from ..types import Array

FURTHEST = 6.0
"""Standard deviations from which on a sample is left out. One in a hundred just below it raises
the variance by 0.01 x 36, standard deviations by 17 %; noise alone goes beyond once in 5e8."""

_HALF_WINDOW = 25  # samples; a burst of as many is found
_CLOSEST = STENCILS[:1]
"""Sees a sample from 1.39 x 6 standard deviations on; the median of all five ways, which bad
neighbours do not move, from about 18 on."""
_SEEN_BY_ALL = 0.23
"""Of its error by the closest way, standardized, what the median of all must give for a sample
to be the bad one: half of 1.39 / 3.0, the spreads of the closest way and of the third. Beside a
bad neighbour that nothing else sees the closest way is off by two thirds of it, the median not."""
_PASSES = 3  # of 272 records of as many odd messages as good ones 7 need two, none needs three
_HUGE = 1e150  # whose sums and ratios are finite


class Outliers(NamedTuple):
    """Which samples contradict their neighbours: (N,) bool of each sensor."""

    joints: np.ndarray
    imu: np.ndarray
    attitude: np.ndarray

    def counted(
        self, record: Record, after: float = -np.inf, until: float = np.inf
    ) -> Counter[str]:
        """Their number by sensor, of a record's samples after a time and until another [s]."""
        times = (record.joint_time, record.rate_time, record.attitude_time)
        counts = [np.sum(b & (t > after) & (t <= until)) for b, t in zip(self, times, strict=True)]
        return Counter(dict(zip(self._fields, map(int, counts), strict=True)))


def without_outliers(record: Record, noise: NoiseLevels) -> tuple[Record, Outliers]:
    """The record less its outliers, and which they are.

    Args:
        record: Samples of joints and gyro; perhaps of a star tracker.
        noise: Standard deviations of a sample.
    """
    with np.errstate(over='ignore', invalid='ignore'):  # numbers near the largest there are
        joints = _outlying_joints(record, noise)
        imu = _outlying_gyro(record.rate_time, record.omega, noise.gyro)
        attitude = _outlying_attitudes(record, imu, noise)
    times = (record.joint_time, record.rate_time, record.attitude_time)
    stops = (record.stopped(time, time).any(axis=1) for time in times)
    found = Outliers(*(bad & ~at for bad, at in zip((joints, imu, attitude), stops, strict=True)))
    kept: dict[str, Any] = {
        name: None if getattr(record, name) is None else getattr(record, name).at(~bad)
        for name, bad in zip(('joints', 'rates', 'attitudes'), found, strict=True)
    }
    return record.corrected(kept), found


def screened(record: Record, noise: NoiseLevels) -> tuple[Record, tuple[str, ...]]:
    """`without_outliers` of a whole recording, and what its notes say of that."""
    kept, found = without_outliers(record, noise)
    counts = (+found.counted(record)).items()
    parts = ', '.join(counted(n, f'sample of {s}', f'samples of {s}') for s, n in counts)
    return kept, (f'left out, as they contradict their neighbours: {parts}',) if parts else ()


def _outlying_joints(record: Record, noise: NoiseLevels) -> np.ndarray:
    time, q, qd = record.joint_time, record.q, record.qd
    if qd is None or not qd.size:
        return _outlying_rates(time, q, noise.joint_position)
    bad = _outlying_rates(time, qd, noise.joint_velocity) | _stuck(time, q, qd, noise)
    rates = bridged(time, qd, bad)
    drift = without_steps(record, time, q - integral(time, rates))
    return bad | _off_median(time, drift, noise.joint_position)


def _stuck(time: Array, q: Array, qd: Array, noise: NoiseLevels) -> np.ndarray:
    """Samples in which a joint stands where it stood before, while its rate says that it moved."""
    same = np.vstack([np.zeros((1, q.shape[1]), dtype=bool), np.diff(q, axis=0) == 0.0])
    begun = np.maximum.accumulate(np.where(same, 0, np.arange(len(time))[:, None]), axis=0)
    moved = np.abs(qd) * (time[:, None] - time[begun])
    return np.asarray(np.any(same & (moved > FURTHEST * noise.joint_position), axis=1))


def _outlying_gyro(time: Array, omega: Array, std: float) -> np.ndarray:
    """Readings that repeat the last one on all axes while the base turned on, and outliers.

    That it did shows in the next other reading: noise differs by more once in 5e8.
    """
    changes = np.any(np.diff(omega, axis=0, prepend=np.inf) != 0.0, axis=1)
    runs = np.cumsum(changes) - 1
    firsts = omega[changes]
    jumps = np.any(np.abs(np.diff(firsts, axis=0)) > FURTHEST * np.sqrt(2.0) * std, axis=1)
    good = changes | ~np.append(jumps, False)[runs]
    good[good] = ~_outlying_rates(time[good], omega[good], std)
    return np.asarray(~good)


def _outlying_attitudes(record: Record, bad_rates: np.ndarray, noise: NoiseLevels) -> np.ndarray:
    """Where the tracker leaves the integral of the gyro; untested where there is no gyro."""
    at, attitude = record.attitude_time, record.attitude
    bad = np.zeros(len(at), dtype=bool)
    good = ~bad_rates
    if attitude is None or np.count_nonzero(good) < 2:
        return bad
    time, omega = record.rate_time[good], record.omega[good]
    inside = np.flatnonzero((at >= time[0]) & (at <= time[-1]))
    if len(inside) < 3:
        return bad
    times = np.unique(np.concatenate([time, at[inside]]))

    def rate(t: Array) -> Array:
        return np.column_stack([np.interp(t, time, column) for column in omega.T])

    turned = integrated_rotation(rate, times, scipy.spatial.transform.Rotation.identity())
    start = attitude[inside] * turned[np.searchsorted(times, at[inside])].inv()
    drift = (start * start.mean().inv()).as_rotvec()
    drift = without_steps(record, at[inside], drift)
    bad[inside] = _off_median(at[inside], drift, noise.attitude)
    return bad


def _outlying_rates(time: Array, values: Array, std: float) -> np.ndarray:
    """(N,) where values (N, m) are far from what their neighbours predict, alone or in a row."""
    values = np.clip(values, -_HUGE, _HUGE)
    good = np.ones(len(time), dtype=bool)
    for test in (_lone, bursts, _lone):  # a lone one and a good one would pass for a burst
        good[good] = ~test(time[good], values[good], std)
    return ~good


def _lone(time: Array, values: Array, std: float) -> np.ndarray:
    """(N,) where values (N, m) are far from what their neighbours predict."""
    if len(time) < 2 * len(STENCILS):
        return np.zeros(len(time), dtype=bool)
    suspected = np.any(_far(off_neighbours(time, values, values)[0], std), axis=1)
    for _ in range(_PASSES):
        good = bridged(time, values, suspected)  # bad neighbours would disagree with each other
        errors, still_open = off_neighbours(time, values, good)
        closest, _ = off_neighbours(time, values, good, _CLOSEST)
        by_all = errors * np.sign(closest) > _SEEN_BY_ALL * np.abs(closest)
        near = _far(closest, std, still_open) & by_all
        found = np.any(_far(errors, std, still_open) | near, axis=1)
        hidden = found & ~suspected
        if not hidden.any():
            break
        suspected = suspected | hidden
    return suspected & found


def _off_median(time: Array, drift: Array, std: float) -> np.ndarray:
    """(N,) where a slow drift (N, m) jumps off its running median, a steady slope aside."""
    if len(time) < 3:
        return np.zeros(len(time), dtype=bool)
    slope = np.median(np.diff(drift, axis=0) / np.diff(time)[:, None], axis=0)
    level = drift - slope * (time - time[0])[:, None]
    width = 2 * min(_HALF_WINDOW, (len(time) - 1) // 2) + 1
    # column by column SciPy takes a tenth of the time
    median = scipy.ndimage.median_filter
    usual = [median(column, width, mode='reflect') for column in np.nan_to_num(level).T]
    errors = level - np.column_stack(usual)
    far, jumps = _far(errors, std), _far(np.diff(level, axis=0), std)
    return np.any([_burst(*each) for each in zip(far.T, jumps.T, strict=True)], axis=0)


def _burst(far: np.ndarray, jumps: np.ndarray) -> np.ndarray:
    """(N,) all samples between two jumps (N - 1,), or a jump and an end, of which most are far."""
    part = np.concatenate([[0], np.cumsum(jumps)])
    return np.asarray(2 * np.bincount(part, far)[part] > np.bincount(part)[part])


def _far(errors: Array, std: float, still_open: Array | float = 0.0) -> np.ndarray:
    """(N, m) which errors are beyond what noise explains, or beyond what is open of them."""
    scale = np.maximum(std, NORMAL * np.median(np.abs(errors), axis=0))
    return np.asarray(~(np.abs(errors) <= FURTHEST * np.maximum(scale, still_open)))


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
