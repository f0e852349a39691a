"""The immutable robot that every other part takes: a tree of bodies, wheels, sensors' noise.

Bodies are numbered: body 0 is the base, body i (1..n) moves with joint i of `Robot.joints`, in that order everywhere.
Links joined by fixed joints are one body. A body's frame is the frame of its joint's child link (the base: the frame
of `base_link`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import pinocchio as pin

from ..errors import ConfigurationError
from ..types import Array, Matrix3, Vector3
from .settings import SensorSettings
from .urdf import Joint, Link, Tree


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
    """

    name: str
    parent: int
    rotation: Matrix3
    translation: Vector3
    axis: Vector3
    is_prismatic: bool
    mass: float
    com: Vector3
    inertia: Matrix3


@dataclass(frozen=True, slots=True, eq=False)
class Gyrostat:
    """Wheels of one link as a momentum relative to it.

    Args:
        link: The carrying link.
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


@dataclass(frozen=True, eq=False)
class Robot:
    """A validated robot. Build one with `load_robot`; vary one with the `with_*` methods.

    Args:
        name: Name of the URDF.
        urdf: The URDF text that the robot was built from.
        is_free: Free-floating base (True) or fixed base (False).
        gravity: (3,) in the inertial frame [m/s^2].
        joints: Names of the n manipulator joints, then of the rotors if `rotor_count` > 0.
        bodies: Body 0 (base) and one body a joint.
        servicer_wheels: Gyrostat of the base.
        target_wheels: Gyrostats of the captured body (what the model believes).
        effort_limits: (n,) [N m], infinite where the URDF has none.
        position_limits: (n, 2) [rad], infinite where the URDF has none.
        sensors: Sensor noise.
        rotor_count: Number of trailing entries of `joints` that are true wheel rotors.
        rotor_rates: (rotor_count,) initial relative rates [rad/s].
        target_rotors: Names of those rotors that belong to the captured body.
    """

    name: str
    urdf: str
    is_free: bool
    gravity: Vector3
    joints: tuple[str, ...]
    bodies: tuple[Body, ...]
    servicer_wheels: Gyrostat
    target_wheels: tuple[Gyrostat, ...]
    effort_limits: Array
    position_limits: Array
    sensors: SensorSettings
    rotor_count: int = 0
    rotor_rates: Array = field(default_factory=lambda: np.zeros(0))
    target_rotors: tuple[str, ...] = ()

    @property
    def n_joints(self) -> int:
        """Number of joints, rotors included."""
        return len(self.joints)

    @property
    def base_link(self) -> str:
        """Name of the base's frame."""
        return self.bodies[0].name

    @property
    def gyrostats(self) -> tuple[Gyrostat, ...]:
        """All gyrostats, the servicer's first."""
        return (self.servicer_wheels, *self.target_wheels)

    @property
    def target_momentum(self) -> Array:
        """(3 n_links,) believed wheel momentum of the captured body, link after link [N m s]."""
        return np.concatenate([np.zeros(0), *(g.momentum for g in self.target_wheels)])

    @cached_property
    def inertial_parameters(self) -> Array:
        """(n + 1, 10) of every body about its own frame, in Pinocchio's `toDynamicParameters` order."""
        return np.array([_pin_inertia(b).toDynamicParameters() for b in self.bodies])

    @cached_property
    def pin_model(self) -> pin.Model:
        """Pinocchio model with the joints in the robot's order of bodies; read-only by convention."""
        return _build_pin_model(self)

    @cached_property
    def pin_joint_ids(self) -> tuple[int, ...]:
        """Pinocchio joint index of every body (base first; 0, the universe, for a fixed base)."""
        base = 1 if self.is_free else 0
        return (base, *(self.pin_model.getJointId(name) for name in self.joints))

    @cached_property
    def velocity_indices(self) -> np.ndarray:
        """(n,) position of each joint's rate in Pinocchio's joint velocity, after the base's six."""
        offset = 6 if self.is_free else 0
        return np.array([self.pin_model.joints[i].idx_v - offset for i in self.pin_joint_ids[1:]], dtype=int)

    def with_target_momentum(self, momentum: Array) -> Robot:
        """The same robot believing another wheel momentum of the captured body.

        Args:
            momentum: (3 n_links,) link after link, each in its link frame [N m s].

        Raises:
            ConfigurationError: wrong length or not finite.
        """
        momentum = _finite(momentum, (3 * len(self.target_wheels),), 'target wheel momentum')
        wheels = tuple(
            replace(g, momentum=momentum[3 * i : 3 * i + 3].copy()) for i, g in enumerate(self.target_wheels)
        )
        return replace(self, target_wheels=wheels)

    def with_servicer_momentum(self, momentum: Array) -> Robot:
        """The same robot with another momentum of its own wheels, (3,) in the base frame [N m s]."""
        momentum = _finite(momentum, (3,), 'servicer wheel momentum')
        return replace(self, servicer_wheels=replace(self.servicer_wheels, momentum=momentum))

    def with_inertial_parameters(self, parameters: Array) -> Robot:
        """The same robot with other masses, centres of mass and inertias.

        Args:
            parameters: (n + 1, 10) as `inertial_parameters`; not checked for physical consistency.
        """
        parameters = _finite(parameters, (len(self.bodies), 10), 'inertial parameters')
        bodies = []
        for body, row in zip(self.bodies, parameters, strict=True):
            inertia = pin.Inertia.FromDynamicParameters(row)
            bodies.append(replace(body, mass=inertia.mass, com=inertia.lever.copy(), inertia=inertia.inertia.copy()))
        return replace(self, bodies=tuple(bodies))


