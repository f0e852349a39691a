r"""Fuel that moves in its tank: a point mass on springs in three directions.

With P = p + s its place in the host's frame, a the acceleration of that frame's origin and g
gravity there,

    s'' = g - a - alpha x P - w x (w x P) - 2 w x s' - 2 zeta omega s' - omega^2 s
    F   = m (omega^2 s + 2 zeta omega s')       on the host, at P

(Dodge, The New Dynamic Behavior of Liquids in Moving Containers (2000), 3). The mass is part of
what the file says of its host.
"""

from __future__ import annotations

import numpy as np

from ..dynamics.rotation import cross_rows, skew
from ..model.robot import Robot
from ..types import Array
from .hidden import driven_states
from .motion import Motion, body_index
from .mounting import FIRST_DAMPING, FREQUENCIES, Sprung, recoil, spring_parameters
from .parameter import amount, searched


class Slosh(Sprung):
    """A sprung point mass.

    Args:
        mass: What of the body's mass takes part.
        x, y, z: Place at rest in the body's frame.
    """

    id = 'fuel_slosh'
    title = 'fuel that sloshes in a tank of a body'
    hidden = 6
    parameters = (
        amount('mass', 'kg', 100.0, 0.1),
        *spring_parameters(0.02),
        *(searched(axis, 'm', 1.0, default=0.0) for axis in 'xyz'),
    )
    magnitude = '10 to 200 kg, 0.3 to 5 rad/s, damping 0.005 to 0.1, for tanks with diaphragms'
    signature = "a slow oscillation after every change of the body's velocity or rotation"
    source = 'Dodge, The New Dynamic Behavior of Liquids in Moving Containers (2000), 3'

    def change(self, robot: Robot) -> Robot:
        """The host without the mass."""
        m, (x, y, z) = self['mass'], self.vector()
        second = y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y
        return self.with_addition(robot, -m * np.array([1.0, x, y, z, *second]))

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The springs on the host."""
        force = self['mass'] * self.spring(hidden)
        return motion.wrench(self.where, force, None, self.vector() + hidden[:, :3])

    def hidden_rate(self, motion: Motion, hidden: Array) -> Array:
        """[s', s'']."""
        V, A = motion.twist(self.where), motion.link_acceleration(self.where)
        w, rate = V[:, 3:], hidden[:, 3:]
        place = self.vector() + hidden[:, :3]
        frame = A[:, :3] + cross_rows(w, V[:, :3]) - self.gravity(motion)
        frame = (
            frame + cross_rows(A[:, 3:], place) + cross_rows(w, cross_rows(w, place) + 2.0 * rate)
        )
        return np.concatenate([rate, -frame - self.spring(hidden)], axis=1)

    def driven(self, motion: Motion) -> Array:
        """Along a given motion, with the recoil that such a motion does not hold."""

        def rate(own: Array) -> Array:
            out = self.hidden_rate(motion, own)
            out[:, 3:] -= recoil(motion, self['mass'] * self.spring(own))
            return out

        return driven_states(rate, motion.time, self.hidden)

    def momentum(self, motion: Motion, hidden: Array) -> Array:
        """Of the mass."""
        V, place = motion.twist(self.where), self.vector() + hidden[:, :3]
        linear = self['mass'] * (V[:, :3] + cross_rows(V[:, 3:], place) + hidden[:, 3:])
        return self.to_base(motion, np.concatenate([linear, cross_rows(place, linear)], axis=1))

    @classmethod
    def variants(cls, robot: Robot, where: str | None) -> tuple[dict[str, float], ...]:
        """Every frequency, at the host's centre of mass."""
        x, y, z = robot.bodies[body_index(robot, where)].com.tolist()
        return tuple(
            {'frequency': frequency, 'damping': FIRST_DAMPING, 'x': x, 'y': y, 'z': z}
            for frequency in FREQUENCIES
        )

    def fastest(self, robot: Robot) -> float:
        """Of the mass on its springs against the recoiling robot."""
        S = np.hstack([np.eye(3), -skew(self.vector())]).T
        return self.fastest_against(robot, S, self['mass'] * np.eye(3))


EFFECTS = (Slosh,)
