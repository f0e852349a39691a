"""How a recording was sampled: rates, gaps, jitter, and clocks that are late by each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from ...estimation.noise_levels import unseen_turns
from ...model.body import joint_unit
from ...model.robot import Robot
from ...recording.faults.gaps import GAP_PERIODS, ONE_LOST
from ...recording.faults.joint_limits import without_steps
from ...recording.faults.thresholds import MOVED
from ...recording.record import SENSORS, RateSeries, Record, to_stamps
from ...types import Array, IntArray

SPLINE = 3  # degree of the curve that rates are integrated by
_PASSES = 3
_PARTS, _FEWEST, _MOST = 5, 40, 4000  # of a record, and samples of each, that delays come from


@dataclass(frozen=True, slots=True)
class Sampling:
    """When one sensor was sampled.

    Args:
        sensor: Field of the record.
        samples: Their number.
        start: Time of the first one [s].
        duration: From it to the last one [s].
        rate: One over the median period [Hz]; NaN of a single sample.
        jitter: Standard deviation of a stamp about even times, gaps left out [s].
        gaps: Number of pauses above ten periods.
        longest_gap: The longest pause of those [s]; 0 without.
        lost: Share of the samples at that rate that are missing.
    """

    sensor: str
    samples: int
    start: float
    duration: float
    rate: float
    jitter: float
    gaps: int
    longest_gap: float
    lost: float


@dataclass(frozen=True, slots=True, eq=False)
class Discrepancy:
    """What one sensor says of a motion beyond the integral of another one's rates.

    Args:
        late: The sensor. reference: That of the rates.
        unit: Of the error.
        time: (N,) [s].
        error: (N, k) [rad] (of joints that slide [m]).
        rate: (N, k) [rad/s], in the axes of the error.
        others: (N, k, m) errors by offsets, biases and scales of the rates.
    """

    late: str
    reference: str
    unit: str
    time: Array
    error: Array
    rate: Array
    others: Array

    @property
    def left(self) -> Array:
        """(N, k) what offsets, biases, scales and a delay do not explain."""
        return np.asarray(self.error - self._columns @ self.fit)

    @property
    def fit(self) -> Array:
        """(m + 1,) offsets, biases, scales, and the delay's opposite."""
        flat = self._columns.reshape(self.error.size, -1)
        return np.asarray(np.linalg.lstsq(flat, self.error.ravel(), rcond=None)[0])

    @property
    def _columns(self) -> Array:
        return np.concatenate([self.others, self.rate[:, :, None]], axis=2)


@dataclass(frozen=True, slots=True)
class ClockDelay:
    """How late one sensor is by another one that sees the same motion.

    Args:
        late: The sensor.
        reference: The other one.
        delay: Below zero where it is early [s].
        std: Standard deviation, from parts of the record [s].
        error: What the delay makes of a reading, rms.
        unit: Of that.
    """

    late: str
    reference: str
    delay: float
    std: float
    error: float
    unit: str


def samplings(record: Record) -> tuple[Sampling, ...]:
    """Of every sensor that the record has."""
    found = ((name, getattr(record, name)) for name in SENSORS)
    return tuple(
        _sampling(name, series.seconds(record.origin_ns)) for name, series in found if series
    )


def _sampling(sensor: str, time: Array) -> Sampling:
    steps = np.diff(time)
    period = float(np.median(steps)) if len(steps) else np.nan
    even = steps[steps < ONE_LOST * period]
    gaps = steps[steps > GAP_PERIODS * period]
    lost = float(np.sum(np.round(steps[steps >= ONE_LOST * period] / period) - 1.0))
    return Sampling(
        sensor=sensor,
        samples=len(time),
        start=float(time[0]),
        duration=float(time[-1] - time[0]),
        rate=1.0 / period,
        jitter=float(np.std(even) / np.sqrt(2.0)) if len(even) > 1 else np.nan,  # of two stamps
        gaps=len(gaps),
        longest_gap=float(gaps.max(initial=0.0)),
        lost=lost / (lost + len(time)),
    )


def discrepancies(record: Record, robot: Robot | None = None) -> Iterator[Discrepancy]:
    """Joint positions against rates, attitude against gyro, where both were measured.

    An offset a, a bias b and an error M of scale and axes of the rates make of it
    a + int (b + M rate) dt, and positions whose stamps are d late -d rate.
    """
    qd = record.qd
    if qd is not None and np.isfinite(qd).all() and len(qd) > SPLINE:
        time, n = record.joint_time, qd.shape[1]
        moved = spline_integral(time, qd)
        spread = np.stack([np.ones_like(qd), np.tile(time[:, None], n), moved], axis=2)
        others = (np.eye(n)[None, :, :, None] * spread[:, :, None, :]).reshape(len(qd), n, -1)
        unit = joint_unit('rad') if robot is None else robot.unit_of('rad')
        difference = without_steps(record, time, record.q - moved)
        qd = np.where(np.any(record.stopped(time, time), axis=1, keepdims=True), 0.0, qd)
        yield Discrepancy('joint_position', 'joint_velocity', unit, time, difference, qd, others)
    if record.attitude is not None and len(record.rate_time) > len(record.attitude_time) > SPLINE:
        start, end = record.attitude_time[[0, -1]].tolist()
        seen = record.between(start - 1e-9, end)  # turns count from the first attitude
        if len(seen.rate_time) > len(seen.attitude_time):
            yield _of_base(seen, record.attitude, seen.omega)


