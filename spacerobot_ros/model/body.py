"""Rigid bodies, gyrostats and rotors: what a robot is made of.

Links joined by fixed joints become one rigid body (`merge_bodies`).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import ConfigurationError
from ..formats import either
from ..types import Matrix3, Vector3
from .rigid_body import Solid
from .urdf import Tree, by_parent

SLIDING = {
    'N m': 'N',
    'N m/rad': 'N/m',
    'N m s/rad': 'N s/m',
    'N m/A': 'N/A',
    'kg m^2': 'kg',
    'rad': 'm',
    'rad/s': 'm/s',
    'rad/s^2': 'm/s^2',
    'rad/s^2/A': 'm/s^2/A',
    'A s/rad': 'A s/m',
}
"""Units of what a joint has that turns, and of the same of one that slides."""


def joint_unit(unit: str, slides: Collection[bool] = (False, True)) -> str:
    """What a unit of joints that turn is where some slide, or nobody says whether they do."""
    units = ((False, unit), (True, SLIDING.get(unit, unit)))
    return either(u for is_sliding, u in units if is_sliding in slides)


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """One rigid body of the tree.

    Args:
        name: Link that gives the body its frame.
        parent: Index of the parent body; -1 for the base.
        rotation: (3, 3) takes body coordinates at zero joint position to the parent's.
        translation: (3,) joint origin in the parent frame [m].
        axis: (3,) unit joint axis in the body frame.
        is_prismatic: Whether the joint slides instead of turning.
        mass: Mass [kg].
        com: (3,) centre of mass in the body frame [m].
        inertia: (3, 3) about the centre of mass, body axes [kg m^2].
        motor_inertia: Inertia of the joint's geared motor, reflected to the joint [kg m^2]: it
            opposes the joint's own acceleration alone (Pinocchio's and MuJoCo's `armature`).
    """

    name: str
    parent: int
    rotation: Matrix3
    translation: Vector3
    axis: Vector3
    is_prismatic: bool
    mass: float = 0.0
    com: Vector3 = field(default_factory=lambda: np.zeros(3))
    inertia: Matrix3 = field(default_factory=lambda: np.zeros((3, 3)))
    motor_inertia: float = 0.0

    @property
    def solid(self) -> Solid:
        """Mass, centre of mass and inertia in the body frame.

        Raises:
            ConfigurationError: an inertia that no body has.
        """
        if not np.all(np.diagonal(self.inertia) >= 0.0):
            raise ConfigurationError(self.name, 'has an inertia that no body has')
        return Solid(self.mass, self.com, self.inertia)

    def with_solid(self, solid: Solid) -> Body:
        """The body with another mass, centre of mass and inertia."""
        return replace(self, mass=solid.mass, com=solid.com, inertia=solid.inertia)

    @property
    def effective_inertia(self) -> float:
        """What it opposes to its own joint: mass [kg], or moment about the axis [kg m^2]."""
        if self.is_prismatic:
            return self.mass
        own, arm = self.axis @ self.solid.inertia @ self.axis, np.cross(self.axis, self.com)
        return float(own + self.mass * (arm @ arm))

    def without(self, part: Body) -> Body:
        """Less a part that `part.rotation` and `part.translation` place in it."""
        placed = part.solid.placed(part.rotation, part.translation)
        return self.with_solid(self.solid.without(placed))


def inertia_ellipsoid(body: Body) -> tuple[Vector3, Matrix3] | None:
    """Half axes [m] and axes (columns, body coordinates) of the homogeneous ellipsoid of a body.

    None where there is no such solid: without a mass, or flat as a plate.
    """
    if body.mass <= 0.0:
        return None
    moments, axes = np.linalg.eigh(body.inertia)
    squares = 5.0 * (0.5 * moments.sum() - moments) / body.mass
    if not np.all(squares > 0.0):
        return None
    axes[:, 2] *= np.linalg.det(axes)
    return np.sqrt(squares), axes


@dataclass(frozen=True, slots=True, eq=False)
class Gyrostat:
    """Wheels of one link as a momentum relative to it.

    Args:
        link: The host link.
        body: Index of the body that the link belongs to.
        rotation: (3, 3) takes coordinates of the link frame to the body frame.
        momentum: (3,) relative wheel momentum in the link frame [N m s].
    """

    link: str
    body: int
    rotation: Matrix3
    momentum: Vector3

    @property
    def body_momentum(self) -> Vector3:
        """(3,) relative wheel momentum in the body frame [N m s]."""
        return self.rotation @ self.momentum


@dataclass(frozen=True, slots=True, eq=False)
class Rotor:
    """A true wheel rotor: a balanced body that spins freely about its axis on a host body.

    Args:
        joint: Name of its joint.
        link: The link that carries it; of the servicer, the root.
        is_target: Whether it belongs to the captured body (else to the servicer).
        body: The rotor itself; `body.parent` is the host body.
        rate: Relative rate at the start [rad/s].
    """

    joint: str
    link: str
    is_target: bool
    body: Body
    rate: float

    @property
    def axial_inertia(self) -> float:
        """Moment of inertia about the axis [kg m^2]."""
        return float(self.body.axis @ self.body.inertia @ self.body.axis)

    @property
    def body_momentum(self) -> Vector3:
        """(3,) momentum relative to the host, in its frame [N m s]."""
        return self.axial_inertia * self.rate * (self.body.rotation @ self.body.axis)


def tree_order(bodies: tuple[Body, ...]) -> list[int]:
    """Indices of the moving bodies, depth first: every parent before its children, subtrees whole.

    Pinocchio's `crba` takes the columns of a subtree to be contiguous and is silently wrong if
    they aren't.
    """
    order: list[int] = []
    stack = [0]
    while stack:
        index = stack.pop()
        order.append(index)
        stack.extend(i for i in reversed(range(1, len(bodies))) if bodies[i].parent == index)
    return order[1:]


def last_bodies(bodies: tuple[Body, ...]) -> list[int]:
    """Indices of the moving bodies that carry no other: one at the end of every arm."""
    parents = {body.parent for body in bodies}
    return [i for i in range(1, len(bodies)) if i not in parents]


Frames = dict[str, tuple[int, Matrix3, Vector3]]
"""Of every link: its body's index, rotation to body coordinates, origin in the body frame [m]."""


