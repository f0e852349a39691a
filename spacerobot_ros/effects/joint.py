"""Joints: friction, and motors and gears that give another torque than their command.

Friction is a torque against the joint rate, whatever the motor does; the others are the motor's
gain, ripple and rotor, and a harness.
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from ..model.robot import Robot
from ..types import Array
from .effect import Effect
from .motion import Motion, inverse_mass
from .parameter import Parameter, amount, phase, searched

STICTION_RATE = 2e-3
"""Rate over which dry friction changes its sign [rad/s]: sign(v) is smoothed to tanh(v / this)."""


_FALLS = (0.005, 0.015, 0.05, 0.15)
"""First guesses of the rate over which friction falls [rad/s]."""
_HARMONICS = tuple(2.0**k for k in range(8))
"""First guesses of a ripple's periods in one turn."""
_TURNS = {'minimum': -20.0, 'maximum': 20.0}  # rad


class JointEffect(Effect):
    """An effect at a manipulator joint; of a sliding joint its torques are forces.

    Attributes of the kinds:
        needs_motor: Whether a joint without a motor shows nothing of it.
    """

    group = 'joint'
    needs_motor: ClassVar[bool] = False

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Every manipulator joint, with a motor where it takes one."""
        passive = robot.passive_joints if cls.needs_motor else ()
        return tuple(joint for joint in robot.arm if joint not in passive)

    def mobility(self, robot: Robot) -> float:
        """Acceleration of the joint by its own torque, all joints at zero [1/(kg m^2)]."""
        column = 6 + robot.joints.index(str(self.where))
        return float(inverse_mass(robot)[column, column])


class JointTorque(JointEffect):
    """A torque on one joint that its own angle, rate and motor torque decide."""

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque at its joint."""
        column = motion.column(self.where)
        torque = self.torque(motion.q[:, column], motion.qd[:, column], motion.effort[:, column])
        return motion.joint_force(self.where, torque)

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """(N,) torque on the joint [N m].

        Args:
            q: (N,) its position [rad].
            qd: (N,) its rate [rad/s].
            effort: (N,) its motor torque [N m].
        """
        raise NotImplementedError


def direction(qd: Array) -> Array:
    """Smoothed sign of a joint rate."""
    return np.tanh(qd / STICTION_RATE)


class ViscousFriction(JointTorque):
    """tau = -c q'.

    Typical: 0.1 to 30 N m s/rad for harmonic drives of space arms.
    Signature: a torque residual in proportion to the joint rate.
    Source: Armstrong-Helouvry et al., Automatica 30 (1994).

    Args:
        coefficient: Torque against the joint rate, per rate.
    """

    id = 'joint_viscous_friction'
    title = 'viscous friction in a joint'
    parameters = (amount('coefficient', 'N m s/rad', 10.0, 0.05),)

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """Torque against the joint rate."""
        return -self['coefficient'] * qd

    def fastest(self, robot: Robot) -> float:
        """Rate at which the joint comes to rest."""
        return self['coefficient'] * self.mobility(robot)


class CoulombFriction(JointTorque):
    """tau = -T sign(q').

    Typical: 0.1 to 5 N m for harmonic drives of space arms.
    Signature: a torque residual that jumps whenever the joint reverses.
    Source: Armstrong-Helouvry et al., Automatica 30 (1994).

    Args:
        torque: Torque of constant size against the direction of motion.
    """

    id = 'joint_coulomb_friction'
    title = 'Coulomb friction in a joint'
    parameters = (amount('torque', 'N m', 3.0, 0.01),)

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """Torque of constant size against the joint rate."""
        return -self['torque'] * direction(qd)

    def fastest(self, robot: Robot) -> float:
        """Decay rate about rest, where the smoothed sign is a strong viscous friction."""
        return self['torque'] / STICTION_RATE * self.mobility(robot)


class AsymmetricFriction(JointTorque):
    """tau = -F sign(q') forward, -B sign(q') backward.

    While the joint moves this is Coulomb friction of (F + B) / 2 and a torque sensor's bias of
    (F - B) / 2, which the diagnosis names instead: only at rest is the bias felt alone.

    Typical: a tenth to a third of the Coulomb torque between the directions, for loaded gears.
    Signature: as Coulomb friction, with a constant torque while the joint moves.
    Source: Armstrong-Helouvry et al., Automatica 30 (1994).

    Args:
        forward: Torque against motion along the joint's axis.
        backward: Torque against motion the other way.
    """

    id = 'joint_asymmetric_friction'
    title = 'Coulomb friction of another size in each direction'
    is_fitted = False
    parameters = (amount('forward', 'N m', 3.0, 0.01), amount('backward', 'N m', 3.0, 0.01))

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """Torque against the joint rate, by its sign."""
        towards = direction(qd)
        size = np.where(towards > 0.0, self['forward'], self['backward'])
        return np.asarray(-size * towards)

    def fastest(self, robot: Robot) -> float:
        """As of Coulomb friction, of the larger torque."""
        return max(self['forward'], self['backward']) / STICTION_RATE * self.mobility(robot)


