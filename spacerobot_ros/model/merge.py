"""Links joined by fixed joints become one rigid body."""

from __future__ import annotations

import numpy as np

from ..types import Matrix3, Vector3
from .body import Body
from .urdf import Joint, Link, Tree

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
    frames: Frames = {tree.root: (0, np.eye(3), np.zeros(3))}
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
        bodies.append(
            _merge_body(index, joint.child, parent, rotation, translation, joint, tree, frames)
        )
    return tuple(bodies), frames


def _merge_body(
    index: int,
    name: str,
    parent: int,
    rotation: Matrix3,
    translation: Vector3,
    joint: Joint | None,
    tree: Tree,
    frames: Frames,
) -> Body:
    parts = [
        (link, *frames[link.name][1:])
        for link in tree.links.values()
        if frames[link.name][0] == index
    ]
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
        inertia += rotation @ link.inertia @ rotation.T + link.mass * (
            d @ d * np.eye(3) - np.outer(d, d)
        )
    return mass, np.asarray(com), inertia
