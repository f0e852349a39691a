"""Friction of joints: a torque against the rate, whatever the motor does."""

from __future__ import annotations

import numpy as np

from ...model.robot import Robot
from ...types import Array
from ..effect import Effect
from ..joint import STICTION_RATE, JointTorque, direction
from ..parameter import amount, searched
from ..prior import REFINED, RUN_TO_RUN, Prior, Scale

_VELOCITIES = {'above': STICTION_RATE, 'maximum': 10.0}
_FALLS = (0.005, 0.015, 0.05, 0.15)
"""First guesses of the rate over which friction falls [rad/s]."""


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

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """By the torques of its joint."""
        return scale.alike(scale.torque / scale.rate, RUN_TO_RUN * scale.viscous)

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

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """By the torques of its joint."""
        return scale.alike(scale.torque, RUN_TO_RUN * scale.dry)

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """Torque of constant size against the joint rate."""
        return -self['torque'] * direction(qd)

    def fastest(self, robot: Robot) -> float:
        """Decay rate about rest, where the smoothed sign is a strong viscous friction."""
        return self['torque'] / STICTION_RATE * self.mobility(robot)


class AsymmetricFriction(JointTorque):
    """tau = -F sign(q') forward, -B sign(q') backward.

    While the joint moves this is Coulomb friction of (F + B) / 2 and a torque sensor's bias of
    (F - B) / 2: the diagnosis finds those two, and names the one that they may be.

    Typical: a tenth to a third of the Coulomb torque between the directions, for loaded gears.
    Signature: as Coulomb friction, with a constant torque while the joint moves.
    Source: Armstrong-Helouvry et al., Automatica 30 (1994).

    Args:
        forward: Torque against motion along the joint's axis.
        backward: Torque against motion the other way.
    """

    id = 'joint_asymmetric_friction'
    title = 'Coulomb friction of another size in each direction'
    refines = ('joint_coulomb_friction',)
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
        searched('velocity', 'rad/s', 0.1, nominal=0.01, guesses=_FALLS, **_VELOCITIES),
    )

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """By the torques of its joint."""
        return scale.alike(0.3 * scale.torque, RUN_TO_RUN * scale.dry, REFINED)

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """Torque that falls from its static to its Coulomb value as the joint gets moving."""
        share = np.exp(-((qd / self['velocity']) ** 2))
        size = self['coulomb'] + (self['static'] - self['coulomb']) * share
        return -size * direction(qd)

    def canonical(self) -> Effect:
        """Without a static torque below the Coulomb one."""
        return self.changed(static=max(self['static'], self['coulomb']))

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

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """By the torques of its joint."""
        return scale.alike(scale.torque, RUN_TO_RUN * scale.dry, REFINED)

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
    follows_load = True
    title = 'friction in proportion to the load of a joint'
    parameters = (amount('coefficient', '', 0.1, 1e-3, maximum=1.0),)

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """A tenth of the torque."""
        return scale.alike(0.1, log_odds=REFINED)

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """Torque against the joint rate in proportion to the motor torque."""
        return -self['coefficient'] * np.abs(effort) * direction(qd)
