"""Faults of joint sensors, gyro and star tracker; late stamps."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from ..model.robot import Robot
from ..types import Array
from .effect import Effect
from .joint import JointEffect
from .motion import Motion
from .parameter import Parameter, amount, xyz


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


class JointSensor(SensorFault, JointEffect):
    """A gain, or an offset of any other name, of one channel of one manipulator joint."""

    group = 'sensor'

    def faulty(self, value: Array, motion: Motion) -> Array:
        """The joint's column scaled or shifted."""
        out, column = np.array(value), motion.column(self.where)
        ((name, number),) = self.values.items()
        out[:, column] = out[:, column] * number if name == 'gain' else out[:, column] + number
        return out


class EncoderOffset(JointSensor):
    """q_measured = q + offset.

    Typical: 0.1 to 10 mrad after assembly and launch.
    Signature: torques and momentum of an arm that stands a constant angle elsewhere.
    Source: Roth, Mooring and Ravani, IEEE J. Robotics and Automation 3 (1987).

    Args:
        offset: What the encoder says too much.
    """

    id = 'encoder_offset'
    title = 'wrong zero of an encoder'
    channel = 'joint_position'
    parameters = (Parameter('offset', 'rad', 0.02, 1e-4),)


class EncoderScale(JointSensor):
    """q_measured = gain q.

    Typical: 1e-4 to 1e-2: pulley and gear ratios, potentiometers.
    Signature: positions that grow faster or slower than the integral of the joint rate.
    Source: Hollerbach, Khalil and Gautier, Springer Handbook of Robotics, chapter 8.

    Args:
        gain: What the encoder says per angle.
    """

    id = 'encoder_scale'
    title = 'wrong scale of an encoder'
    channel = 'joint_position'
    parameters = (Parameter('gain', '', 0.01, 3e-4, nominal=1.0, above=0.0),)


class JointRateScale(JointSensor):
    """qd_measured = gain qd.

    Typical: 1e-3 to 3e-2 for tachometers.
    Signature: joint rates in proportion to, but not equal to, the slope of the positions.
    Source: Hollerbach, Khalil and Gautier, Springer Handbook of Robotics, chapter 8.

    Args:
        gain: Joint rate that is reported per true rate.
    """

    id = 'joint_rate_scale'
    title = 'wrong scale of a joint rate'
    channel = 'joint_velocity'
    parameters = (Parameter('gain', '', 0.02, 5e-4, nominal=1.0, above=0.0),)


class TorqueSensorBias(JointSensor):
    """tau_measured = tau + bias.

    Typical: 0.1 to 1 N m: temperature and creep of strain gauges.
    Signature: a constant torque residual of one joint.
    Source: Aksman, Carignan and Akin, IEEE ICRA (2007).

    Args:
        bias: Torque that the sensor says too much.
    """

    id = 'torque_sensor_bias'
    title = 'bias of a torque sensor'
    channel = 'joint_effort'
    needs_motor = True
    parameters = (Parameter('bias', 'N m', 1.0, 0.01),)

    @classmethod
    def fitted_places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Not where efforts are currents, whose zero is `current_offset`."""
        joints = cls.places(robot)
        return tuple(joint for joint in joints if robot.effort_kind(str(joint)) != 'current')


class CurrentOffset(JointSensor):
    """i_measured = i + offset: the torque that is said is off by offset times the motor constant.

    Typical: 0.01 to 0.2 A: Hall sensors, amplifiers of shunts.
    Signature: a constant current of one motor, whatever it does.
    Source: Aksman, Carignan and Akin, IEEE ICRA (2007).

    Args:
        offset: Current that the sensor says too much.
    """

    id = 'current_offset'
    title = 'wrong zero of a current sensor'
    channel = 'joint_effort'
    needs_motor = True
    parameters = (Parameter('offset', 'A', 0.1, 1e-3),)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Every motor whose effort is a current."""
        joints = super().places(robot)
        return tuple(joint for joint in joints if robot.effort_kind(str(joint)) == 'current')

    def faulty(self, value: Array, motion: Motion) -> Array:
        """The joint's torque shifted by that of the offset."""
        out, column = np.array(value), motion.column(self.where)
        out[:, column] += self['offset'] * motion.robot.known_effort_units[column]
        return out


class JointSensorDelay(JointEffect):
    """q, q', tau_measured(t) of one joint are those of t - delay, the other joints' of t.

    Only relative timing is observable. The diagnosis looks for it where a joint has electronics of
    its own kind: at wheels of which only the rate is measured.

    Typical: half the window over which pulses are counted and a bus, 5 to 50 ms.
    Signature: a position error in proportion to the rate of one joint.
    Source: Brown, Schneider and Mulligan, IEEE Trans. Industrial Electronics 39 (1992).

    Args:
        delay: Time by which the joint's position, rate and effort are late.
    """

    group = 'sensor'
    id = 'joint_sensor_delay'
    title = 'samples of a joint later than those of the others'
    parameters = (amount('delay', 's', 0.02, 1e-3, maximum=10.0),)

    @classmethod
    def fitted_places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Joints of which only the rate is measured, unless all are such."""
        return robot.rate_only if len(robot.rate_only) < robot.n_joints else ()

    def joint_delays(self, robot: Robot) -> Array:
        """Its own joint's."""
        out = np.zeros(robot.n_joints)
        out[robot.joints.index(str(self.where))] = self['delay']
        return out


class GyroFault(SensorFault):
    """What a vector x, y, z does to the gyro's rates.

    Source: IEEE Std 952-2020; Markley and Crassidis, Fundamentals of Spacecraft ADCS, 4.7.
    """

    channel = 'gyro'
    needs_free_base = True


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

    def faulty(self, value: Array, motion: Motion) -> Array:
        """Rates turned."""
        return np.asarray(value @ Rotation.from_rotvec(self.vector()).as_matrix().T)


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
        turned = Rotation.from_rotvec(value) * Rotation.from_rotvec(self.vector())
        return np.asarray(turned.as_rotvec())


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
    parameters = _delay(1e-4)


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
    parameters = _delay(1e-4)


class EffortDelay(Delay):
    """Torques that are late beside the rest of the joint states.

    Signature: a torque residual in proportion to the slope of the torque, all joints alike.
    """

    id = 'effort_delay'
    clock = 'effort'
    title = 'torques later than the joint positions that they come with'
    parameters = _delay(5e-4)
