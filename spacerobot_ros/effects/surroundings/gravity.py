"""Gravity: the tide of an orbit, and a direction or size that is not as believed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...dynamics.rotation import cross_rows
from ...model.robot import Robot
from ...types import Array
from ..effect import Effect
from ..motion import Motion
from ..parameter import amount, searched, xyz
from ..prior import NOTHING, Prior, Scale
from .environment import External, into_base

_ALONG = 0.9  # of a direction, from which an axis is along gravity


class GravityGradient(External):
    """The tide of a circular orbit, on every body.

    With n the orbital rate, d the unit vector along the vertical and rho a place from the system's
    centre of mass, in free fall with it,

        a = n^2 (3 d d^T - 1) rho,

    so a body of mass m, centre of mass rho and inertia J takes the force m a and the torque
    3 n^2 d x J d. The vertical stands still in the inertial frame: it turns by n per second.

    Typical: 1.1e-3 rad/s in low orbit: 1e-3 N m per 1000 kg m^2 of difference.
    Signature: a torque that depends on how the system stands against the vertical.
    Source: Hughes, Spacecraft Attitude Dynamics, 8.1.

    Args:
        orbital_rate: Rate of the circular orbit.
        x, y, z: Direction of the vertical in the inertial frame, of any length.
    """

    id = 'gravity_gradient'
    title = 'gravity gradient'
    parameters = (
        amount('orbital_rate', 'rad/s', 2e-6, 1e-7, maximum=0.1, role='square'),
        *(searched(axis, '', guesses=(-1.0, 1.0)) for axis in 'xyz'),
    )

    def check(self, robot: Robot) -> None:
        """Refuse a direction without length."""
        self.check_direction('the vertical')

    def force(self, motion: Motion, hidden: Array) -> Array:
        """Forces and torques on all bodies."""
        robot, out = motion.robot, motion.zeros()
        length = float(np.linalg.norm(self.vector()))
        if not robot.is_free or length == 0.0:
            return out
        square = self['orbital_rate'] ** 2
        vertical = into_base(motion, self.vector() / length)
        centres, masses = motion.centres, [body.mass for body in robot.bodies]
        middle = np.average(centres, axis=1, weights=masses)
        for k, body in enumerate(robot.bodies):
            rho = centres[:, k] - middle
            along = np.sum(vertical * rho, axis=1, keepdims=True)
            pull = square * body.mass * (3.0 * along * vertical - rho)
            rotation = motion.base_rotation(body.name)
            d = np.einsum('nji,nj->ni', rotation, vertical)
            torque = 3.0 * square * cross_rows(d, d @ body.inertia)
            force = np.einsum('nji,nj->ni', rotation, pull)
            out += motion.wrench(body.name, force, torque, body.com)
        return out

    def canonical(self) -> Effect:
        """The vertical of unit length; the opposite one is the same."""
        return self.with_unit_axis()

    @classmethod
    def variants(cls, robot: Robot, where: str | None) -> tuple[dict[str, float], ...]:
        """Verticals along the axes and between them; the opposite one is the same."""
        directions = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
        directions += [(1, 1, 0), (1, -1, 0), (1, 0, 1), (1, 0, -1), (0, 1, 1), (0, 1, -1)]
        return tuple(
            {axis: x / math.hypot(*d) for axis, x in zip('xyz', d, strict=True)}
            for d in directions
        )


class GravityError(Effect):
    """g = g_believed + (x, y, z) in the inertial frame; a free base falls along, unaware.

    Typical: 0.01 to 0.3 m/s^2: a ground test whose base does not stand level.
    Signature: joint torques of a weight that acts in a wrong direction.
    Source: Swevers et al., IEEE Control Systems Magazine 27 (2007).

    Args:
        x, y, z: Gravity added along the inertial axes.
    """

    id = 'gravity_error'
    title = 'gravity that is not as believed'
    group = 'environment'
    parameters = xyz('m/s^2', 0.2, 0.01)

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """A tilt: its magnitude is known, and no scale of all masses.

        A base is set up once, with a level; zeros of encoders, which may look like its tilt, are
        set joint by joint.
        """
        size = max(float(np.linalg.norm(scale.gravity)), np.finfo(float).tiny)
        is_along = np.abs(scale.gravity) > _ALONG * size
        return scale.alike(0.2 * np.where(is_along, NOTHING, 1.0), log_odds=-2.0)

    def change(self, robot: Robot) -> Robot:
        """Another gravity."""
        return replace(robot, gravity=robot.gravity + self.vector())
