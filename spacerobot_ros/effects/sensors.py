"""Faults of joint sensors, gyro and star tracker."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..model.robot import Robot
from ..types import Array
from .effect import Effect, Parameter, Values
from .motion import Motion

_GYRO_SOURCE = 'IEEE Std 952-2020; Markley and Crassidis, Fundamentals of Spacecraft ADCS, 4.7'


def xyz(unit: str, doc: str, *, size: float, relevant: float) -> tuple[Parameter, ...]:
    """Three parameters x, y, z of a vector; `doc` ends before the axis."""
    return tuple(
        Parameter(
            name=axis,
            unit=unit,
            doc=f'{doc} {axis}.',
            default=0.0,
            size=size,
            relevant=relevant,
        )
        for axis in 'xyz'
    )


def vector(values: Values, names: tuple[str, str, str] = ('x', 'y', 'z')) -> Array:
    """(3,) of three parameters."""
    return np.array([values[name] for name in names])


@dataclass(frozen=True, kw_only=True)
class JointSensor(Effect):
    """A gain and an offset of one channel of one manipulator joint: gain * value + offset.

    Args:
        channel: One of `effects.effect.CHANNELS`.
    """

    channel: str

    def places(self, robot: Robot) -> tuple[str | None, ...]:
        """Every manipulator joint."""
        return robot.joints[: robot.n_joints - robot.rotor_count]

    def sense(
        self,
        channel: str,
        value: Array,
        motion: Motion,
        where: str | None,
        values: Values,
        hidden: Array,
    ) -> Array:
        """The joint's column scaled and shifted."""
        if channel != self.channel:
            return value
        out = np.array(value)
        column = motion.robot.joints.index(str(where))
        ((name, number),) = values.items()
        out[:, column] = out[:, column] * number if name == 'gain' else out[:, column] + number
        return out


class GyroFault(Effect):
    """What a vector does to the gyro's rates."""

    def sense(
        self,
        channel: str,
        value: Array,
        motion: Motion,
        where: str | None,
        values: Values,
        hidden: Array,
    ) -> Array:
        """The gyro's rates changed."""
        return self.said(value, vector(values)) if channel == 'gyro' else value

    def said(self, omega: Array, fault: Array) -> Array:
        """(N, 3) what the gyro says.

        Args:
            omega: (N, 3) rates [rad/s].
            fault: (3,) the effect's parameters.
        """
        raise NotImplementedError


class GyroBias(GyroFault):
    """omega_measured = omega + b."""

    def said(self, omega: Array, fault: Array) -> Array:
        """Rates shifted."""
        return omega + fault


class GyroScale(GyroFault):
    """omega_measured = (1 + s) omega, axis by axis."""

    def said(self, omega: Array, fault: Array) -> Array:
        """Rates scaled."""
        return omega * (1.0 + fault)


class GyroMisalignment(GyroFault):
    """omega_measured = exp(skew(r)) omega: what the gyro says is turned by the vector r."""

    def said(self, omega: Array, fault: Array) -> Array:
        """Rates turned."""
        return np.asarray(omega @ Rotation.from_rotvec(fault).as_matrix().T)


class AttitudeMisalignment(Effect):
    """R_measured = R_WB exp(skew(r)): the tracker's frame is turned by r against the base."""

    def sense(
        self,
        channel: str,
        value: Array,
        motion: Motion,
        where: str | None,
        values: Values,
        hidden: Array,
    ) -> Array:
        """Small rotations (N, 3) of the attitude, the fault's behind what was there."""
        if channel != 'attitude':
            return value
        turned = Rotation.from_rotvec(value) * Rotation.from_rotvec(vector(values))
        return np.asarray(turned.as_rotvec())


