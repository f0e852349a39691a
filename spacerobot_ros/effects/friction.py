"""Friction in joints: torques against the joint rate, whatever the motor does."""

from __future__ import annotations

import numpy as np

from ..model.robot import Robot
from ..types import Array
from .joint import JointTorque
from .parameter import amount, searched

STICTION_RATE = 2e-3
"""Rate over which dry friction changes its sign [rad/s]: sign(v) is smoothed to tanh(v / this)."""


_FALLS = (0.005, 0.015, 0.05, 0.15)
"""First guesses of the rate over which friction falls [rad/s]."""


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
        amount('static', 'N m', 4.0, 0.01),
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


class LoadFriction(JointTorque):
    """tau = -mu |tau_m| sign(q').

    Typical: 0.02 to 0.2 of the motor torque for loaded harmonic drives and gears.
    Signature: a torque residual that jumps at reversals by an amount that follows the torque.
    Source: Gogoussis and Donath, IEEE Int. Conf. Robotics and Automation (1987).

    Args:
        coefficient: Torque against the direction of motion per motor torque.
    """

    id = 'joint_load_friction'
    title = 'friction in proportion to the load of a joint'
    parameters = (amount('coefficient', '', 0.1, 1e-3, maximum=1.0),)

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """Torque against the joint rate in proportion to the motor torque."""
        return -self['coefficient'] * np.abs(effort) * direction(qd)