def _finite(values: Array, shape: tuple[int, ...], what: str) -> Array:
    array = np.array(values, dtype=float)
    if array.shape != shape:
        raise ConfigurationError(what, f'expected shape {shape}, got {array.shape}')
    if not np.all(np.isfinite(array)):
        raise ConfigurationError(what, 'is not finite')
    return array


def _pin_inertia(body: Body) -> pin.Inertia:
    return pin.Inertia(body.mass, body.com, body.inertia)


def _build_pin_model(robot: Robot) -> pin.Model:
    model = pin.Model()
    model.name = robot.name
    model.gravity.linear = robot.gravity
    ids = [0]
    if robot.is_free:
        ids[0] = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), 'base')
        model.appendBodyToJoint(ids[0], _pin_inertia(robot.bodies[0]), pin.SE3.Identity())
    ids += [-1] * robot.n_joints
    for index in tree_order(robot.bodies):
        body = robot.bodies[index]
        kind = pin.JointModelPrismaticUnaligned if body.is_prismatic else pin.JointModelRevoluteUnaligned
        placement = pin.SE3(body.rotation, body.translation)
        ids[index] = model.addJoint(ids[body.parent], kind(body.axis), placement, robot.joints[index - 1])
        model.appendBodyToJoint(ids[index], _pin_inertia(body), pin.SE3.Identity())
    return model


def tree_order(bodies: tuple[Body, ...]) -> list[int]:
    """Indices of the moving bodies, every parent before its children."""
    order: list[int] = []
    placed = {0}
    while len(order) < len(bodies) - 1:
        ready = [i for i in range(1, len(bodies)) if i not in placed and bodies[i].parent in placed]
        order.extend(ready)
        placed.update(ready)
    return order


def merge_bodies(tree: Tree, joints: tuple[str, ...]) -> tuple[tuple[Body, ...], dict[str, tuple[int, Matrix3, Vector3]]]:
    """Merge links joined by fixed joints into bodies.

    Args:
        tree: Checked URDF.
        joints: Names of all moving joints, in the robot's order.

    Returns:
        The bodies, and for every link its body's index with the link frame's rotation and origin in the body frame.
    """
    frames: dict[str, tuple[int, Matrix3, Vector3]] = {tree.root: (0, np.eye(3), np.zeros(3))}
    body_of_joint = {name: i + 1 for i, name in enumerate(joints)}
    mounts: dict[int, tuple[Joint, int, Matrix3, Vector3]] = {}
    frontier = [tree.root]
    while frontier:
        link = frontier.pop()
        body, rotation, origin = frames[link]
        for joint in (j for j in tree.joints.values() if j.parent == link):
            placed = (rotation @ joint.rotation, origin + rotation @ joint.translation)
            if joint.kind == 'fixed':
                frames[joint.child] = (body, *placed)
            else:
                index = body_of_joint[joint.name]
                mounts[index] = (joint, body, *placed)
                frames[joint.child] = (index, np.eye(3), np.zeros(3))
            frontier.append(joint.child)
    bodies = [_merge_body(0, tree.root, -1, np.eye(3), np.zeros(3), None, tree, frames)]
    for index in range(1, len(joints) + 1):
        joint, parent, rotation, translation = mounts[index]
        bodies.append(_merge_body(index, joint.child, parent, rotation, translation, joint, tree, frames))
    return tuple(bodies), frames


def _merge_body(
    index: int,
    name: str,
    parent: int,
    rotation: Matrix3,
    translation: Vector3,
    joint: Joint | None,
    tree: Tree,
    frames: dict[str, tuple[int, Matrix3, Vector3]],
) -> Body:
    parts = [(link, *frames[link.name][1:]) for link in tree.links.values() if frames[link.name][0] == index]
    mass, com, inertia = _sum_inertias(parts)
    axis = np.array([1.0, 0.0, 0.0]) if joint is None else joint.axis
    is_prismatic = joint is not None and joint.kind == 'prismatic'
    return Body(name, parent, rotation, translation, axis, is_prismatic, mass, com, inertia)


def _sum_inertias(parts: list[tuple[Link, Matrix3, Vector3]]) -> tuple[float, Vector3, Matrix3]:
    massive = [part for part in parts if part[0].mass > 0.0]
    if len(massive) == 1 and np.array_equal(massive[0][1], np.eye(3)) and not massive[0][2].any():
        link = massive[0][0]  # the common case, kept exact: no sum, no rotation
        return link.mass, link.com, link.inertia
    mass = sum(link.mass for link, _, _ in massive)
    if not massive:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    coms = [origin + rotation @ link.com for link, rotation, origin in massive]
    com = sum(link.mass * c for (link, _, _), c in zip(massive, coms, strict=True)) / mass
    inertia = np.zeros((3, 3))
    for (link, rotation, _), c in zip(massive, coms, strict=True):
        d = c - com
        inertia += rotation @ link.inertia @ rotation.T + link.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return mass, np.asarray(com), inertia
