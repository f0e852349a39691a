r"""Inverse dynamics of a tree with gyrostats at N states at once, compiled.

Newton and Euler in each body's own frame (Featherstone, Rigid Body Dynamics Algorithms, 5.3), with
its inertial parameters, velocity V = [v; w], acceleration A (`forward_kinematics`), gravity as an
acceleration of the whole, and the momentum h of its wheels:

    P = I V + [0; h],    f = I A + [w x P_v; w x P_w + v x P_v]

Wrenches are summed towards the base about its origin. The result is linear in inertial parameters,
wheels and motors together, so a difference of two robots takes one call.
"""

from __future__ import annotations

import numpy as np

from ..types import Array, Vector3
from .forward_kinematics import along_axis, compiled, to_base
from .tree import Records


@compiled  # type: ignore[untyped-decorator]
def rnea(
    tree: Records,
    is_free: bool,
    gravity: Vector3,
    inertial: Array,
    wheels: Array,
    motors: Array,
    rotations: Array,
    origins: Array,
    twists: Array,
    accelerations: Array,
    qdd: Array,
) -> Array:
    """Generalised forces that a motion needs.

    Args:
        tree: From `body_records`; only its geometry counts.
        is_free: Whether the base moves.
        gravity: (3,) in base coordinates.
        inertial: (n + 1, 10) of every body, as `Robot.inertial_parameters`.
        wheels: (n + 1, 3) momentum of its gyrostats, in its frame [N m s].
        motors: (n,) motor inertias [kg m^2].
        rotations: From `forward_kinematics`.
        origins: From there.
        twists: From there.
        accelerations: From `body_accelerations`.
        qdd: (N, n) joint accelerations.

    Returns:
        (N, 6 + n); the first six are zero for a fixed base.
    """
    count, bodies = origins.shape[:2]
    out = np.zeros((count, 5 + bodies))
    total, wrench, moved = np.zeros((bodies, 6)), np.empty(6), np.empty(6)
    loaded = np.zeros(bodies, dtype=np.bool_)
    for i in range(bodies):
        own = tree[i].joint + 1
        loaded[i] = (i > 0 or is_free) and (inertial[own].any() or wheels[own].any())
    for s in range(count):
        for i in range(bodies - 1, -1, -1):
            body = tree[i]
            own = body.joint + 1
            if loaded[i]:
                _needed(
                    s, own, gravity, inertial, wheels, rotations, twists, accelerations, wrench
                )
                to_base(s, own, rotations, origins, wrench, moved)
                for a in range(6):
                    total[i, a] += moved[a]
            if i > 0:
                force = along_axis(s, body, rotations, origins, total[i])
                out[s, 6 + body.joint] = force + motors[body.joint] * qdd[s, body.joint]
                for a in range(6):
                    total[body.parent, a] += total[i, a]
                    total[i, a] = 0.0
        for a in range(6):
            out[s, a] = total[0, a] if is_free else 0.0
            total[0, a] = 0.0
    return out


@compiled  # type: ignore[untyped-decorator]
def _needed(
    s: int,
    own: int,
    g: Vector3,
    inertial: Array,
    wheels: Array,
    rotations: Array,
    twists: Array,
    accelerations: Array,
    out: Array,
) -> None:
    """Wrench f of one body, in its frame."""
    R, V, A, phi = rotations[s, own], twists[s, own], accelerations[s, own], inertial[own]
    m, r0, r1, r2 = phi[0], phi[1], phi[2], phi[3]
    v0, v1, v2, w0, w1, w2 = V[0], V[1], V[2], V[3], V[4], V[5]
    a0 = A[0] - R[0, 0] * g[0] - R[1, 0] * g[1] - R[2, 0] * g[2]
    a1 = A[1] - R[0, 1] * g[0] - R[1, 1] * g[1] - R[2, 1] * g[2]
    a2 = A[2] - R[0, 2] * g[0] - R[1, 2] * g[1] - R[2, 2] * g[2]
    u0, u1, u2 = A[3], A[4], A[5]
    p0 = m * v0 + w1 * r2 - w2 * r1
    p1 = m * v1 + w2 * r0 - w0 * r2
    p2 = m * v2 + w0 * r1 - w1 * r0
    h0 = r1 * v2 - r2 * v1 + phi[4] * w0 + phi[5] * w1 + phi[7] * w2 + wheels[own, 0]
    h1 = r2 * v0 - r0 * v2 + phi[5] * w0 + phi[6] * w1 + phi[8] * w2 + wheels[own, 1]
    h2 = r0 * v1 - r1 * v0 + phi[7] * w0 + phi[8] * w1 + phi[9] * w2 + wheels[own, 2]
    out[0] = m * a0 + u1 * r2 - u2 * r1 + w1 * p2 - w2 * p1
    out[1] = m * a1 + u2 * r0 - u0 * r2 + w2 * p0 - w0 * p2
    out[2] = m * a2 + u0 * r1 - u1 * r0 + w0 * p1 - w1 * p0
    out[3] = r1 * a2 - r2 * a1 + phi[4] * u0 + phi[5] * u1 + phi[7] * u2
    out[4] = r2 * a0 - r0 * a2 + phi[5] * u0 + phi[6] * u1 + phi[8] * u2
    out[5] = r0 * a1 - r1 * a0 + phi[7] * u0 + phi[8] * u1 + phi[9] * u2
    out[3] += w1 * h2 - w2 * h1 + v1 * p2 - v2 * p1
    out[4] += w2 * h0 - w0 * h2 + v2 * p0 - v0 * p2
    out[5] += w0 * h1 - w1 * h0 + v0 * p1 - v1 * p0
