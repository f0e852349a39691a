"""Forces from outside, which change the system's momentum: constant torques, drag."""

from __future__ import annotations

import numpy as np

from ...dynamics.rotation import cross_rows
from ...types import Array
from ..effect import Effect
from ..motion import Motion
from ..parameter import amount, xyz

FORCE = ('force_x', 'force_y', 'force_z')
AT = ('at_x', 'at_y', 'at_z')


class External(Effect):
    """A force or torque from outside on a free base."""

    group = 'environment'
    needs_free_base = True
    is_external = True

    def on_base(self, motion: Motion, torque: Array, force: Array | None = None) -> Array:
        """(N, 6 + n) of force and torque, (N, 3) or (3,), at the base origin in base frame."""
        out = motion.zeros()
        if motion.robot.is_free:
            out[:, :3] = 0.0 if force is None else force
            out[:, 3:6] = torque
        return out

    def force_at(self, motion: Motion, force: Array) -> Array:
        """(N, 6 + n) of a force, (N, 3) or (3,), that acts at the place of the effect's values."""
        return self.on_base(motion, cross_rows(self.vector(*AT), force), force)

    def check_direction(self, of: str) -> None:
        """Refuse x, y, z without length."""
        if not self.vector().any():
            raise self.refusal(f'x, y, z are all zero: give the direction of {of}')


def into_base(motion: Motion, inertial: Array) -> Array:
    """(N, 3) base coordinates of inertial ones, (3,) or (N, 3)."""
    stacked = np.broadcast_to(inertial, (len(motion), 3))
    return np.asarray(np.einsum('nji,nj->ni', motion.rotation, stacked))


class ExternalTorqueBody(External):
    """A torque that is constant in the base.

    Typical: 1e-5 N m (pressure, magnetic) to 1 N m (venting).
    Signature: momentum that grows in a direction fixed in the base.
    Source: Wertz, Spacecraft Attitude Determination and Control, 17.2.

    Args:
        x, y, z: Torque about the base's axes.
    """

    id = 'external_torque_body'
    title = 'external torque that is constant in the base'
    parameters = xyz('N m', 1.0, 1e-3)

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque on the base."""
        return self.on_base(motion, self.vector())


class ExternalTorqueInertial(External):
    """A torque that is constant in the inertial frame.

    Typical: 1e-5 to 0.1 N m.
    Signature: momentum that grows evenly in a direction fixed in space.
    Source: Wertz, Spacecraft Attitude Determination and Control, 17.2.

    Args:
        x, y, z: Torque about the inertial axes.
    """

    id = 'external_torque_inertial'
    title = 'external torque that is constant in the inertial frame'
    parameters = xyz('N m', 1.0, 1e-3)

    def force(self, motion: Motion, hidden: Array) -> Array:
        """R_WB^T torque on the base."""
        return self.on_base(motion, into_base(motion, self.vector()))


class RotationalDrag(External):
    """A torque on the base against its rate: m = -c w.

    Typical: 1e-3 to 0.1 N m s/rad on air bearings and in water; far less in orbit.
    Signature: momentum that decays with the rate, about every axis alike.
    Source: Wertz, Spacecraft Attitude Determination and Control, 17.2.

    Args:
        coefficient: Torque per rate.
    """

    id = 'rotational_drag'
    title = 'drag against the rate of the base'
    parameters = (amount('coefficient', 'N m s/rad', 1.0, 1e-3),)

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque on the base."""
        return self.on_base(motion, -self['coefficient'] * motion.omega)