def _of_base(record: Record, attitude: Rotation, omega: Array) -> Discrepancy:
    """Attitude against gyro, in base axes at the start.

    Turns are no vectors: bias and scale are taken out of the gyro until the rest adds up to a
    small turn.
    """
    time, stamps = record.attitude_time, to_stamps(record.rate_time, record.origin_ns)
    turned = (attitude[0].inv() * attitude).as_matrix()
    is_stopped = np.any(record.stopped(time, time), axis=1, keepdims=True)
    for _ in range(_PASSES):
        seen = replace(record, rates=RateSeries(stamps, omega))
        at = np.column_stack([np.interp(time, record.rate_time, w) for w in omega.T])
        columns = [np.broadcast_to(np.eye(3), turned.shape), spline_integral(time, turned)]
        columns += [spline_integral(time, turned * w[:, None, None]) for w in at.T]
        rate, others = np.einsum('nij,nj->ni', turned, at), np.concatenate(columns, axis=2)
        rate = np.where(is_stopped, 0.0, rate)
        turns = without_steps(record, time, np.asarray(unseen_turns(seen)))
        pair = Discrepancy('attitude', 'gyro', 'rad', time, turns, rate, others)
        bias, scale = pair.fit[3:6], pair.fit[6:15].reshape(3, 3)
        omega = omega + bias + omega @ scale
    return pair


def spline_integral(time: Array, rate: Array) -> Array:
    """(N, ...) integral of rates from the first sample, by a cubic spline."""
    curve = make_interp_spline(time, rate, k=min(SPLINE, len(time) - 1))
    return np.asarray(curve.antiderivative()(time))


@dataclass(frozen=True, slots=True)
class RateScale:
    """How far a joint goes by its positions, by how far it goes by its rates.

    Args:
        joint: Its name.
        scale: 1 where both say the same.
        std: Standard deviation, from parts of the record.
        error: What that makes of a position where the rates are integrated, rms [rad].
    """

    joint: str
    scale: float
    std: float
    error: float


def rate_scales(record: Record) -> Iterator[RateScale]:
    """Of every joint that goes somewhere, where all rates were measured; beside bias and delay."""
    qd, time = record.qd, record.joint_time
    if qd is None or not np.isfinite(qd).all() or len(time) < _PARTS * _FEWEST:
        return
    names = record.joints.names if record.joints else ()
    for name, q, rate in zip(names, record.q.T, qd.T, strict=True):
        if np.std(q) < MOVED:  # what is said of its rate is noise
            continue
        moved = spline_integral(time, rate)
        others = np.column_stack([np.ones_like(time), time, rate])
        error, opposite = without_steps(record, time, (q - moved)[:, None]), -moved[:, None]
        mean, std = _by_parts(Discrepancy('', '', '', time, error, opposite, others[:, None, :]))
        if np.isfinite(mean):
            yield RateScale(name, 1.0 + mean, std, abs(mean) * float(np.std(moved)))


def _by_parts(pair: Discrepancy) -> tuple[float, float]:
    """Mean delay of parts of a record, by what each knows of it, and its standard deviation.

    NaN where none of them says anything.
    """
    parts = np.array_split(np.arange(len(pair.time)), _PARTS)
    values, weights = np.array([_in_part(pair, own) for own in parts]).T
    if not weights.sum() > 0.0:
        return np.nan, np.nan
    mean = float(weights @ values / weights.sum())
    spread = float(weights @ (values - mean) ** 2 / weights.sum() / (_PARTS - 1))
    return mean, spread**0.5


def delay_of(pair: Discrepancy) -> ClockDelay | None:
    """The delay that all axes share; None where nothing moves, or samples are too few."""
    if len(pair.time) < _PARTS * _FEWEST or not np.any(pair.rate):
        return None
    delay, std = _by_parts(pair)
    if not np.isfinite(delay):
        return None
    rms = float(np.sqrt(np.mean(pair.rate**2)))
    return ClockDelay(pair.late, pair.reference, delay, std, abs(delay) * rms, pair.unit)


def _in_part(pair: Discrepancy, own: IntArray) -> tuple[float, float]:
    """Delay in one part, and its information, everything else estimated along.

    Of any rate: what of the error goes with its opposite.
    """
    own = own[:: 1 + len(own) // _MOST]
    others = pair.others[own].reshape(-1, pair.others.shape[2])
    late, error = -pair.rate[own].ravel(), pair.error[own].ravel()
    both = np.column_stack([late, error])
    late, error = (both - others @ np.linalg.lstsq(others, both, rcond=None)[0]).T
    weight = float(late @ late)
    return (float(late @ error) / weight if weight > 0.0 else 0.0), weight
