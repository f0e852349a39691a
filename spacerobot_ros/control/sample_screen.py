"""Samples that contradict their forerunners, left out before a law acts on them.

As `identification.outliers`, for who can not wait for the samples that follow. A rate is compared
with a line through the last two, a position with the integral of the rates, an attitude with the
gyro's; lines are trusted to what rates changed by in one of the last steps, however seldom samples
come: what is left out of good samples makes a law swing with what stands in for them. One
that is doubted is believed once the next agrees with it: a blow or a turn of a tracker costs two
samples. What wanders without sense passes once a machine could have come as far meanwhile (a rate
that scatters by 0.3 rad/s after 16 samples at 100 Hz, median of 40 seeds), or at last, after 26,
as the sensor's own noise: it is most of what is remembered. Where axes of an arm come into line
rates turn within a period: a sample is believed that is at most half as far from what the
equations of motion foretold as from the line, and faults no larger than that turn pass with it.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from typing import NamedTuple

import numpy as np

from ..dynamics.rotation import rotation_between
from ..identification.outliers import FURTHEST
from ..model.control_settings import ControllerSettings
from ..model.robot_settings import SensorSettings
from ..recording.faults.neighbours import NORMAL
from ..types import Array, Quaternion, Vector3
from .command import NS, Feedback

_REMEMBERED = 50  # errors, by whose median magnitude noise is known where it is more than stated
_CHANGES = 5
"""Periods whose changes of a rate say what it may change by: where a rate turns, the last one is
next to nothing, and a sixth of a turn before it was most of what it ever is. The largest of all
joints, or axes, counts, for they push each other."""
_SURE = 6.0  # twice the logarithm of twenty: odds at which a position confirms a rate


class ErrorScale:
    """How large the errors of a prediction usually are.

    Args:
        std: Stated standard deviation of a sample; zero where none is.
    """

    def __init__(self, std: float) -> None:
        self.stated = FURTHEST * std
        self._errors: deque[Array] = deque(maxlen=_REMEMBERED)

    def limit(self, error: Array, spread: float) -> Array | float:
        """Magnitude (m,) that an error (m,) may have; one for all where what is stated serves.

        Args:
            error: Remembered from now on.
            spread: Its standard deviation by that of a sample.
        """
        error = np.abs(error) / spread
        self._errors.append(error)
        if not (error > self.stated).any():
            return self.stated * spread
        with np.errstate(invalid='ignore', over='ignore'):
            usual = NORMAL * np.median(np.array(self._errors), axis=0)
            limit = np.maximum(self.stated, FURTHEST * usual)
        limit[limit == 0.0] = np.inf  # nothing stated, nothing seen
        return np.asarray(limit * spread)

    def is_nearer(self, value: Array, foretold: Array | None, error: Array) -> bool:
        """Whether values (m,) are as foretold, rather than off by an error (m,)."""
        if foretold is None:
            return False
        return _largest(value - foretold) <= max(0.5 * _largest(error), self.stated)


class Doubt(NamedTuple):
    """How rates (m,) look beside those before.

    Attributes:
        off: How far each is off the line through the last two, zero within the limit; None: none.
        is_repeated: Whether they are as the last ones that were doubted.
    """

    off: Array | None = None
    is_repeated: bool = False


class RateGate:
    """Tells which rates (m,) contradict their forerunners.

    Args:
        std: Of a sample.
    """

    def __init__(self, std: float) -> None:
        self._scale = ErrorScale(std)
        self._last: list[tuple[float, Array]] = []
        self._slopes: deque[float] = deque(maxlen=_CHANGES)  # the largest of each period
        self._period = 0.0
        self._doubted: tuple[Array, Array] | None = None  # a rate, and how far it was off

    def predicted(self, time: float) -> Array | None:
        """The rate at a time [s]; None while too few are known."""
        if len(self._last) < 2:
            return None
        (t0, x0), (t1, x1) = self._last
        return np.asarray(x1 + (x1 - x0) * ((time - t1) / (t1 - t0)))

    def look(self, time: float, rate: Array, foretold: Array | None = None) -> Doubt:
        """Compare a rate at a time [s], later than all before, with them."""
        doubted, self._doubted = self._doubted, None
        expected = self.predicted(time)
        if expected is None:
            return Doubt()
        (t0, _), (t1, _) = self._last
        ahead, error = (time - t1) / (t1 - t0), rate - expected
        limit = self._scale.limit(error, math.sqrt(1.0 + (1.0 + ahead) ** 2 + ahead**2))
        limit = limit + (time - t1) * max(self._slopes)
        is_within = np.abs(error) <= limit
        if is_within.all():
            return Doubt()
        off = np.where(is_within, 0.0, error)
        self._doubted = rate, error
        if self._scale.is_nearer(rate, foretold, error):
            return Doubt()
        if doubted is None:
            return Doubt(off)
        half = 0.5 * doubted[1]  # a jump stays as it is, a slope that sets in adds as much again
        is_repeated = np.all(np.abs(rate - doubted[0] - half) <= limit + np.abs(half))
        return Doubt(off, bool(is_repeated))

    def largest_change(self, time: float, rate: Array) -> float:
        """Of any rate since the last sample, or by the largest slope before it over as long."""
        if not self._last:
            return 0.0
        t1, x1 = self._last[-1]
        return max(_largest(rate - x1), (time - t1) * max(self._slopes, default=0.0))

    @property
    def usual_change(self) -> float:
        """The largest of any rate in one of the last periods."""
        return self._period * max(self._slopes, default=0.0)

    def take(self, time: float, rate: Array) -> None:
        """Believe a rate at a time [s]."""
        if self._last:
            t1, x1 = self._last[-1]
            self._period = time - t1
            self._slopes.append(_largest(rate - x1) / self._period)
        self._last, self._doubted = [*self._last[-1:], (time, rate)], None


class JointGate:
    """Tells which joint samples contradict their forerunners, and what stands in for them.

    Positions and rates are each other's witness. With x the error of the trapezoidal rule over a
    period T and s its standard deviation, a sample is believed where

        |x| <= 6 s + a T^2 / 2,    a: largest mean acceleration of this period and the last five,

    as rates may lag behind positions by half a period, and turn within one (a T^2 / 4 where no
    acceleration is above twice that mean); and, for a rate that is off its line by d, where the
    position agrees with it rather than with the line, twenty to one:

        y^2 - x^2 > 6 s^2,    y = x + T d / 2.

    So torques that set in within the first half of a period cost nothing where the position shows
    a wrong rate; where noise hides it, either mistake is off by the same small d.

    Args:
        position_std: Of a sample [rad].
        velocity_std: Of a sample [rad/s].
    """

    def __init__(self, position_std: float, velocity_std: float) -> None:
        self._rates = RateGate(velocity_std)
        self._std, self._scale = position_std, ErrorScale(position_std)
        self._stood: tuple[Array, Array] | None = None  # positions, and since when they are so
        self._last: tuple[float, Array, Array] | None = None
        self._doubted: tuple[float, Array, Array] | None = None

    def silence(self, time: float) -> float:
        """Time since the last sample that was believed [s]."""
        return 0.0 if self._last is None else time - self._last[0]

    def is_doubtful(self, time: float, q: Array, qd: Array, foretold: Feedback | None) -> bool:
        """Whether a sample q (n,), qd (n,) at a time [s] contradicts those before."""
        last, doubted = self._last, self._doubted
        is_far = self._is_stuck(time, q, qd)
        soon = (None, None) if foretold is None else (foretold.q, foretold.qd)
        off, is_repeated = self._rates.look(time, qd, soon[1])
        if last is not None:
            error = _position_error(last, time, q, qd)
            noise, half = self._scale.limit(error, math.sqrt(2.0)), 0.5 * (time - last[0])
            x, limit = np.abs(error), noise + half * self._rates.largest_change(time, qd)
            goes_on = (x <= limit).all() or self._scale.is_nearer(q, soon[0], error)
            if goes_on and off is not None:
                y = np.abs(error + half * off)
                is_real = y - x > _SURE * (noise / FURTHEST) ** 2 / (y + x + np.finfo(float).tiny)
                goes_on = np.all(is_real | (off == 0.0))
            if not goes_on and doubted is not None and (is_repeated or off is None):
                goes_on = np.all(np.abs(_position_error(doubted, time, q, qd)) <= limit)
            is_far = is_far or not goes_on
        self._doubted = (time, q, qd) if is_far else None
        if not is_far:
            self._rates.take(time, qd)
            self._last = time, q, qd
        return is_far

    def _is_stuck(self, time: float, q: Array, qd: Array) -> bool:
        """Whether a joint stands to the last bit, while its rate says that it moved."""
        before, since = self._stood or (q, np.full(len(q), time))
        same = q == before
        since = np.where(same, since, time)
        self._stood = q, since
        if not (self._std and same.any()):
            return False
        return bool((np.abs(qd) * (time - since) > FURTHEST * self._std).any())

    def stand_in(self, time: float, furthest: float) -> tuple[Array, Array]:
        """Position and rate at a time by the last samples believed, as of `furthest` ahead [s]."""
        if self._last is None:
            raise ValueError('nothing was believed yet')
        last, q, qd = self._last
        time = min(time, last + furthest)
        rate = self._rates.predicted(time)
        rate = qd if rate is None else rate
        return q + 0.5 * (time - last) * (qd + rate), rate


def _largest(values: Array) -> float:
    """Largest magnitude; zero of none."""
    return float(np.maximum.reduce(np.abs(values), initial=0.0))


def _position_error(last: tuple[float, Array, Array], time: float, q: Array, qd: Array) -> Array:
    """By how much a position is off the integral of the rates since another sample."""
    start, q0, qd0 = last
    return np.asarray(q - q0 - 0.5 * (time - start) * (qd0 + qd))


class AttitudeGate:
    """Tells which attitudes leave what the gyro says since the one before.

    Args:
        std: Of a sample [rad].
    """

    def __init__(self, std: float) -> None:
        self._scale = ErrorScale(std)
        self._doubted: Array | None = None

    def is_doubtful(self, error: Array, bend: float) -> bool:
        """Whether a turn (3,) [rad] from the predicted attitude to the measured is too large.

        Args:
            error: The turn.
            bend: What the integral of the gyro's rates may be off by [rad].
        """
        doubted, self._doubted = self._doubted, None
        limit = self._scale.limit(error, math.sqrt(2.0)) + bend
        seen = [error] if doubted is None else [error, error - doubted]
        if any(np.all(np.abs(off) <= limit) for off in seen):
            return False
        self._doubted = error
        return True


class SampleScreen:
    """Gates of all sensors; what comes after a pause is compared with nothing.

    Args:
        sensors: Standard deviations of a sample.
        settings: When a sensor is stale.

    Attributes:
        left_out: Samples that contradict their forerunners, by sensor.
    """

    def __init__(self, sensors: SensorSettings, settings: ControllerSettings) -> None:
        names = ('joint_position', 'joint_velocity', 'gyro', 'attitude')
        self._std = {name: sensors.std(name) or 0.0 for name in names}
        self._timeout, self._attitude_timeout = settings.state_timeout, settings.attitude_timeout
        self.left_out: Counter[str] = Counter()
        self.reset()

    def reset(self) -> None:
        """Compare the next samples with nothing."""
        self._newest: dict[str, float] = {}
        self._joints = JointGate(self._std['joint_position'], self._std['joint_velocity'])
        self._rates = RateGate(self._std['gyro'])
        self._attitudes = AttitudeGate(self._std['attitude'])

    def joints(
        self, stamp_ns: int, q: Array, qd: Array, foretold: Feedback | None = None
    ) -> tuple[Array, Array]:
        """Position and rate at a stamp: the measured ones, or what stands in for them."""
        time = stamp_ns * NS
        if self._is_after_pause('joints', time, self._timeout):
            self._joints = JointGate(self._std['joint_position'], self._std['joint_velocity'])
        if not self._joints.is_doubtful(time, q, qd, foretold):
            return q, qd
        self.left_out['joints'] += 1
        return self._joints.stand_in(time, self._timeout)

    def believes(self, stamp_ns: int) -> bool:
        """Whether the joint sample of a stamp was believed."""
        return self._joints.silence(stamp_ns * NS) == 0.0

    def is_lost(self, stamp_ns: int) -> bool:
        """Whether no joint sample was believed for so long that nothing can stand in."""
        return self._joints.silence(stamp_ns * NS) > self._timeout

    def takes_rate(
        self, stamp_ns: int, omega_WB_B: Vector3, foretold: Feedback | None = None
    ) -> bool:
        """Whether a gyro sample is to be used."""
        time = stamp_ns * NS
        if self._is_after_pause('imu', time, self._timeout):
            self._rates = RateGate(self._std['gyro'])
        soon = None if foretold is None else foretold.omega_WB_B
        off, is_repeated = self._rates.look(time, omega_WB_B, soon)
        if off is not None and not is_repeated:
            self.left_out['imu'] += 1
            return False
        self._rates.take(time, omega_WB_B)
        return True

    def takes_attitude(
        self, stamp_ns: int, q_WB_xyzw: Quaternion, predicted: Quaternion | None
    ) -> bool:
        """Whether an attitude is to be used, where the one before and the gyro predict another."""
        time = stamp_ns * NS
        since = time - self._newest.get('attitude', time)
        if self._is_after_pause('attitude', time, self._attitude_timeout):
            self._attitudes = AttitudeGate(self._std['attitude'])
        elif predicted is not None and self._attitudes.is_doubtful(
            rotation_between(predicted, q_WB_xyzw), 0.5 * since * self._rates.usual_change
        ):
            self.left_out['attitude'] += 1
            return False
        return True

    def _is_after_pause(self, sensor: str, time: float, longest: float) -> bool:
        last = self._newest.get(sensor, -float('inf'))
        self._newest[sensor] = time
        return time - last > longest
