r"""Joints whose motor and link do not move as one: a flexible gear, and play.

With theta the motor's angle, delta = theta - q what gear and shaft are wound up by, and u what the
gear passes on (Spong, J. Dyn. Sys. Meas. Control 109 (1987)):

    u = k delta + d delta',    J (q'' + delta'') = tau_m - u

The link feels u in place of the motor torque tau_m.
"""

from __future__ import annotations

import math

import numpy as np

from ...model.robot import Robot
from ...types import Array
from ..joint import JointEffect
from ..motion import Motion
from ..parameter import Parameter, amount, searched
from ..prior import Prior, Scale
from ..sensors.sensor_errors import SensorFault

_SHARE = {'minimum': 0.0, 'maximum': 1.0}
_REACH = 5  # samples on each side that a slope is taken over
_WINDOW = 2 * _REACH + 1
CROSSING_TORQUE = 0.02
"""Torque over which play is crossed [N m]: sign(tau) is smoothed to tanh(tau / this)."""


class Flexibility(JointEffect):
    """A spring and damper between the motor's rotor and the link.

    The rotor knows its own rate alone, as `motor_inertia`, which is the limit of a stiff gear.

    Typical: 5e3 to 1e5 N m/rad, rotor 0.1 to 10 kg m^2, for harmonic drives of space arms.
    Signature: joint angle and rate that are off by torque over stiffness, and its derivative.
    Source: Spong, J. Dyn. Sys. Meas. Control 109 (1987).

    Args:
        stiffness: Torque of the gear per wind-up.
        damping: Torque of the gear per rate of its wind-up.
        rotor_inertia: Inertia of the motor's rotor times the gear ratio squared.
        motor_side: Encoder on the motor, before the gear (1), or on the link (0).
    """

    id = 'joint_flexibility'
    title = 'a flexible gear between motor and link'
    hidden = 2
    parameters = (
        Parameter(
            'stiffness', 'N m/rad', 1e-4, 2e-6, nominal=math.inf, above=0.0, role='reciprocal'
        ),
        amount('damping', 'N m s/rad', 20.0, default=0.0),
        Parameter('rotor_inertia', 'kg m^2', 3.0, 0.02, above=0.0),
        searched('motor_side', '', 1.0, nominal=1.0, default=1.0, guesses=(1.0, 0.0), **_SHARE),
    )

    def force(self, motion: Motion, hidden: Array) -> Array:
        """What the link feels, less the motor torque."""
        if math.isinf(self['stiffness']):
            passed = -self['rotor_inertia'] * self._acceleration(motion)
        else:
            passed = self._gear(hidden) - motion.effort[:, motion.column(self.where)]
        return motion.joint_force(self.where, passed)

    def hidden_rate(self, motion: Motion, hidden: Array) -> Array:
        """[delta', delta'']."""
        effort = motion.effort[:, motion.column(self.where)]
        rotor = (effort - self._gear(hidden)) / self['rotor_inertia']
        return np.column_stack([hidden[:, 1], rotor - self._acceleration(motion)])

    def driven(self, motion: Motion) -> Array:
        """Wind-up [delta, delta'] of a gear that is stiff for the motion: k delta = u.

        The free oscillation of rotor on gear, which no slow record shows, is left out; so a gear
        of any stiffness up to infinity, and a rotor of any inertia from zero, has an answer.
        """
        passed = motion.effort[:, motion.column(self.where)]
        passed = passed - self['rotor_inertia'] * self._acceleration(motion)
        angle = passed / self['stiffness']
        if self['damping'] and np.isfinite(self['stiffness']):
            angle = angle - self['damping'] / self['stiffness'] * _slope(angle, motion.time)
        return np.column_stack([angle, _slope(angle, motion.time)])

    def sense(
        self, channel: str, value: Array, motion: Motion, hidden: Array | None = None
    ) -> Array:
        """The motor's angle and rate, as far as the encoder is on the motor."""
        state = {'joint_position': 0, 'joint_velocity': 1}.get(channel)
        if state is None:
            return value
        own = self.driven(motion) if hidden is None else hidden
        out = np.array(value)
        out[:, motion.column(self.where)] += self['motor_side'] * own[:, state]
        return out

    @classmethod
    def variants(cls, robot: Robot, where: str | None) -> tuple[dict[str, float], ...]:
        """Encoder on the motor, then on the link."""
        return {'motor_side': 1.0}, {'motor_side': 0.0}

    def fastest(self, robot: Robot) -> float:
        """Rotor against link on the gear."""
        inverse = 1.0 / self['rotor_inertia'] + self.mobility(robot)
        return max(float(np.sqrt(self['stiffness'] * inverse)), float(self['damping'] * inverse))

    def _gear(self, hidden: Array) -> Array:
        """(N,) torque that the gear passes on."""
        return self['stiffness'] * hidden[:, 0] + self['damping'] * hidden[:, 1]

    def _acceleration(self, motion: Motion) -> Array:
        """(N,) of the joint, from its rates where it is not known."""
        column = motion.column(self.where)
        if motion.acceleration is None:
            return _slope(motion.qd[:, column], motion.time)
        return motion.acceleration[:, 6 + column]


class Backlash(JointEffect, SensorFault):
    """theta - q = 1/2 gap sign(tau_m): play between encoder and link.

    The motor rests on the flank that its torque presses on, and crosses the play when the torque
    changes sign. The crossing itself, a few milliseconds of free motor, is left out.

    Typical: 1e-4 to 3e-3 rad for spur and planetary gears; none for harmonic drives.
    Signature: joint angles that jump by the gap when the motor torque changes its sign.
    Source: Nordin and Gutman, Automatica 38 (2002).

    Args:
        gap: Full width of the play.
    """

    id = 'joint_backlash'
    title = 'play between the encoder on the motor and the link'
    channel = 'joint_position'
    parameters = (amount('gap', 'rad', 2e-3, 1e-4, maximum=1.0),)

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """The smoothed motion has no jumps."""
        return None

    def faulty(self, value: Array, motion: Motion) -> Array:
        """The motor's angle."""
        out, column = np.array(value), motion.column(self.where)
        out[:, column] += 0.5 * self['gap'] * np.tanh(motion.effort[:, column] / CROSSING_TORQUE)
        return out


def _slope(values: Array, time: Array) -> Array:
    """(N,) time derivative of cubics through `_REACH` samples on each side (Savitzky and Golay).

    A difference over the same samples would lose (omega 0.05 s)^2 / 6 of a motion at 100 Hz, 3 %
    at 8 rad/s, and at both ends belongs to another time. Zero of a single sample.
    """
    if len(values) < _WINDOW:
        return np.gradient(values, time) if len(values) > 1 else np.zeros(len(values))
    return _rise(values) / _rise(time)


def _rise(values: Array) -> Array:
    """(N,) slope from one value to the next.

    scipy's filter loads all of scipy's statistics, a quarter of a node's time to start.
    """
    at = np.arange(-_REACH, _REACH + 1.0)
    cubic = np.vander(at, 4, increasing=True)
    slope = np.stack([0.0 * at, 1.0 + 0.0 * at, 2.0 * at, 3.0 * at**2], axis=1)
    weights = slope @ np.linalg.pinv(cubic)  # of a window's values, in the slope at each
    first, last = weights[:_REACH] @ values[:_WINDOW], weights[-_REACH:] @ values[-_WINDOW:]
    return np.concatenate([first, np.correlate(values, weights[_REACH], 'valid'), last])
