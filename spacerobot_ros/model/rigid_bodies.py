"""Links joined by fixed joints become one rigid body."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ..types import Matrix3, Vector3
from .body import Body
from .urdf import Tree, by_parent

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
    inertias: dict[int, pin.Inertia] = {}
    for part in tree.links.values():
        index, rotation, origin = frames[part.name]
        own = pin.SE3(rotation, origin).act(pin.Inertia(part.mass, part.com, part.inertia))
        if part.mass > 0.0:  # the first as it is: a single link stays exact
            inertias[index] = inertias[index] + own if index in inertias else own
    for index, inertia in inertias.items():
        bodies[index] = bodies[index].with_spatial_inertia(inertia)
    return tuple(bodies[i] for i in range(len(bodies))), frames
