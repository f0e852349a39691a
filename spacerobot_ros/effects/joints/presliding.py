r"""Dry friction with elastic contacts: a joint at rest is held, and gives way before it slides.

With z the share of the friction torque T that is mobilised, d the displacement over which it would
build up elastically, and b the share up to which it does,

    tau  = -T z
    d z' = q'                              where |z| <= b, or q' unloads the contacts
    d z' = q' (1 - |z|) / (1 - b)          beyond: sliding sets in

(Dahl's law, AIAA J. 14 (1976), made elastic below b: Dupont et al., IEEE Trans. Automatic Control
47 (2002)). The contacts store 1/2 T d z^2 and z' q' <= q'^2 / d: more never comes back. Dahl's own
law, b = 0, creeps under every load that is not perfectly still.
"""

from __future__ import annotations

import math

import numpy as np

from ...dynamics.compiling import compiled
from ...model.robot import Robot
from ...types import Array
from ..joint import JointEffect
from ..motion import Motion
from ..parameter import amount, searched
from ..prior import REFINED, Prior, Scale

_DISPLACEMENTS = {'minimum': 1e-5, 'maximum': 1.0}
_GUESSES = (3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
_SLIDING_ACCELERATION = 5.0
"""Acceleration [rad/s^2] with which a joint that starts from rest has the rate sqrt(2 * this * d)
after the displacement d. Faster ones slide already, and a share, which is stiff there, need not
follow more than that rate to stay at 1."""
_ELASTIC = 0.7  # b, as in Dupont et al.: no load below this share makes a joint creep


class PreslidingFriction(JointEffect):
    """Dry friction that builds up over a displacement; viscous friction beside it damps it.

    Typical: 0.1 to 5 N m that build up over 1e-4 to 1e-2 rad, for bearings and gears.
    Signature: as Coulomb friction, with reversals that are gradual in the angle: hysteresis.
    Source: Dahl, AIAA J. 14 (1976); Dupont et al., IEEE Trans. Automatic Control 47 (2002).

    Args:
        torque: Torque against the direction of motion once the joint slides; it holds at rest.
        displacement: Torque by stiffness of the contacts.
    """

    id = 'joint_presliding_friction'
    title = 'dry friction that holds a joint at rest and gives way before it slides'
    hidden = 1
    refines = ('joint_coulomb_friction',)
    parameters = (
        amount('torque', 'N m', 3.0, 0.01),
        searched('displacement', 'rad', 1e-2, nominal=1e-3, guesses=_GUESSES, **_DISPLACEMENTS),
    )

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """By the torques of its joint."""
        return scale.alike(scale.torque, log_odds=REFINED) if scale.has_angle else None

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The mobilised share of the torque."""
        return motion.joint_force(self.where, -self['torque'] * np.clip(hidden[:, 0], -1.0, 1.0))

    def hidden_rate(self, motion: Motion, hidden: Array) -> Array:
        """Of the share z."""
        rate = motion.qd[:, [motion.column(self.where)]]
        most = math.sqrt(2.0 * _SLIDING_ACCELERATION * self['displacement'])
        sliding = np.clip(rate, -most, most) * (1.0 - np.abs(hidden)) / (1.0 - _ELASTIC)
        is_elastic = (np.abs(hidden) <= _ELASTIC) | (hidden * rate <= 0.0)
        return np.asarray(np.where(is_elastic, rate, sliding) / self['displacement'])

    def driven(self, motion: Motion) -> Array:
        """Share z along the joint's angles, exactly; the contacts are free of torque at first."""
        way = np.diff(motion.q[:, motion.column(self.where)]) / self['displacement']
        return np.asarray(_mobilised(way, _ELASTIC))[:, None]

    def fastest(self, robot: Robot) -> float:
        """Of the joint on its contacts, or of contacts that begin to slide."""
        swinging = math.sqrt(self['torque'] * self.mobility(robot) / self['displacement'])
        sliding = math.sqrt(2.0 * _SLIDING_ACCELERATION / self['displacement'])
        return max(swinging, sliding / (1.0 - _ELASTIC))


@compiled
def _mobilised(way: Array, elastic: float) -> Array:
    """(N,) z from zero over ways (N - 1,), each in one direction, by the displacement."""
    z = np.zeros(len(way) + 1)
    for k in range(len(way)):
        sign = 1.0 if way[k] >= 0.0 else -1.0
        left, y = abs(way[k]), sign * z[k]
        run = min(left, max(elastic - y, 0.0))
        slid = (left - run) / (1.0 - elastic)
        z[k + 1] = sign * (1.0 - (1.0 - y - run) * math.exp(-slid))
    return z