class StribeckFriction(JointTorque):
    """tau = -(T + (S - T) exp(-(q'/v)^2)) sign(q').

    Typical: static torque 1.1 to 2 times the Coulomb one, falling over 0.003 to 0.1 rad/s.
    Signature: as Coulomb friction, with a peak of the residual at every start and reversal.
    Source: Armstrong-Helouvry et al., Automatica 30 (1994).

    Args:
        coulomb: Torque against the direction of fast motion.
        static: Torque against the direction of slow motion.
        velocity: Rate over which it falls from the static to the Coulomb torque.
    """

    id = 'joint_stribeck_friction'
    title = 'dry friction that falls as a joint gets moving'
    refines = ('joint_coulomb_friction',)
    parameters = (
        amount('coulomb', 'N m', 3.0, 0.01),
        amount('static', 'N m', 4.0, 0.01, beyond='coulomb'),
        searched(
            'velocity',
            'rad/s',
            0.1,
            nominal=0.01,
            above=STICTION_RATE,
            maximum=10.0,
            guesses=_FALLS,
        ),
    )

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """Torque that falls from its static to its Coulomb value as the joint gets moving."""
        share = np.exp(-((qd / self['velocity']) ** 2))
        size = self['coulomb'] + (self['static'] - self['coulomb']) * share
        return -size * direction(qd)

    def canonical(self) -> Effect:
        """Without a static torque below the Coulomb one."""
        static = max(self['static'], self['coulomb'])
        return replace(self, values={**self.values, 'static': static})

    def check(self, robot: Robot) -> None:
        """The static torque is the larger one."""
        if self['static'] < self['coulomb']:
            raise self.refusal(
                f'{self["static"]:g} N m is less than the Coulomb torque of '
                f'{self["coulomb"]:g} N m, which it exceeds at rest',
                'static',
            )

    def fastest(self, robot: Robot) -> float:
        """As of Coulomb friction, of the static torque."""
        return self['static'] / STICTION_RATE * self.mobility(robot)


class FrictionCurvature(JointTorque):
    """tau = -k (sqrt(x) - 4/15 - 4/5 x) sign(q') with x = min(|q'| / v, 1).

    What a law of Coulomb and viscous friction misses of one that bends towards the axis of the
    rate, as that of grease does. The two numbers taken off make it orthogonal to both over all
    rates up to v, so that theirs keep their meaning: int_0^1 (sqrt(x) - 4/15 - 4/5 x) x^i dx = 0
    for i = 0, 1. It takes 4/15 k from the Coulomb friction at the lowest rates.

    Typical: 0.3 to 3 times the Coulomb torque for greased harmonic drives.
    Signature: a torque residual that bends towards the axis of the joint rate.
    Source: Tuttle and Seering, IEEE Trans. Robotics and Automation 12 (1996).

    Args:
        torque: k, torque against the joint rate by which the law bends.
        rate: v, the fastest rate at which it does.
    """

    id = 'joint_friction_curvature'
    title = 'friction that grows ever less with the joint rate'
    excludes = ('joint_friction_curvature',)
    parameters = (
        amount('torque', 'N m', 3.0, 0.01),
        searched('rate', 'rad/s', 1.0, nominal=1.0, above=0.0, maximum=100.0, guesses=(0.3, 1.0)),
    )

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """Torque against the joint rate beyond a straight law."""
        x = np.minimum(np.abs(qd) / self['rate'], 1.0)
        return -self['torque'] * (np.sqrt(x) - 4.0 / 15.0 - 0.8 * x) * direction(qd)

    def fastest(self, robot: Robot) -> float:
        """Decay rate about rest, where the smoothed sign is a strong viscous friction."""
        return self['torque'] / STICTION_RATE * self.mobility(robot)


class LoadFriction(JointTorque):
    """tau = -mu |tau_m| sign(q').

    Typical: 0.02 to 0.2 of the motor torque for loaded harmonic drives and gears.
    Signature: a torque residual that jumps at reversals by an amount that follows the torque.
    Source: Gogoussis and Donath, IEEE Int. Conf. Robotics and Automation (1987).

    Args:
        coefficient: Torque against the direction of motion per motor torque.
    """

    id = 'joint_load_friction'
    needs_motor = True
    title = 'friction in proportion to the load of a joint'
    parameters = (amount('coefficient', '', 0.1, 1e-3, maximum=1.0),)

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """Torque against the joint rate in proportion to the motor torque."""
        return -self['coefficient'] * np.abs(effort) * direction(qd)


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
    needs_motor = True
    is_fitted = False  # estimated wherever it is unknown, not searched for
    excludes = ('joint_torque_constant',)
    parameters = (Parameter('constant', 'N m/A', 1.0, 0.01, nominal=1.0, above=0.0),)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Every motor whose effort is a current."""
        joints = super().places(robot)
        return tuple(joint for joint in joints if robot.effort_kind(str(joint)) == 'current')

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

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """Torque towards the rest angle."""
        return -self['stiffness'] * (q - self['rest_angle'])

    def fastest(self, robot: Robot) -> float:
        """Of the joint on its spring."""
        return float(np.sqrt(self['stiffness'] * self.mobility(robot)))


class MotorInertia(JointEffect):
    """tau = -J q'': the motor's rotor, reflected by the gear's ratio squared.

    The rotor spins a gear ratio faster than the joint: of its energy 1/2 J (q' + w/ratio)^2 the
    carrier's rate w is left out, and its momentum too, as in Pinocchio and MuJoCo.

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

    def change(self, robot: Robot) -> Robot:
        """More inertia against the joint's own acceleration."""
        return robot.with_motor_inertia(str(self.where), self['inertia'])
