"""Friction in joints: torques against the joint rate, whatever the motor does."""

from __future__ import annotations

import numpy as np

from ..errors import ConfigurationError
from ..model.robot import Robot
from ..types import Array
from .effect import Parameter, Values
from .joint import JointTorque, mobility

STICTION_RATE = 2e-3
"""Rate over which dry friction changes its sign [rad/s]: sign(v) is smoothed to tanh(v / this)."""
_ARMSTRONG = 'Armstrong-Helouvry et al., Automatica 30 (1994)'


def direction(qd: Array) -> Array:
    """Smoothed sign of a joint rate."""
    return np.tanh(qd / STICTION_RATE)


class ViscousFriction(JointTorque):
    """tau = -c q'."""

    def torque(self, q: Array, qd: Array, effort: Array, values: Values) -> Array:
        """Torque against the joint rate."""
        return -values['coefficient'] * qd

    def fastest(self, robot: Robot, where: str | None, values: Values) -> float:
        """Rate at which the joint comes to rest."""
        return values['coefficient'] * mobility(robot, where)


class CoulombFriction(JointTorque):
    """tau = -T sign(q')."""

    def torque(self, q: Array, qd: Array, effort: Array, values: Values) -> Array:
        """Torque of constant size against the joint rate."""
        return -values['torque'] * direction(qd)

    def fastest(self, robot: Robot, where: str | None, values: Values) -> float:
        """Decay rate about rest, where the smoothed sign is a strong viscous friction."""
        return values['torque'] / STICTION_RATE * mobility(robot, where)


class StribeckFriction(JointTorque):
    """tau = -(T + (S - T) exp(-(q'/v)^2)) sign(q')."""

    def torque(self, q: Array, qd: Array, effort: Array, values: Values) -> Array:
        """Torque that falls from its static to its Coulomb value as the joint gets moving."""
        share = np.exp(-((qd / values['velocity']) ** 2))
        size = values['coulomb'] + (values['static'] - values['coulomb']) * share
        return -size * direction(qd)

    def check(self, robot: Robot, where: str | None, values: Values, place: str) -> None:
        """The static torque is the larger one."""
        if values['static'] < values['coulomb']:
            raise ConfigurationError(
                f'{place}.static',
                f'{values["static"]:g} N m is less than the Coulomb torque of '
                f'{values["coulomb"]:g} N m, which it exceeds at rest',
            )

    def fastest(self, robot: Robot, where: str | None, values: Values) -> float:
        """As of Coulomb friction, of the static torque."""
        return values['static'] / STICTION_RATE * mobility(robot, where)


class LoadFriction(JointTorque):
    """tau = -mu |tau_m| sign(q')."""

    def torque(self, q: Array, qd: Array, effort: Array, values: Values) -> Array:
        """Torque against the joint rate in proportion to the motor torque."""
        return -values['coefficient'] * np.abs(effort) * direction(qd)


EFFECTS = (
    ViscousFriction(
        id='joint_viscous_friction',
        title='viscous friction in a joint',
        group='joint',
        parameters=(
            Parameter(
                name='coefficient',
                unit='N m s/rad',
                doc='Torque against the joint rate, per rate.',
                minimum=0.0,
                size=10.0,
                relevant=0.05,
            ),
        ),
        magnitude='0.1 to 30 N m s/rad for harmonic drives of space arms',
        signature='a torque residual in proportion to the joint rate',
        source=_ARMSTRONG,
    ),
    CoulombFriction(
        id='joint_coulomb_friction',
        title='Coulomb friction in a joint',
        group='joint',
        parameters=(
            Parameter(
                name='torque',
                unit='N m',
                doc='Torque of constant size against the direction of motion.',
                minimum=0.0,
                size=3.0,
                relevant=0.01,
            ),
        ),
        magnitude='0.1 to 5 N m for harmonic drives of space arms',
        signature='a torque residual that jumps whenever the joint reverses',
        source=_ARMSTRONG,
    ),
    StribeckFriction(
        id='joint_stribeck_friction',
        title='dry friction that falls as a joint gets moving',
        group='joint',
        parameters=(
            Parameter(
                name='coulomb',
                unit='N m',
                doc='Torque against the direction of fast motion.',
                minimum=0.0,
                size=3.0,
                relevant=0.01,
            ),
            Parameter(
                name='static',
                unit='N m',
                doc='Torque against the direction of slow motion.',
                minimum=0.0,
                size=4.0,
                relevant=0.01,
            ),
            Parameter(
                name='velocity',
                unit='rad/s',
                doc='Rate over which it falls from the static to the Coulomb torque.',
                nominal=0.01,
                above=STICTION_RATE,
                maximum=10.0,
                size=0.1,
                role='search',
                grid=(0.005, 0.015, 0.05, 0.15),
            ),
        ),
        magnitude='static torque 1.1 to 2 times the Coulomb one, falling over 0.003 to 0.1 rad/s',
        signature='as Coulomb friction, with a peak of the residual at every start and reversal',
        source=_ARMSTRONG,
    ),
    LoadFriction(
        id='joint_load_friction',
        title='friction in proportion to the load of a joint',
        group='joint',
        parameters=(
            Parameter(
                name='coefficient',
                unit='',
                doc='Torque against the direction of motion per motor torque.',
                minimum=0.0,
                maximum=1.0,
                size=0.1,
                relevant=1e-3,
            ),
        ),
        magnitude='0.02 to 0.2 of the motor torque for loaded harmonic drives and gears',
        signature='a torque residual that jumps at reversals by an amount that follows the torque',
        source='Gogoussis and Donath, IEEE Int. Conf. Robotics and Automation (1987)',
    ),
)
