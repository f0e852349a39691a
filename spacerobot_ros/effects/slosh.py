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
from .bodies import MovingBodyEffect, body_index, with_addition
from .effect import Parameter, Values
from .hidden import driven_states
from .motion import Motion
from .mounting import (
    FIRST_DAMPING,
    FREQUENCIES,
    damping_parameter,
    fall,
    frequency_parameter,
    link_mobility,
    recoil,
    spring,
    to_base,
)


class Slosh(MovingBodyEffect):
    """A sprung point mass."""

    def change(self, robot: Robot, where: str | None, values: Values) -> Robot:
        """The host without the mass."""
        return with_addition(robot, where, -_point_mass(values), self.id)

    def check(self, robot: Robot, where: str | None, values: Values, place: str) -> None:
        """The mass is not more than its host."""
        with_addition(robot, where, -_point_mass(values), place)

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """The springs on the host."""
        force = values['mass'] * spring(values, hidden, 3)
        return motion.wrench(str(where), force, None, _position(values) + hidden[:, :3])

    def hidden_rate(
        self, motion: Motion, where: str | None, values: Values, hidden: Array
    ) -> Array:
        """[s', s'']."""
        V, A = motion.twist(str(where)), motion.link_acceleration(str(where))
        w, rate = V[:, 3:], hidden[:, 3:]
        place = _position(values) + hidden[:, :3]
        frame = A[:, :3] + cross_rows(w, V[:, :3]) - fall(motion, where)
        frame = (
            frame + cross_rows(A[:, 3:], place) + cross_rows(w, cross_rows(w, place) + 2.0 * rate)
        )
        return np.concatenate([rate, -frame - spring(values, hidden, 3)], axis=1)

    def driven(self, motion: Motion, where: str | None, values: Values) -> Array:
        """Along a given motion, with the recoil that such a motion does not hold."""

        def rate(own: Array) -> Array:
            out = self.hidden_rate(motion, where, values, own)
            out[:, 3:] -= recoil(motion, values['mass'] * spring(values, own, 3))
            return out

        return driven_states(rate, motion.time, self.hidden)

    def momentum(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """Of the mass."""
        V, place = motion.twist(str(where)), _position(values) + hidden[:, :3]
        linear = values['mass'] * (V[:, :3] + cross_rows(V[:, 3:], place) + hidden[:, 3:])
        own = np.concatenate([linear, cross_rows(place, linear)], axis=1)
        return to_base(motion, where, own)

    def variants(self, robot: Robot, where: str | None) -> tuple[dict[str, float], ...]:
        """Every frequency, at the host's centre of mass."""
        x, y, z = robot.bodies[body_index(robot, where)].com.tolist()
        return tuple(
            {'frequency': frequency, 'damping': FIRST_DAMPING, 'x': x, 'y': y, 'z': z}
            for frequency in FREQUENCIES
        )

    def fastest(self, robot: Robot, where: str | None, values: Values) -> float:
        """Of the mass on its springs against the recoiling robot."""
        J = np.hstack([np.eye(3), -skew(_position(values))])
        recoil = values['mass'] * np.linalg.eigvalsh(J @ link_mobility(robot, where) @ J.T)[-1]
        return float(max(1.0, values['damping']) * values['frequency'] * np.sqrt(1.0 + recoil))


def _position(values: Values) -> Array:
    return np.array([values['x'], values['y'], values['z']])


def _point_mass(values: Values) -> Array:
    """(10,) inertial parameters of the mass at rest in its place."""
    m, (x, y, z) = values['mass'], _position(values)
    second = y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y
    return m * np.array([1.0, x, y, z, *second])


def _coordinate(name: str) -> Parameter:
    return Parameter(
        name=name,
        unit='m',
        doc=f"Place at rest along {name} of the body's frame.",
        default=0.0,
        size=1.0,
        role='search',
    )


EFFECTS = (
    Slosh(
        id='fuel_slosh',
        title='fuel that sloshes in a tank of a body',
        group='bodies',
        hidden=6,
        parameters=(
            Parameter(
                name='mass',
                unit='kg',
                doc="What of the body's mass takes part.",
                minimum=0.0,
                size=100.0,
                relevant=0.1,
            ),
            frequency_parameter('Natural frequency, the body held.'),
            damping_parameter(0.02),
            *(_coordinate(name) for name in 'xyz'),
        ),
        magnitude='10 to 200 kg, 0.3 to 5 rad/s, damping 0.005 to 0.1, for tanks with diaphragms',
        signature="a slow oscillation after every change of the body's velocity or rotation",
        source='Dodge, The New Dynamic Behavior of Liquids in Moving Containers (2000), 3',
    ),
)
