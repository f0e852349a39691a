r"""The scale of torques where none is measured: held at the file's by one number of each branch.

The balance of a branch of the tree without a measured torque is homogeneous: with all masses,
frictions and motor constants it holds c times as large, for any c, and best for c = 0. So one
number is held: how large the weight's torques (or those of the inertias) along the motion are,

    a x = sum over t, j of w_j(t) dw_j(t) x / sum of w_j(t)^2 = 0

with w of the file and dw x what columns x of the bodies add. All ratios are free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...errors import ConfigurationError
from ...model.robot import Robot
from ...types import Array
from ..columns import Candidate
from ..unknowns.response import InverseDynamics, Response

if TYPE_CHECKING:
    from .balance import Balance

HELD = 1e-5
"""Standard deviation of the scale: small beside any ratio's, and not so small that rounding of
double precision takes the rest."""
_BODIES = ('inertial_parameters', 'motor_inertia')


def unanchored(balances: Sequence[Balance]) -> list[list[int]]:
    """Numbers of the joints of every branch from the base where no torque is measured."""
    measured = np.any([b.arm.powered.any(axis=0) & b.is_torque for b in balances], axis=0)
    return [branch for branch in branches(balances[0].robot) if not measured[branch].any()]


def scale_columns(
    balances: Sequence[Balance],
    candidates: Sequence[Candidate],
    branches: Sequence[Sequence[int]],
) -> Array:
    """(A, K) relative change of the scale of each of A branches by unit of every coefficient.

    Raises:
        ConfigurationError: gravity is to be the anchor of a branch that has no weight.
    """
    return np.array([_scale(balances, candidates, branch) for branch in branches]).reshape(
        len(branches), sum(len(c.sizes) for c in candidates)
    )


def branches(robot: Robot) -> list[list[int]]:
    """Numbers of the joints of every branch that grows from the base."""
    roots = [j for j, body in enumerate(robot.bodies[1:]) if body.parent == 0]
    return [np.flatnonzero(robot.moves[root, 1:]).tolist() for root in roots]


def _scale(
    balances: Sequence[Balance], candidates: Sequence[Candidate], branch: Sequence[int]
) -> Array:
    robot = balances[0].robot
    branch = [j for j in branch if robot.joints[j] in robot.passive_joints] or branch
    still = [replace(b.arm.kinematics, qd=np.zeros_like(b.arm.kinematics.qd)) for b in balances]
    weights = [replace(at, qdd=np.zeros_like(at.qdd)) for at in still]
    is_heavy = any(b.weight[:, branch].any() for b in balances)
    if robot.anchor == 'gravity' and not is_heavy:
        names = ', '.join(robot.joints[j] for j in branch)
        raise ConfigurationError('robot.scale.anchor', f'gravity has no torque at {names}')
    floating = replace(robot, gravity=np.zeros(3))
    torques = []
    if robot.anchor == 'inertia' or not is_heavy:
        weights, robot = still, floating
    for at in weights:
        motion = InverseDynamics(robot).motion(at, np.zeros_like(at.q))
        own = InverseDynamics(robot)(motion)[:, 6:][:, branch]
        response = Response(robot, motion)
        columns = [
            -response.force(effect)[:, 6:][:, branch] / step
            if c.kind.id in _BODIES and c.recordings is None
            else np.zeros_like(own)
            for c in candidates
            for effect, step in c.small_steps
        ]
        torques.append((own, np.stack(columns, axis=2)))
    square = sum(float(np.sum(own**2)) for own, _ in torques)
    return np.asarray(sum(np.einsum('nj,njk->k', *pair) for pair in torques) / square)
