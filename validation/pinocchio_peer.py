"""A robot in Pinocchio, which shares no code with ours: peer of the identities and of tests."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin

from spacerobot_ros.model.robot import Robot, tree_order


@dataclass(frozen=True, slots=True, eq=False)
class Peer:
    """A robot's Pinocchio model.

    Args:
        model: Its joints in `tree_order`; read-only by convention.
        joint_ids: Joint of every body, base first (0, the universe, for a fixed base).
        velocity_indices: (n,) place of each joint's rate in the velocity, after the base's six.
    """

    model: pin.Model
    joint_ids: tuple[int, ...]
    velocity_indices: np.ndarray


@lru_cache(maxsize=32)
def peer(robot: Robot) -> Peer:
    """The robot's model; motor inertias are Pinocchio's armature, wheels are left out."""
    model = pin.Model()
    model.name = robot.name
    model.gravity.linear = robot.gravity
    ids = [0]
    if robot.is_free:
        ids[0] = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), 'base')
        model.appendBodyToJoint(ids[0], pin.Inertia(*robot.bodies[0].solid), pin.SE3.Identity())
    ids += [-1] * robot.n_joints
    slides, turns = pin.JointModelPrismaticUnaligned, pin.JointModelRevoluteUnaligned
    for index in tree_order(robot.bodies):
        body = robot.bodies[index]
        kind = slides if body.is_prismatic else turns
        placement = pin.SE3(body.rotation, body.translation)
        ids[index] = model.addJoint(
            ids[body.parent], kind(body.axis), placement, robot.joints[index - 1]
        )
        model.appendBodyToJoint(ids[index], pin.Inertia(*body.solid), pin.SE3.Identity())
        model.armature[model.joints[ids[index]].idx_v] = body.motor_inertia
    offset = 6 if robot.is_free else 0
    indices = np.array([model.joints[i].idx_v - offset for i in ids[1:]], dtype=int)
    return Peer(model, tuple(ids), indices)
