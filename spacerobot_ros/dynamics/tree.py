"""A robot as the compiled functions take it: one record a body, and their scratch memory."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..model.robot import Robot, tree_order
from ..types import Vector3
from .rotation import skew

# Records of bodies, parents first: the base is number 0. `joint` is the place of the body's joint
# in joint vectors; `turn` holds Rodrigues' matrices still, sine and versine.
BODY = np.dtype(
    [
        ('joint', np.int64),
        ('parent', np.int64),
        ('slides', np.int64),
        ('turn', np.float64, (3, 3, 3)),
        ('translation', np.float64, 3),
        ('axis', np.float64, 3),
        ('mass', np.float64),
        ('com', np.float64, 3),
        ('inertia', np.float64, (3, 3)),
        ('motor', np.float64),
        ('wheels', np.float64, 3),
    ],
    align=True,
)
# What one evaluation knows of a body, in base coordinates about its joint. Articulated
# inertias keep their lower triangle only.
SCRATCH = np.dtype(
    [
        ('rotation', np.float64, (3, 3)),
        ('offset', np.float64, 3),
        ('subspace', np.float64, 6),
        ('velocity', np.float64, 6),
        ('drift', np.float64, 6),
        ('inertia', np.float64, (6, 6)),
        ('bias', np.float64, 6),
        ('force', np.float64, 6),
        ('acceleration', np.float64, 6),
        ('pivot', np.float64),
        ('torque', np.float64),
    ],
    align=True,
)

Records = Any  # a NumPy array of the records above
Machine = tuple[Records, Records, bool, bool, Vector3]
"""Bodies, their scratch memory, is the base free, do wheels load the joints, gravity [m/s^2]."""


def machine_of(robot: Robot, joint_reaction: bool) -> Machine:
    """What the compiled functions take of a robot; holds scratch memory."""
    bodies = body_records(robot)
    scratch = np.zeros(len(bodies), dtype=SCRATCH)
    gravity = np.array(robot.gravity, dtype=float)
    return bodies, scratch, bool(robot.is_free), joint_reaction, gravity


def tree_of(robot: Robot) -> Records:
    """`body_records` of a robot, made once and shared: read-only by convention."""
    if robot not in _TREES:
        _TREES[robot] = body_records(robot)
    return _TREES[robot]


_TREES: WeakKeyDictionary[Robot, Records] = WeakKeyDictionary()


def body_records(robot: Robot) -> Records:
    """(n + 1,) records `BODY` of a robot, parents first."""
    order = [0, *tree_order(robot.bodies)]
    place = {index: i for i, index in enumerate(order)}
    records = np.zeros(len(order), dtype=BODY)
    for record, index in zip(records, order, strict=True):
        body = robot.bodies[index]
        k = np.zeros((3, 3)) if body.is_prismatic else skew(body.axis)
        record['joint'], record['parent'] = index - 1, place.get(body.parent, -1)
        record['slides'] = body.is_prismatic
        record['turn'] = body.rotation, body.rotation @ k, body.rotation @ k @ k
        record['translation'], record['axis'] = body.translation, body.axis
        record['mass'], record['com'], record['inertia'] = body.mass, body.com, body.inertia
        record['motor'] = body.motor_inertia
    for g in robot.gyrostats:
        records[place[g.body]]['wheels'] += g.body_momentum
    return records