EFFECTS = (
    JointSensor(
        id='encoder_offset',
        title='wrong zero of an encoder',
        group='sensor',
        channel='joint_position',
        parameters=(
            Parameter(
                name='offset',
                unit='rad',
                doc='What the encoder says too much.',
                size=0.02,
                relevant=1e-4,
            ),
        ),
        magnitude='0.1 to 10 mrad after assembly and launch',
        signature='torques and momentum of an arm that stands a constant angle elsewhere',
        source='Roth, Mooring and Ravani, IEEE J. Robotics and Automation 3 (1987)',
    ),
    JointSensor(
        id='encoder_scale',
        title='wrong scale of an encoder',
        group='sensor',
        channel='joint_position',
        parameters=(
            Parameter(
                name='gain',
                unit='',
                doc='What the encoder says per angle.',
                nominal=1.0,
                above=0.0,
                size=0.01,
                relevant=3e-4,
            ),
        ),
        magnitude='1e-4 to 1e-2: pulley and gear ratios, potentiometers',
        signature='positions that grow faster or slower than the integral of the joint rate',
        source='Hollerbach, Khalil and Gautier, Springer Handbook of Robotics, chapter 8',
    ),
    JointSensor(
        id='joint_rate_scale',
        title='wrong scale of a joint rate',
        group='sensor',
        channel='joint_velocity',
        parameters=(
            Parameter(
                name='gain',
                unit='',
                doc='Joint rate that is reported per true rate.',
                nominal=1.0,
                above=0.0,
                size=0.02,
                relevant=5e-4,
            ),
        ),
        magnitude='1e-3 to 3e-2 for tachometers',
        signature='joint rates in proportion to, but not equal to, the slope of the positions',
        source='Hollerbach, Khalil and Gautier, Springer Handbook of Robotics, chapter 8',
    ),
    JointSensor(
        id='torque_sensor_bias',
        title='bias of a torque sensor',
        group='sensor',
        channel='joint_effort',
        parameters=(
            Parameter(
                name='bias',
                unit='N m',
                doc='Torque that the sensor says too much.',
                size=1.0,
                relevant=0.01,
            ),
        ),
        magnitude='0.1 to 1 N m: temperature and creep of strain gauges',
        signature='a constant torque residual of one joint',
        source='Aksman, Carignan and Akin, IEEE ICRA (2007)',
    ),
    GyroBias(
        id='gyro_bias',
        title='bias of the gyro',
        group='sensor',
        parameters=xyz(
            'rad/s', 'Rate that the gyro says too much about', size=1e-3, relevant=1e-5
        ),
        needs_free_base=True,
        magnitude='1e-6 rad/s (fibre optic) to 1e-3 rad/s (MEMS)',
        signature='an attitude that drifts away from the integral of the rate',
        source=_GYRO_SOURCE,
    ),
    GyroScale(
        id='gyro_scale',
        title='scale errors of the gyro',
        group='sensor',
        parameters=xyz('', 'Relative error of the scale about', size=5e-3, relevant=1e-4),
        needs_free_base=True,
        magnitude='1e-5 (fibre optic) to 1e-2 (MEMS)',
        signature='an attitude error that grows with the angle turned about an axis',
        source=_GYRO_SOURCE,
    ),
    GyroMisalignment(
        id='gyro_misalignment',
        title='misalignment of the gyro',
        group='sensor',
        parameters=xyz(
            'rad',
            'Rotation vector that turns the true rates to those said, about',
            size=5e-3,
            relevant=1e-4,
        ),
        needs_free_base=True,
        magnitude='0.1 to 5 mrad after launch',
        signature='rates about one axis that show up on another',
        source=_GYRO_SOURCE,
    ),
    AttitudeMisalignment(
        id='attitude_misalignment',
        title='misalignment of the star tracker',
        group='sensor',
        parameters=xyz(
            'rad',
            'Rotation vector of the tracker against the base, about',
            size=5e-3,
            relevant=1.5e-4,
        ),
        needs_free_base=True,
        magnitude='0.05 to 5 mrad between tracker and gyro after launch',
        signature='attitude increments that are turned against the gyro rates',
        source='Markley and Crassidis, Fundamentals of Spacecraft ADCS, 6.4',
    ),
)
