r"""Derivatives of the accelerations at N states: Pinocchio's, and those of the gyrostats.

With a_j the axes of joints that turn, w the rate and H the momentum of a gyrostat on a body that
they bear, a motion needs a_j . (w x H) more of joint j. In base coordinates, for k that bears the
body, and w_k the rate of its own body,

    d/d q_k   = (a_k x a_j, where j is farther out) . (w x H)
              + a_j . [(a_k x (w - w_k)) x H + w x (a_k x H)],    d/d q'_k = a_j . (a_k x H)

and the same of the base's rate with the unit axes in place of a.
"""

from __future__ import annotations

import numpy as np

from ..model.robot import Robot
from ..types import Array
from .forward_kinematics import BodyKinematics
from .rotation import cross_rows


def acceleration_derivatives(
    robot: Robot, q: Array, rates: Array, kinematics: BodyKinematics, forces: Array
) -> tuple[Array, Array, Array]:
    """Derivatives of the accelerations [base; joints]; nobody holds a free base against gravity.

    Args:
        robot: The robot.
        q: (N, n) joint positions.
        rates: (N, 6 + n) generalized rates.
        kinematics: From `forward_kinematics`.
        forces: (N, 6 + n) generalized forces that act.

    Returns:
        By joint positions, by generalized rates, by generalized forces: each (N, 6 + n, 6 + n);
        columns of the base's position, and all of a fixed base, are zero.

    Raises:
        LinAlgError: a mass matrix is singular.
    """
    import pinocchio as pin  # late: no node's start waits for it

    from .pinocchio_model import in_pinocchio

    own, first = in_pinocchio(robot), 0 if robot.is_free else 6
    data, columns = own.model.createData(), own.columns
    needed, gyro_q, gyro_v = _gyrostats(robot, kinematics)
    states = np.zeros((len(q), own.model.nq))
    if robot.is_free:
        states[:, 6] = 1.0
    states[:, own.model.nq - q.shape[1] + own.velocity_indices] = q
    out = np.zeros((3, len(q), *needed.shape[1:] * 2))
    places = zip(*out[:, :, first:, first:], strict=True)
    each = zip(states, rates[:, columns], (forces - needed)[:, columns], strict=True)
    for (by_q, by_v, inverse), state in zip(places, each, strict=True):
        by_q[:], by_v[:], inverse[:] = pin.computeABADerivatives(own.model, data, *state)
    i, j = np.tril_indices(out.shape[2], -1)
    out[2, :, i, j] = out[2, :, j, i]  # Pinocchio writes one half
    if not np.isfinite(out[2]).all():
        raise np.linalg.LinAlgError('Singular matrix')
    back = np.argsort([*range(first), *columns])
    by_q, by_v, inverse = out[:, :, back[:, None], back]
    by_q[:, :, :6] = 0.0
    if not robot.gyrostats:
        return by_q, by_v, inverse
    return by_q - inverse @ gyro_q, by_v - inverse @ gyro_v, inverse


def _gyrostats(robot: Robot, kinematics: BodyKinematics) -> tuple[Array, Array, Array]:
    """Generalized forces that gyrostats need, and their derivatives by positions and rates."""
    R, count, size = kinematics.rotations, len(kinematics.rotations), 6 + robot.n_joints
    needed, by_q, by_v = np.zeros((count, size)), *np.zeros((2, count, size, size))
    axes = (R @ np.array([body.axis for body in robot.bodies])[..., None])[..., 0]
    turning = (R @ kinematics.twists[..., 3:, None])[..., 0]
    for g in robot.gyrostats:
        body, bearing = g.body, list[int]()
        while body > 0:
            if not robot.bodies[body].is_prismatic:
                bearing.append(body)
            body = robot.bodies[body].parent
        A = np.zeros((count, size, 3))
        A[:, 3:6] = np.eye(3) if robot.is_free else 0.0
        A[:, [5 + k for k in bearing]] = axes[:, bearing]
        H, w = R[:, g.body] @ g.body_momentum, turning[:, g.body]
        torque = cross_rows(w, H)
        needed += np.einsum('nja,na->nj', A, torque)
        by_v += A @ np.swapaxes(cross_rows(A, H[:, None]), 1, 2)
        for place, k in enumerate(bearing):  # the outermost first
            a = axes[:, k]
            moved = cross_rows(cross_rows(a, w - turning[:, k]), H)
            moved += cross_rows(w, cross_rows(a, H))
            by_q[:, :, 5 + k] += np.einsum('nja,na->nj', A, moved)
            outer = [5 + j for j in bearing[:place]]
            swept = cross_rows(a[:, None], A[:, outer])
            by_q[:, outer, 5 + k] += np.einsum('nja,na->nj', swept, torque)
    return needed, by_q, by_v
