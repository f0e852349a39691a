"""A robot's tree as plain arrays, for compiled loops, and the names of its parameters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...errors import ConfigurationError
from ...model.robot import Gyrostat, Robot, tree_order
from ...types import Array, IntArray

BODY_NAMES = ('m', 'mcx', 'mcy', 'mcz', 'Ixx', 'Ixy', 'Iyy', 'Ixz', 'Iyz', 'Izz')
_BODY_UNITS = ('kg', *('kg m',) * 3, *('kg m^2',) * 6)
_LOWER = (np.array([0, 0, 1, 0, 1, 2]), np.array([0, 1, 1, 2, 2, 2]))  # Ixx Ixy Iyy Ixz Iyz Izz


class Tree(NamedTuple):
    """Geometry of a free-flying tree; body 0 is the base, body i moves with joint i - 1.

    Args:
        order: (n + 1,) bodies, parents first.
        parents: (n + 1,) parent body; -1 for the base.
        rotations: (n + 1, 3, 3) body to parent coordinates at zero joint position.
        translations: (n + 1, 3) joint origin in the parent's frame [m].
        axes: (n + 1, 3) joint axis in the body's frame.
        sliding: (n + 1,) 1.0 for prismatic joints, else 0.0.
        wheel_bodies: (w,) body of each link with wheels.
        wheel_rotations: (w, 3, 3) link to body coordinates.
    """

    order: IntArray
    parents: IntArray
    rotations: Array
    translations: Array
    axes: Array
    sliding: Array
    wheel_bodies: IntArray
    wheel_rotations: Array

    @property
    def n_bodies(self) -> int:
        """Number of bodies, base included."""
        return len(self.parents)

    @property
    def rows(self) -> int:
        """Size of the velocity: six of the base and one a joint."""
        return 5 + self.n_bodies

    @property
    def columns(self) -> int:
        """Number of parameters: ten a body and three a link with wheels."""
        return 10 * self.n_bodies + 3 * len(self.wheel_bodies)


def wheel_links(robot: Robot) -> tuple[Gyrostat, ...]:
    """Gyrostats that have columns: the servicer's where it spins, and all of the captured body."""
    own = (robot.servicer_wheels,) if robot.servicer_wheels.momentum.any() else ()
    return (*own, *robot.target_wheels)


def build_tree(robot: Robot) -> Tree:
    """Arrays of a robot.

    Raises:
        ConfigurationError: fixed base, or free rotors (give the gyrostat view).
    """
    if not robot.is_free:
        raise ConfigurationError('robot.base', 'adaptive laws control a free-flying base')
    if robot.rotor_count:
        raise ConfigurationError(
            'robot', 'adaptive laws take the model with locked rotors (gyrostat view)'
        )
    bodies, wheels = robot.bodies, wheel_links(robot)
    return Tree(
        np.array([0, *tree_order(bodies)], dtype=np.int64),
        np.array([body.parent for body in bodies], dtype=np.int64),
        np.array([body.rotation for body in bodies], dtype=float),
        np.array([body.translation for body in bodies], dtype=float),
        np.array([body.axis for body in bodies], dtype=float),
        np.array([float(body.is_prismatic) for body in bodies]),
        np.array([g.body for g in wheels], dtype=np.int64),
        np.array([g.rotation for g in wheels], dtype=float).reshape(-1, 3, 3),
    )


def parameter_values(robot: Robot) -> Array:
    """(p,) inertial parameters of all bodies, then wheel momenta, of a robot."""
    momenta = [g.momentum for g in wheel_links(robot)]
    return np.concatenate([inertial_rows(robot).ravel(), *momenta])


def inertial_rows(robot: Robot) -> Array:
    """(n + 1, 10) as `Robot.inertial_parameters`, also of bodies that are not physical."""
    rows = []
    for body in robot.bodies:
        c = body.com
        about_origin = body.inertia + body.mass * (c @ c * np.eye(3) - np.outer(c, c))
        rows.append([body.mass, *(body.mass * c), *about_origin[_LOWER]])
    return np.array(rows)


def parameter_names(robot: Robot) -> tuple[str, ...]:
    """Names as `link_1.Ixx` and `link_3.aam_x`, in the order of `parameter_values`."""
    names = [f'{body.name}.{name}' for body in robot.bodies for name in BODY_NAMES]
    names += [f'{g.link}.aam_{axis}' for g in wheel_links(robot) for axis in 'xyz']
    return tuple(names)


def parameter_units(robot: Robot) -> tuple[str, ...]:
    """Units in the order of `parameter_values`."""
    return (*_BODY_UNITS * len(robot.bodies), *('N m s',) * (3 * len(wheel_links(robot))))


def with_parameters(robot: Robot, values: Array) -> Robot:
    """The robot with other parameters (p,); not checked for physical consistency."""
    n = 10 * len(robot.bodies)
    out = robot.with_inertial_parameters(values[:n].reshape(-1, 10))
    own = len(wheel_links(robot)) - len(robot.target_wheels)
    return out.with_target_momentum(values[n + 3 * own :])
