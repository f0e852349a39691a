"""Friction between the motors of two joints, as gears of a wrist couple them."""

from __future__ import annotations

import numpy as np

from ...model.robot import Robot
from ...types import Array
from ..joint import STICTION_RATE, JointEffect, direction
from ..motion import Motion, inverse_mass
from ..parameter import amount, searched
from ..prior import Prior, Scale

_RATIOS = {'minimum': -10.0, 'maximum': 10.0}


class CoupledFriction(JointEffect):
    """T = C sign(u) + V u against u = q_j' + r q_k': tau_j = -T, tau_k = -r T.

    k is the joint that carries j, the one before it on its arm. On both joints together T has the
    power -T u, which is never positive.

    Typical: 0.3 to 2 N m and 0.1 to 0.6 N m s/rad in the wrist of a small industrial arm.
    Signature: torque residuals of two joints that jump together when neither need reverse.
    Source: Janot, Vandanjon and Gautier, IEEE Trans. Control Systems Technology 22 (2014).

    Args:
        coulomb: Torque of constant size against u.
        viscous: Torque against u, per rate.
        ratio: Turns of the motor by one turn of joint k, as shares of those by one of joint j.
    """

    id = 'joint_coupled_friction'
    title = 'friction of a motor that two joints of an arm turn'
    is_rare = True
    parameters = (
        amount('coulomb', 'N m', 3.0, 0.01, default=0.0),
        amount('viscous', 'N m s/rad', 10.0, 0.05, default=0.0),
        searched('ratio', '', 1.0, nominal=1.0, default=1.0, guesses=(1.0, -1.0), **_RATIOS),
    )

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """By the torques of its joint."""
        slab = 0.2 * np.array([scale.torque, scale.torque / scale.rate])
        return scale.alike(slab, log_odds=-5.0)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Every manipulator joint that another one carries, and whose rate adds up with its."""
        bodies = robot.bodies
        return tuple(
            joint
            for joint, body in zip(robot.arm, bodies[1:], strict=False)
            if body.parent > 0 and bodies[body.parent].is_prismatic == body.is_prismatic
        )

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque on both joints."""
        shares = self._shares(motion.robot)
        rate = motion.qd @ shares[6:]
        torque = self['coulomb'] * direction(rate) + self['viscous'] * rate
        return -torque[:, None] * shares

    def fastest(self, robot: Robot) -> float:
        """Decay rate about rest, where the smoothed sign is a strong viscous friction."""
        shares = self._shares(robot)
        slope = self['coulomb'] / STICTION_RATE + self['viscous']
        return float(slope * shares @ inverse_mass(robot) @ shares)

    def _shares(self, robot: Robot) -> Array:
        """(6 + n,) of u in the generalized velocity."""
        out = np.zeros(6 + robot.n_joints)
        body = 1 + robot.joints.index(str(self.where))
        out[5 + body], out[5 + robot.bodies[body].parent] = 1.0, self['ratio']
        return out
