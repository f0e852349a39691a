r"""Derivatives of a tree's accelerations at N states at once, compiled.

Singh, Russo and Wensing, IEEE Robotics and Automation Letters 7 (2022), in base coordinates about
the base's origin, with the gyrostats' momentum h among the momenta. With I, 2 B and f of the part
of the tree from a joint outwards, V and A of body and parent p, for joint j and any i,

    psi' = V_p x S,  psi'' = A_p x S + V_p x psi',  S' = V x S
    d tau_i / d q_j  = S_i . [2 B psi'_j + I psi''_j (+ S_j x* f_j where i is nearer the base)]
    d tau_i / d q'_j = S_i . [2 B S_j + I (psi'_j + S'_j)]

B and I those of the outer of i and j, nothing where neither carries the other. Of a body with
momentum P = I V + [0; h] the matrix 2 B takes the motion [v; w] to [-2 P_v x w; K w],

    K = w x J - J w x - v x C - C v x - P_w x,    I = [[m, -C], [C, J]].

The mass matrix M of the same composites turns them into derivatives of the accelerations.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..types import Array, Vector3
from .crba import (
    add_force_cross,
    add_inertia,
    bias,
    bias_forces,
    compose,
    dot,
    load,
    mass_matrix,
    motion_cross,
    move,
)
from .forward_kinematics import compiled
from .tree import Records


@compiled  # type: ignore[untyped-decorator]
def linearize(
    tree: Records,
    is_free: bool,
    gravity: Vector3,
    loads: tuple[Array, Array, Array],
    places: tuple[Array, Array, Array],
    qd: Array,
    forces: Array,
    parts: Any,
) -> tuple[Array, Array, Array]:
    """Derivatives of the accelerations [base; joints].

    Args:
        tree: From `body_records`; only its geometry counts.
        is_free: Whether the base moves.
        gravity: (3,) in base coordinates.
        loads: Inertial parameters, wheels and motors as `rnea.rnea` takes.
        places: Rotations, origins and velocities from `forward_kinematics`.
        qd: (N, n) joint rates.
        forces: (N, 6 + n) generalised forces that act.
        parts: (n + 1,) scratch records `PART`.

    Returns:
        By joint positions, by generalised rates, by generalised forces: each (N, 6 + n, 6 + n);
        columns of the base's position, and all of a fixed base, are zero.
    """
    count, width = forces.shape
    by_q, by_v = np.zeros((count, width, width)), np.zeros((count, width, width))
    inverse = np.zeros((count, width, width))
    M, Q, D = (
        np.zeros((width, width)),
        np.zeros((width, width)),
        np.zeros((width, width)),
    )
    tau = np.empty(width)
    first = 0 if is_free else 6
    for s in range(count):
        for i in range(len(tree)):
            load(s, i, tree, loads, places, parts)
            move(s, i, tree, gravity, places, qd, parts)
        for i in range(len(tree)):
            bias(parts[i], loads[1][tree[i].joint + 1], places[0][s, tree[i].joint + 1])
        compose(tree, parts)
        mass_matrix(tree, loads[2], parts, M)
        _invert(M, first, inverse[s])
        bias_forces(tree, parts, tau)
        for a in range(width):
            tau[a] = forces[s, a] - tau[a]
        _accelerate(tree, parts, inverse[s], tau)
        _gradients(tree, parts, Q, D)
        _into_accelerations(inverse[s], Q, first, by_q[s])
        _into_accelerations(inverse[s], D, first, by_v[s])
    return by_q, by_v, inverse


@compiled  # type: ignore[untyped-decorator]
def _factor(M: Array, first: int) -> None:
    """M[first:, first:] = L L^T for a symmetric positive definite M; L in its lower triangle."""
    for i in range(first, len(M)):
        for j in range(first, i + 1):
            total = M[i, j]
            for k in range(first, j):
                total -= M[i, k] * M[j, k]
            M[i, j] = np.sqrt(total) if i == j else total / M[j, j]


@compiled  # type: ignore[untyped-decorator]
def _invert(M: Array, first: int, out: Array) -> None:
    """Inverse of the symmetric positive definite M[first:, first:], which is lost."""
    n = len(M)
    _factor(M, first)
    for c in range(first, n):  # L^-1 into the upper triangle of `out`, a row a column
        for i in range(c, n):
            total = 1.0 if i == c else 0.0
            for k in range(c, i):
                total -= M[i, k] * out[c, k]
            out[c, i] = total / M[i, i]
    for i in range(first, n):
        for j in range(first, i + 1):
            total = 0.0
            for k in range(i, n):
                total += out[i, k] * out[j, k]
            M[i, j] = total
            M[j, i] = total
    out[first:, first:] = M[first:, first:]


@compiled  # type: ignore[untyped-decorator]
def _accelerate(tree: Records, parts: Any, inverse: Array, tau: Array) -> None:
    """Add what the forces accelerate to accelerations and forces, and finish the directions."""
    acceleration = inverse @ tau
    forced, needed = np.zeros((len(tree), 6)), np.zeros((len(tree), 6))
    forced[0] = acceleration[:6]
    for i in range(len(tree)):
        part, body = parts[i], tree[i]
        if i > 0:
            slope = acceleration[6 + body.joint]
            for a in range(6):
                forced[i, a] = forced[body.parent, a] + part.subspace[a] * slope
        add_inertia(part.own_mass, part.own_moment, part.own_inertia, forced[i], needed[i])
    for i in range(len(tree) - 1, -1, -1):
        part = parts[i]
        for a in range(6):
            part.acceleration[a] += forced[i, a]
            part.force[a] += needed[i, a]
            if i > 0:
                needed[tree[i].parent, a] += needed[i, a]
    moved = np.empty(6)
    for i in range(1, len(tree)):
        part, parent = parts[i], parts[tree[i].parent]
        motion_cross(parent.acceleration, part.subspace, part.psi_dot)
        motion_cross(parent.velocity, part.psi, moved)
        for a in range(6):
            part.psi_dot[a] += moved[a]


@compiled  # type: ignore[untyped-decorator]
def _gradients(tree: Records, parts: Any, Q: Array, D: Array) -> None:
    """Derivatives of the needed forces by joint positions and by generalised rates."""
    Q[:], D[:] = 0.0, 0.0
    by_q, by_v, both, unit = np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6)
    root = parts[0]
    for b in range(6):
        unit[b], by_v[:] = 1.0, 0.0
        motion_cross(root.velocity, unit, both)
        add_inertia(root.mass, root.moment, root.inertia, both, by_v)
        _add_twice_b(root, unit, by_v)
        D[:6, b], unit[b] = by_v, 0.0
    for j in range(1, len(tree)):
        part, column = parts[j], 6 + tree[j].joint
        by_q[:], by_v[:] = 0.0, 0.0
        for a in range(6):
            both[a] = part.psi[a] + part.swept[a]
        add_inertia(part.mass, part.moment, part.inertia, part.psi_dot, by_q)
        add_inertia(part.mass, part.moment, part.inertia, both, by_v)
        _add_twice_b(part, part.psi, by_q)
        _add_twice_b(part, part.subspace, by_v)
        add_force_cross(part.subspace, part.force, by_q)
        Q[:6, column], D[:6, column] = by_q, by_v
        i = j
        while i > 0:
            Q[6 + tree[i].joint, column] = dot(parts[i].subspace, by_q)
            D[6 + tree[i].joint, column] = dot(parts[i].subspace, by_v)
            i = tree[i].parent
        _gradients_of(j, tree, parts, Q, D)


@compiled  # type: ignore[untyped-decorator]
def _add_twice_b(part: Any, x: Array, out: Array) -> None:
    P, K = part.momentum, part.turning
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        out[a] -= 2.0 * (P[b] * x[3 + c] - P[c] * x[3 + b])
        out[3 + a] += K[a, 0] * x[3] + K[a, 1] * x[4] + K[a, 2] * x[5]


@compiled  # type: ignore[untyped-decorator]
def _gradients_of(i: int, tree: Records, parts: Any, Q: Array, D: Array) -> None:
    """The row of joint i by the joints that carry it and by the base."""
    part, row = parts[i], 6 + tree[i].joint
    S, P, K = part.subspace, part.momentum, part.turning
    held, turned, swept, unit = np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6)
    add_inertia(part.mass, part.moment, part.inertia, S, held)
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        turned[3 + a] = K[0, a] * S[3] + K[1, a] * S[4] + K[2, a] * S[5]
        turned[3 + a] -= 2.0 * (S[b] * P[c] - S[c] * P[b])
    j = tree[i].parent
    while j > 0:
        outer, column = parts[j], 6 + tree[j].joint
        Q[row, column] = dot(turned, outer.psi) + dot(held, outer.psi_dot)
        D[row, column] = dot(turned, outer.subspace) + dot(held, outer.psi)
        D[row, column] += dot(held, outer.swept)
        j = tree[j].parent
    for b in range(6):
        unit[b] = 1.0
        motion_cross(parts[0].velocity, unit, swept)
        D[row, b], unit[b] = turned[b] + dot(held, swept), 0.0


@compiled  # type: ignore[untyped-decorator]
def _into_accelerations(inverse: Array, gradient: Array, first: int, out: Array) -> None:
    """Write -M^-1 times the gradient of the needed forces."""
    n = len(inverse)
    for i in range(first, n):
        for k in range(first, n):
            weight = -inverse[i, k]
            for j in range(first, n):
                out[i, j] += weight * gradient[k, j]
