"""Motors and gears that give another torque than their command: gain, ripple, rotor; a harness."""

from __future__ import annotations

import numpy as np

from ...model.robot import Robot
from ...types import Array
from ..joint import JointEffect, JointTorque
from ..motion import Motion
from ..parameter import Parameter, amount, phase, searched
from ..prior import Prior, Scale

_HARMONICS = tuple(2.0**k for k in range(8))
"""First guesses of a ripple's periods in one turn."""
_TURNS = {'minimum': -20.0, 'maximum': 20.0}  # rad


class TorqueConstant(JointTorque):
    """tau = (g - 1) tau_m: the motor gives g times what is measured or commanded.

    Typical: 2 to 10 % off, from magnet temperature and current sensor.
    Signature: a torque residual in proportion to the motor torque, at every speed.
    Source: Gautier and Briot, J. Dyn. Sys. Meas. Control 136 (2014).

    Args:
        gain: True motor torque per measured one.
    """

    id = 'joint_torque_constant'
    needs_motor = True
    title = "a motor's torque constant off its nominal value"
    parameters = (amount('gain', '', 0.1, 3e-4, nominal=1.0, maximum=10.0),)

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """As data sheets and sensors are off."""
        return scale.alike(0.15, scale.gain)

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """What the motor gives beyond its nominal torque; friction is none of it."""
        return (self['gain'] - 1.0) * effort


class MotorConstant(JointTorque):
    """tau = (K / k - 1) tau_m: the motor gives K i where tau_m = k i is said of the current i.

    k is `robot.motor_constant`, or 1 N m/A where nobody states it and efforts are read in A. The
    diagnosis estimates K there, beside all causes; what it says of a constant that is stated is
    `joint_torque_constant`.

    Typical: 0.01 to 1 N m/A for direct drives, 5 to 20 behind gears of 100.
    Signature: a torque in proportion to the current.
    Source: Gautier and Briot, J. Dyn. Sys. Meas. Control 136 (2014).

    Args:
        constant: Torque at the joint of one ampere.
    """

    id = 'motor_constant'
    title = "torque of a joint's motor by its current"
    needs_current = True
    is_fitted = False  # estimated wherever it is unknown, not searched for
    excludes = ('joint_torque_constant',)
    parameters = (Parameter('constant', 'N m/A', 1.0, 0.01, nominal=1.0, above=0.0),)

    def force(self, motion: Motion, hidden: Array) -> Array:
        """What the motor gives beyond the torque that is said."""
        column = motion.column(self.where)
        stated = motion.robot.known_effort_units[column]
        return motion.joint_force(
            self.where, (self['constant'] / stated - 1.0) * motion.effort[:, column]
        )


class TorqueRipple(JointTorque):
    """tau = A sin(k q + phi).

    Typical: 0.1 to 2 N m at 2 to 200 periods a turn, from cogging and harmonic drives.
    Signature: a torque residual that is periodic in the joint angle.
    Source: Tuttle and Seering, IEEE Trans. Robotics and Automation 12 (1996).

    Args:
        amplitude: Largest torque.
        harmonic: Periods in one turn of the joint.
        phase: Phase at joint angle zero.
    """

    id = 'joint_torque_ripple'
    needs_motor = True
    title = "torque ripple that goes round with a joint's angle"
    parameters = (
        amount('amplitude', 'N m', 1.0, 0.02),
        searched('harmonic', '', 50.0, nominal=1.0, above=0.0, maximum=2000.0, guesses=_HARMONICS),
        phase(),
    )

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """By the torques of its joint."""
        slab = 0.1 * scale.torque
        return scale.alike(slab, log_odds=-3.0) if scale.has_angle else None

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """Torque that goes round with the joint."""
        return self['amplitude'] * np.sin(self['harmonic'] * q + self['phase'])

    @classmethod
    def argument(cls, motion: Motion, where: str | None) -> Array | None:
        """The joint's angle."""
        return motion.q[:, motion.column(where)]

    def fastest(self, robot: Robot) -> float:
        """Of small oscillations in one of its wells."""
        return float(np.sqrt(abs(self['amplitude'] * self['harmonic']) * self.mobility(robot)))


_RESTS = (-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0)
"""Guesses of a spring's rest angle [rad], as close as a fit finds its way from: a step from
farther away is shortened to nothing, since stiffness and rest angle are a product."""


class Stiffness(JointTorque):
    """tau = -k (q - q0).

    Typical: 0.5 to 20 N m/rad for harness across joints of space arms.
    Signature: a torque residual in proportion to the joint angle, with an offset.
    Source: Siciliano et al., Robotics: Modelling, Planning and Control (2009), 5.1.

    Args:
        stiffness: Torque towards the rest angle per angle.
        rest_angle: Angle without torque.
    """

    id = 'joint_stiffness'
    title = 'a spring across a joint, such as a cable harness'
    refines = ('torque_sensor_bias',)
    parameters = (
        amount('stiffness', 'N m/rad', 5.0, 0.05),
        searched('rest_angle', 'rad', 1.0, default=0.0, guesses=_RESTS, **_TURNS),
    )

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """By the torques of its joint."""
        slab = 0.3 * scale.torque / scale.range
        return scale.alike(slab, log_odds=-2.0) if scale.has_angle else None

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """Torque towards the rest angle."""
        return -self['stiffness'] * (q - self['rest_angle'])

    def fastest(self, robot: Robot) -> float:
        """Of the joint on its spring."""
        return float(np.sqrt(self['stiffness'] * self.mobility(robot)))


class MotorInertia(JointEffect):
    """tau = -J q'': the motor's rotor, reflected by the gear's ratio squared.

    The rotor spins a gear ratio faster than the joint: of its energy 1/2 J (q' + w/ratio)^2 the
    host's rate w is left out, and its momentum too, as in Pinocchio and MuJoCo.

    Typical: 0.1 to 10 kg m^2 for gear ratios of 50 to 200.
    Signature: a torque residual in proportion to the joint's own acceleration.
    Source: Featherstone, Rigid Body Dynamics Algorithms (2008), 9.6.

    Args:
        inertia: Inertia of the rotor times the gear ratio squared.
    """

    id = 'motor_inertia'
    needs_motor = True
    title = "inertia of a geared motor's rotor"
    parameters = (amount('inertia', 'kg m^2', 3.0, 0.02),)

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """By what the joint turns; a URDF has no place for it, so that few files state it."""
        needed = scale.torque / scale.acceleration
        return scale.alike(max(0.5 * scale.inertia, 0.3 * needed), log_odds=1.0)

    def change(self, robot: Robot) -> Robot:
        """More inertia against the joint's own acceleration."""
        return robot.with_motor_inertia(str(self.where), self['inertia'])
