"""Faults of the sensors of single joints."""

from __future__ import annotations

import numpy as np

from ...model.robot import Robot
from ...types import Array
from ..joint import JointEffect
from ..motion import Motion
from ..parameter import Parameter, amount
from ..prior import BY_DIRECTION, Prior, Scale
from .sensor_errors import SensorFault


class JointSensor(SensorFault, JointEffect):
    """A gain, or an offset of any other name, of one channel of one manipulator joint."""

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

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """As zeros are set by hand [rad]."""
        return scale.alike(0.02) if scale.has_angle else None


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

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """Bodies and gravity of such a size are told from it by no torque."""
        return None


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

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """The smoothed motion is that of the angles."""
        return None


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
    def prior(cls, scale: Scale) -> Prior | None:
        """A zero that is off may be as large as a weight that efforts leave out."""
        return scale.alike(0.3 * scale.needed, BY_DIRECTION * scale.dry)

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
    needs_current = True
    parameters = (Parameter('offset', 'A', 0.1, 1e-3),)

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """As a bias of the torque."""
        slab, spike = 0.3 * scale.needed, BY_DIRECTION * scale.dry
        return scale.alike(slab / scale.unit, spike / scale.unit)

    def faulty(self, value: Array, motion: Motion) -> Array:
        """The joint's torque shifted by that of the offset."""
        out, column = np.array(value), motion.column(self.where)
        out[:, column] += self['offset'] * motion.robot.known_effort_units[column]
        return out


class JointSensorDelay(JointEffect):
    """q, q', tau_measured(t) of one joint are those of t - delay, the other joints' of t.

    Only relative timing is observable. The diagnosis looks for it where a joint has electronics of
    its own kind, at wheels of which only the rate is measured, and at the joints of a free base.

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
    def prior(cls, scale: Scale) -> Prior | None:
        """Of buses and filters [s]."""
        return scale.alike(max(0.01, scale.interval))

    @classmethod
    def fitted_places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Joints of a free base; of an arm on the ground those whose rate alone is measured.

        None where there is no other joint to be late by. In balances of torques, delays of single
        joints would be ghosts of poor excitation.
        """
        if robot.is_free:
            return cls.places(robot) if robot.n_joints > 1 else ()
        return robot.rate_only if len(robot.rate_only) < robot.n_joints else ()

    def joint_delays(self, robot: Robot) -> Array:
        """Its own joint's."""
        out = np.zeros(robot.n_joints)
        out[robot.joints.index(str(self.where))] = self['delay']
        return out
