"""A robot in Pinocchio: derivatives come from it, and tests hold our recursions against it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin

from ..model.body import Body, tree_order
from ..model.robot import Robot
from ..types import IntArray


@dataclass(frozen=True, slots=True, eq=False)
class PinocchioModel:
    """A robot's Pinocchio model.

    Args:
        model: Its joints in `tree_order`; read-only by convention.
        joint_ids: Joint of every body, base first (0, the universe, for a fixed base).
        velocity_indices: (n,) place of each joint's rate in the velocity, after the base's six.
        columns: (nv,) place of each entry of the velocity in [base; joints].
    """

    model: pin.Model
    joint_ids: tuple[int, ...]
    velocity_indices: IntArray
    columns: IntArray


@lru_cache(maxsize=32)
def in_pinocchio(robot: Robot) -> PinocchioModel:
    """The robot's model; motor inertias are Pinocchio's armature, wheels are left out."""
    model = pin.Model()
    model.name = robot.name
    model.gravity.linear = robot.gravity
    ids = [0]
    if robot.is_free:
        ids[0] = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), 'base')
        model.inertias[ids[0]] = _inertia(robot.bodies[0])
    ids += [-1] * robot.n_joints
    slides, turns = pin.JointModelPrismaticUnaligned, pin.JointModelRevoluteUnaligned
    for index in tree_order(robot.bodies):
        body = robot.bodies[index]
        kind = slides if body.is_prismatic else turns
        placement = pin.SE3(body.rotation, body.translation)
        ids[index] = model.addJoint(
            ids[body.parent], kind(body.axis), placement, robot.joints[index - 1]
        )
        model.inertias[ids[index]] = _inertia(body)
        model.armature[model.joints[ids[index]].idx_v] = body.motor_inertia
    first = 6 if robot.is_free else 0
    indices = np.array([model.joints[i].idx_v - first for i in ids[1:]], dtype=int)
    columns = np.concatenate([np.arange(first), 6 + np.argsort(indices)])
    return PinocchioModel(model, tuple(ids), indices, columns)


def _inertia(body: Body) -> pin.Inertia:
    """Of any numbers: fits pass through bodies that none can be, which its constructor refuses."""
    out = pin.Inertia.Zero()
    out.mass, out.lever, out.inertia = body.mass, body.com, body.inertia
    return out