def merge_bodies(tree: Tree, joints: tuple[str, ...]) -> tuple[tuple[Body, ...], Frames]:
    """Merge links joined by fixed joints into bodies.

    Args:
        tree: Checked URDF.
        joints: Names of all moving joints, in the robot's order.

    Returns:
        The bodies, and for every link its body's index with the link frame's rotation and origin
        in the body frame.
    """
    here = np.eye(3), np.zeros(3)
    frames: Frames = {tree.root: (0, *here)}
    x = np.array([1.0, 0.0, 0.0])
    bodies = {0: Body(tree.root, -1, *here, x, False)}
    below, frontier = by_parent(tree.joints), [tree.root]
    while frontier:
        link = frontier.pop()
        body, rotation, origin = frames[link]
        for joint in below.get(link, ()):
            mount = rotation @ joint.rotation, origin + rotation @ joint.translation
            if joint.kind == 'fixed':
                frames[joint.child] = (body, *mount)
            else:
                index, slides = 1 + joints.index(joint.name), joint.kind == 'prismatic'
                bodies[index] = Body(joint.child, body, *mount, joint.axis, slides)
                frames[joint.child] = (index, *here)
            frontier.append(joint.child)
    solids: dict[int, Solid] = {}
    for name, part in tree.links.items():
        index, rotation, origin = frames[name]
        own = part.placed(rotation, origin)
        if part.mass > 0.0:  # the first as it is: a single link stays exact
            solids[index] = solids[index].joined(own) if index in solids else own
    for index, solid in solids.items():
        bodies[index] = bodies[index].with_solid(solid)
    return tuple(bodies[i] for i in range(len(bodies))), frames
