r"""Joints whose motor and link do not move as one: a flexible gear, and play.

With theta the motor's angle, delta = theta - q what gear and shaft are wound up by, and u what the
gear passes on (Spong, J. Dyn. Sys. Meas. Control 109 (1987)):

    u = k delta + d delta',    J (q'' + delta'') = tau_m - u

The link feels u in place of the motor torque tau_m.
"""

from __future__ import annotations

import math

import numpy as np

from ..model.robot import Robot
from ..types import Array
from .effect import Parameter, Values
from .joint import JointEffect, column_of, mobility
from .motion import Motion

_REACH = 5  # samples on each side that a slope is taken over
CROSSING_TORQUE = 0.02
"""Torque over which play is crossed [N m]: sign(tau) is smoothed to tanh(tau / this)."""


class Flexibility(JointEffect):
    """A spring and damper between the motor's rotor and the link.

    The rotor knows its own rate alone, as `motor_inertia`, which is the limit of a stiff gear.
    """

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """What the link feels, less the motor torque."""
        column = column_of(motion, where)
        if math.isinf(values['stiffness']):
            passed = -values['rotor_inertia'] * _acceleration(motion, column)
        else:
            gear = values['stiffness'] * hidden[:, 0] + values['damping'] * hidden[:, 1]
            passed = gear - motion.effort[:, column]
        return motion.joint_force(str(where), passed)

    def hidden_rate(
        self, motion: Motion, where: str | None, values: Values, hidden: Array
    ) -> Array:
        """[delta', delta'']."""
        column = column_of(motion, where)
        gear = values['stiffness'] * hidden[:, 0] + values['damping'] * hidden[:, 1]
        rotor = (motion.effort[:, column] - gear) / values['rotor_inertia']
        return np.column_stack([hidden[:, 1], rotor - _acceleration(motion, column)])

    def driven(self, motion: Motion, where: str | None, values: Values) -> Array:
        """Wind-up [delta, delta'] of a gear that is stiff for the motion: k delta = u.

        The free oscillation of rotor on gear, which no slow record shows, is left out; so a gear
        of any stiffness up to infinity, and a rotor of any inertia from zero, has an answer.
        """
        column = column_of(motion, where)
        passed = motion.effort[:, column]
        passed = passed - values['rotor_inertia'] * _acceleration(motion, column)
        angle = passed / values['stiffness']
        if values['damping'] and np.isfinite(values['stiffness']):
            angle = angle - values['damping'] / values['stiffness'] * _slope(angle, motion.time)
        return np.column_stack([angle, _slope(angle, motion.time)])

    def sense(
        self,
        channel: str,
        value: Array,
        motion: Motion,
        where: str | None,
        values: Values,
        hidden: Array,
    ) -> Array:
        """The motor's angle and rate, as far as the encoder is on the motor."""
        state = {'joint_position': 0, 'joint_velocity': 1}.get(channel)
        if state is None:
            return value
        out = np.array(value)
        out[:, column_of(motion, where)] += values['motor_side'] * hidden[:, state]
        return out

    def variants(self, robot: Robot, where: str | None) -> tuple[dict[str, float], ...]:
        """Encoder on the motor, then on the link."""
        return {'motor_side': 1.0}, {'motor_side': 0.0}

    def fastest(self, robot: Robot, where: str | None, values: Values) -> float:
        """Rotor against link on the gear."""
        inverse = 1.0 / values['rotor_inertia'] + mobility(robot, where)
        return max(
            float(np.sqrt(values['stiffness'] * inverse)), float(values['damping'] * inverse)
        )


class Backlash(JointEffect):
    """theta - q = 1/2 gap sign(tau_m): play between encoder and link.

    The motor rests on the flank that its torque presses on, and crosses the play when the torque
    changes sign. The crossing itself, a few milliseconds of free motor, is left out.
    """

    def sense(
        self,
        channel: str,
        value: Array,
        motion: Motion,
        where: str | None,
        values: Values,
        hidden: Array,
    ) -> Array:
        """The motor's angle."""
        if channel != 'joint_position':
            return value
        out, column = np.array(value), column_of(motion, where)
        flank = np.tanh(motion.effort[:, column] / CROSSING_TORQUE)
        out[:, column] += 0.5 * values['gap'] * flank
        return out


def _acceleration(motion: Motion, column: int) -> Array:
    """(N,) of a joint, from its rates where it is not known."""
    if motion.acceleration is None:
        return _slope(motion.qd[:, column], motion.time)
    return motion.acceleration[:, 6 + column]


def _slope(values: Array, time: Array) -> Array:
    """(N,) time derivative over `_REACH` samples on each side; zero of a single one."""
    count = len(values)
    if count < 2:
        return np.zeros(count)
    place = np.arange(count)
    before, after = np.maximum(place - _REACH, 0), np.minimum(place + _REACH, count - 1)
    return np.asarray((values[after] - values[before]) / (time[after] - time[before]))


EFFECTS = (
    Flexibility(
        id='joint_flexibility',
        title='a flexible gear between motor and link',
        group='joint',
        hidden=2,
        parameters=(
            Parameter(
                name='stiffness',
                unit='N m/rad',
                doc='Torque of the gear per wind-up.',
                nominal=math.inf,
                above=0.0,
                size=1e-4,
                relevant=2e-6,
                role='reciprocal',
            ),
            Parameter(
                name='damping',
                unit='N m s/rad',
                doc='Torque of the gear per rate of its wind-up.',
                default=0.0,
                minimum=0.0,
                size=20.0,
            ),
            Parameter(
                name='rotor_inertia',
                unit='kg m^2',
                doc="Inertia of the motor's rotor times the gear ratio squared.",
                above=0.0,
                size=3.0,
                relevant=0.02,
            ),
            Parameter(
                name='motor_side',
                unit='',
                doc='Encoder on the motor, before the gear (1), or on the link (0).',
                nominal=1.0,
                default=1.0,
                minimum=0.0,
                maximum=1.0,
                size=1.0,
                role='search',
                grid=(1.0, 0.0),
            ),
        ),
        magnitude='5e3 to 1e5 N m/rad, rotor 0.1 to 10 kg m^2, for harmonic drives of space arms',
        signature='joint angle and rate that are off by torque over stiffness, and its derivative',
        source='Spong, J. Dyn. Sys. Meas. Control 109 (1987)',
    ),
    Backlash(
        id='joint_backlash',
        title='play between the encoder on the motor and the link',
        group='joint',
        parameters=(
            Parameter(
                name='gap',
                unit='rad',
                doc='Full width of the play.',
                minimum=0.0,
                maximum=1.0,
                size=2e-3,
                relevant=1e-4,
            ),
        ),
        magnitude='1e-4 to 3e-3 rad for spur and planetary gears; none for harmonic drives',
        signature='joint angles that jump by the gap when the motor torque changes its sign',
        source='Nordin and Gutman, Automatica 38 (2002)',
    ),
)
