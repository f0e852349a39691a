"""A robot as the compiled functions take it: one record a body, and what an evaluation finds.

Every recursion of this folder runs over `BODY` records, parents first, and numbers bodies as the
robot does: body 0 is the base, body k moves with joint k - 1.
"""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..model.robot import Robot, tree_order
from ..types import Array
from .rotation import skew

FIXED, FREE, REVOLUTE, PRISMATIC = range(4)

BODY = np.dtype(
    [
        *((name, np.int64) for name in ('number', 'parent', 'kind')),
        ('turn', np.float64, (3, 3, 3)),
        *((name, np.float64, 3) for name in ('translation', 'axis', 'wheels', 'gravity')),
        ('inertial', np.float64, 10),
        ('motor', np.float64),
    ],
    align=True,
)
"""A body: number, parent's number, kind of joint, Rodrigues' matrices (at rest, by sine, by
versine), joint origin in the parent's frame [m], axis in its own, ten inertial parameters as
`Robot.inertial_parameters`, momentum of its gyrostats in its frame [N m s], motor inertia
[kg m^2]; gravity [m/s^2] in the base's record only. A fixed base has no inertia and no wheels."""

_MEMBERS = {
    (): ('mass', 'pivot', 'torque'),
    (3,): ('origin', 'offset', 'moment', 'momentum'),
    (6,): (*('subspace', 'screw', 'velocity', 'drift', 'acceleration', 'force', 'bias', 'swept'),),
    (3, 3): ('rotation', 'tensor'),
    (6, 6): ('articulated',),
}
LINK = np.dtype(
    [(name, np.float64, shape) for shape, names in _MEMBERS.items() for name in names], align=True
)
"""Scratch memory of the recursions, a record a body, each field explained where it is written."""

Records = Any  # a NumPy array of the records above


def tree_of(robot: Robot) -> Records:
    """(n + 1,) records `BODY` of a robot, made once and shared: read-only by convention."""
    if robot not in _TREES:
        _TREES[robot] = _records(robot)
    return _TREES[robot]


_TREES: WeakKeyDictionary[Robot, Records] = WeakKeyDictionary()


def difference(tree: Records, other: Records) -> Records:
    """The tree with the difference of two robots in inertia, wheels and motors.

    RNEA and CRBA are linear in these, so of a difference they give the difference.
    """
    out = tree.copy()
    for name in ('inertial', 'wheels', 'motor'):
        out[name] -= other[name]
    return out


def is_empty(tree: Records) -> bool:
    """Whether a tree has neither inertia nor wheels nor motors."""
    return not any(tree[name].any() for name in ('inertial', 'wheels', 'motor'))


def _records(robot: Robot) -> Records:
    order = [0, *tree_order(robot.bodies)]
    bodies = [robot.bodies[index] for index in order]
    records = np.zeros(len(order), dtype=BODY)
    is_prismatic = np.array([body.is_prismatic for body in bodies])
    rotation, axis = np.array([b.rotation for b in bodies]), np.array([b.axis for b in bodies])
    k = np.where(is_prismatic[:, None, None], 0.0, skew(axis))
    records['number'], records['parent'] = order, [body.parent for body in bodies]
    records['kind'] = np.where(is_prismatic, PRISMATIC, REVOLUTE)
    records['turn'] = np.stack([rotation, rotation @ k, rotation @ k @ k], axis=1)
    records['translation'], records['axis'] = [body.translation for body in bodies], axis
    records['inertial'] = inertial_rows(robot)[order]
    records['motor'] = [body.motor_inertia for body in bodies]
    for g in robot.gyrostats:
        records['wheels'][order.index(g.body)] += g.body_momentum
    records[0]['kind'], records[0]['gravity'] = FREE if robot.is_free else FIXED, robot.gravity
    if not robot.is_free:
        records[0]['inertial'], records[0]['wheels'] = 0.0, 0.0
    return records


def inertial_rows(robot: Robot) -> Array:
    """(n + 1, 10) as `Robot.inertial_parameters`, also of bodies that are not physical."""
    mass = np.array([body.mass for body in robot.bodies])
    c = np.array([body.com for body in robot.bodies])
    across = np.sum(c * c, axis=1)[:, None, None] * np.eye(3) - c[:, :, None] * c[:, None, :]
    moments = np.array([b.inertia for b in robot.bodies]) + mass[:, None, None] * across
    return np.column_stack([mass, mass[:, None] * c, moments[:, LOWER[0], LOWER[1]]])


LOWER = (np.array([0, 0, 1, 0, 1, 2]), np.array([0, 1, 1, 2, 2, 2]))  # Ixx Ixy Iyy Ixz Iyz Izz
