"""Motors and gears that give another torque than their command: gain, ripple, harness, rotor."""

from __future__ import annotations

import numpy as np

from ..model.robot import Robot
from ..types import Array
from .effect import Parameter, Values
from .joint import JointEffect, JointTorque, column_of, mobility
from .motion import Motion


class TorqueConstant(JointTorque):
    """tau = (g - 1) tau_m: the motor gives g times what is measured or commanded."""

    def torque(self, q: Array, qd: Array, effort: Array, values: Values) -> Array:
        """What the motor gives beyond its nominal torque; friction is none of it."""
        return (values['gain'] - 1.0) * effort


class TorqueRipple(JointTorque):
    """tau = A sin(k q + phi)."""

    def torque(self, q: Array, qd: Array, effort: Array, values: Values) -> Array:
        """Torque that goes round with the joint."""
        return values['amplitude'] * np.sin(values['harmonic'] * q + values['phase'])

    def argument(self, motion: Motion, where: str | None) -> Array | None:
        """The joint's angle."""
        return motion.q[:, column_of(motion, where)]

    def fastest(self, robot: Robot, where: str | None, values: Values) -> float:
        """Of small oscillations in one of its wells."""
        stiffness = values['amplitude'] * values['harmonic']
        return float(np.sqrt(abs(stiffness) * mobility(robot, where)))


class Stiffness(JointTorque):
    """tau = -k (q - q0)."""

    def torque(self, q: Array, qd: Array, effort: Array, values: Values) -> Array:
        """Torque towards the rest angle."""
        return -values['stiffness'] * (q - values['rest_angle'])

    def fastest(self, robot: Robot, where: str | None, values: Values) -> float:
        """Of the joint on its spring."""
        return float(np.sqrt(values['stiffness'] * mobility(robot, where)))


class MotorInertia(JointEffect):
    """tau = -J q'': the motor's rotor, reflected by the gear's ratio squared.

    The rotor spins a gear ratio faster than the joint: of its energy 1/2 J (q' + w/ratio)^2 the
    carrier's rate w is left out, and its momentum too, as in Pinocchio and MuJoCo.
    """

    def change(self, robot: Robot, where: str | None, values: Values) -> Robot:
        """More inertia against the joint's own acceleration."""
        return robot.with_motor_inertia(str(where), values['inertia'])


EFFECTS = (
    TorqueConstant(
        id='joint_torque_constant',
        title="a motor's torque constant off its nominal value",
        group='joint',
        parameters=(
            Parameter(
                name='gain',
                unit='',
                doc='True motor torque per measured one.',
                nominal=1.0,
                minimum=0.0,
                maximum=10.0,
                size=0.1,
                relevant=3e-4,
            ),
        ),
        magnitude='2 to 10 % off, from magnet temperature and current sensor',
        signature='a torque residual in proportion to the motor torque, at every speed',
        source='Gautier and Briot, J. Dyn. Sys. Meas. Control 136 (2014)',
    ),
    TorqueRipple(
        id='joint_torque_ripple',
        title="torque ripple that goes round with a joint's angle",
        group='joint',
        parameters=(
            Parameter(
                name='amplitude',
                unit='N m',
                doc='Largest torque.',
                size=1.0,
                minimum=0.0,
                relevant=0.02,
            ),
            Parameter(
                name='harmonic',
                unit='',
                doc='Periods in one turn of the joint.',
                nominal=1.0,
                above=0.0,
                maximum=2000.0,
                size=50.0,
                role='search',
                grid=(1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0),
            ),
            Parameter(
                name='phase',
                unit='rad',
                doc='Phase at joint angle zero.',
                default=0.0,
                role='phase',
            ),
        ),
        magnitude='0.1 to 2 N m at 2 to 200 periods a turn, from cogging and harmonic drives',
        signature='a torque residual that is periodic in the joint angle',
        source='Tuttle and Seering, IEEE Trans. Robotics and Automation 12 (1996)',
    ),
    Stiffness(
        id='joint_stiffness',
        title='a spring across a joint, such as a cable harness',
        group='joint',
        parameters=(
            Parameter(
                name='stiffness',
                unit='N m/rad',
                doc='Torque towards the rest angle per angle.',
                minimum=0.0,
                size=5.0,
                relevant=0.05,
            ),
            Parameter(
                name='rest_angle',
                unit='rad',
                doc='Angle without torque.',
                default=0.0,
                minimum=-20.0,
                maximum=20.0,
                size=1.0,
                role='search',
                grid=(-1.0, 0.0, 1.0),
            ),
        ),
        magnitude='0.5 to 20 N m/rad for harness across joints of space arms',
        signature='a torque residual in proportion to the joint angle, with an offset',
        source='Siciliano et al., Robotics: Modelling, Planning and Control (2009), 5.1',
    ),
    MotorInertia(
        id='motor_inertia',
        title="inertia of a geared motor's rotor",
        group='joint',
        parameters=(
            Parameter(
                name='inertia',
                unit='kg m^2',
                doc='Inertia of the rotor times the gear ratio squared.',
                minimum=0.0,
                size=3.0,
                relevant=0.02,
            ),
        ),
        magnitude='0.1 to 10 kg m^2 for gear ratios of 50 to 200',
        signature="a torque residual in proportion to the joint's own acceleration",
        source='Featherstone, Rigid Body Dynamics Algorithms (2008), 9.6',
    ),
)
