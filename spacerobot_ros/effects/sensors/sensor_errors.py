"""Faults of gyro and star tracker; late stamps."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import scipy

from ...types import Array
from ..effect import Effect
from ..motion import Motion
from ..parameter import Parameter, amount, xyz
from ..prior import Prior, Scale

_CHIP = 20.0
"""Times that faults of a chip are those of a gyro for space: zeros within 2 deg/s, scales within
10 % (data sheets of consumer gyros: 1 to 5 deg/s, 3 to 6 %)."""


_ON_BOARD = 0.03  # rad, by which any two chips are turned against each other


class SensorFault(Effect):
    """What a fault does to one channel of the sensors.

    Its channel is one of `effects.effect.CHANNELS`.
    """

    group = 'sensor'
    channel: ClassVar[str]

    def sense(
        self, channel: str, value: Array, motion: Motion, hidden: Array | None = None
    ) -> Array:
        """The channel's values changed."""
        return self.faulty(value, motion) if channel == self.channel else value

    def faulty(self, value: Array, motion: Motion) -> Array:
        """(N, n) or (N, 3) what the sensor says for true values."""
        raise NotImplementedError


class GyroFault(SensorFault):
    """What a vector x, y, z does to the gyro's rates.

    Source: IEEE Std 952-2020; Markley and Crassidis, Fundamentals of Spacecraft ADCS, 4.7.
    """

    channel = 'gyro'
    needs_free_base = True

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """Of a chip: what is listed is of gyros for space."""
        return scale.alike(_CHIP * scale.sizes)


class GyroBias(GyroFault):
    """omega_measured = omega + b.

    Typical: 1e-6 rad/s (fibre optic) to 1e-3 rad/s (MEMS).
    Signature: an attitude that drifts away from the integral of the rate.

    Args:
        x, y, z: Rate that the gyro says too much about an axis.
    """

    id = 'gyro_bias'
    title = 'bias of the gyro'
    parameters = xyz('rad/s', 1e-3, 1e-5)

    def faulty(self, value: Array, motion: Motion) -> Array:
        """Rates shifted."""
        return value + self.vector()


class GyroDrift(GyroFault):
    """omega_measured = omega + d t, t since the start of the record.

    Typical: 1e-9 rad/s^2 (fibre optic) to 1e-6 rad/s^2 (MEMS that warms up).
    Signature: an attitude that drifts from the integral of the rate with the square of the time.

    Args:
        x, y, z: Rate by which the bias about an axis grows.
    """

    id = 'gyro_drift'
    title = 'bias of the gyro that grows'
    parameters = xyz('rad/s^2', 1e-5, 1e-7)

    def faulty(self, value: Array, motion: Motion) -> Array:
        """Rates shifted by what has grown."""
        return value + motion.time[:, None] * self.vector()


class GyroScale(GyroFault):
    """omega_measured = (1 + s) omega, axis by axis.

    Typical: 1e-5 (fibre optic) to 1e-2 (MEMS).
    Signature: an attitude error that grows with the angle turned about an axis.

    Args:
        x, y, z: Relative error of the scale about an axis.
    """

    id = 'gyro_scale'
    title = 'scale errors of the gyro'
    parameters = xyz('', 5e-3, 1e-4)

    def faulty(self, value: Array, motion: Motion) -> Array:
        """Rates scaled."""
        return value * (1.0 + self.vector())


class GyroMisalignment(GyroFault):
    """omega_measured = exp(skew(r)) omega: what the gyro says is turned by the vector r.

    Typical: 0.1 to 5 mrad after launch.
    Signature: rates about one axis that show up on another.

    Args:
        x, y, z: Rotation vector that turns the true rates to those said.
    """

    id = 'gyro_misalignment'
    title = 'misalignment of the gyro'
    parameters = xyz('rad', 5e-3, 1e-4)

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """Of a chip, which sits on its board within a degree anyway."""
        return scale.alike(_CHIP * scale.sizes, _ON_BOARD)

    def faulty(self, value: Array, motion: Motion) -> Array:
        """Rates turned."""
        return np.asarray(value @ _turn(self.vector()).as_matrix().T)


class AttitudeMisalignment(SensorFault):
    """R_measured = R_WB exp(skew(r)): the tracker's frame is turned by r against the base.

    Typical: 0.05 to 5 mrad between tracker and gyro after launch.
    Signature: attitude increments that are turned against the gyro rates.
    Source: Markley and Crassidis, Fundamentals of Spacecraft ADCS, 6.4.

    Args:
        x, y, z: Rotation vector of the tracker against the base.
    """

    id = 'attitude_misalignment'
    title = 'misalignment of the star tracker'
    channel = 'attitude'
    needs_free_base = True
    parameters = xyz('rad', 5e-3, 1.5e-4)

    def faulty(self, value: Array, motion: Motion) -> Array:
        """Small rotations (N, 3) of the attitude, the fault's behind what was there."""
        return np.asarray((_turn(value) * _turn(self.vector())).as_rotvec())


def _turn(rotation_vector: Array) -> scipy.spatial.transform.Rotation:
    return scipy.spatial.transform.Rotation.from_rotvec(rotation_vector)


def _delay(relevant: float) -> tuple[Parameter, ...]:
    return (amount('delay', 's', 0.02, relevant, maximum=10.0),)


class Delay(Effect):
    """A sample stamped t shows the truth at t - delay, by one of `effects.effect.CLOCKS`.

    Only relative timing is observable: all sensors late alike look punctual.

    Typical: 0.1 to 100 ms: filters, buses, image processing.
    Source: Markley and Crassidis, Fundamentals of Spacecraft ADCS, 4.2.

    Args:
        delay: Time by which the stamps are late.
    """

    group = 'sensor'
    clock: ClassVar[str]
    parameters = _delay(1e-4)

    def delay(self, clock: str) -> float:
        """The delay, for its own clock."""
        return self['delay'] if clock == self.clock else 0.0


class ImuDelay(Delay):
    """A late gyro.

    Signature: a rate residual in proportion to the angular acceleration of the base.
    """

    id = 'imu_delay'
    clock = 'imu'
    title = 'late gyro'
    needs_free_base = True


class AttitudeDelay(Delay):
    """A late star tracker.

    Signature: an attitude residual in proportion to the rate of the base.
    """

    id = 'attitude_delay'
    clock = 'attitude'
    title = 'late star tracker'
    needs_free_base = True
    parameters = _delay(1.5e-4)


class JointDelay(Delay):
    """Late joint states, the torques included.

    Signature: a position residual in proportion to the joint rates, all joints alike.
    """

    id = 'joint_delay'
    clock = 'joints'
    title = 'late joint states'

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """Torques are late with the motion that they belong to."""
        return None


class EffortDelay(Delay):
    """Torques that are late beside the rest of the joint states.

    Signature: a torque residual in proportion to the slope of the torque, all joints alike.
    """

    id = 'effort_delay'
    clock = 'effort'
    title = 'torques later than the joint positions that they come with'
    parameters = _delay(5e-4)

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """Of buses and filters [s]."""
        return scale.alike(max(0.01, scale.interval))
