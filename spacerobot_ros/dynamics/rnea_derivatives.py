r"""RNEA derivatives, and by the mass matrix those of the accelerations, at N states, compiled.

Singh, Russo and Wensing, IEEE Robotics and Automation Letters 7 (2022), in base coordinates about
the base's origin, with the gyrostats' momentum h among the momenta. With I, 2 B and f of the part
of the tree from a joint outwards, V and A of body and parent p, for joint j and any i,

    psi' = V_p x S,  psi'' = A_p x S + V_p x psi',  S' = V x S
    d tau_i / d q_j  = S_i . [2 B psi'_j + I psi''_j (+ S_j x* f_j where i is nearer the base)]
    d tau_i / d q'_j = S_i . [2 B S_j + I (psi'_j + S'_j)]

B and I those of the outer of i and j, nothing where neither bears the other. Of a body with
momentum P = I V + [0; h] the matrix 2 B takes the motion [v; w] to [-2 P_v x w; K w],

    K = w x J - J w x - v x C - C v x - P_w x,    I = [[m, -C], [C, J]].
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..types import Array
from .crba import apply_inertia, compose, mass_matrix, place_inertias, place_links
from .forward_kinematics import BodyKinematics
from .spatial import (
    Triple,
    add,
    add_motion_cross,
    compiled,
    cross,
    dot,
    force_cross,
    get,
    inner,
    plus,
    power,
    put,
    rotate,
    rotate_back,
    times,
    unit,
)
from .tree import FREE, LINK, Records


@compiled  # type: ignore[untyped-decorator]
def acceleration_derivatives(
    tree: Records, kinematics: BodyKinematics, qd: Array, forces: Array
) -> tuple[Array, Array, Array]:
    """Derivatives of the accelerations [base; joints].

    Args:
        tree: `BODY` records; gravity in base coordinates.
        kinematics: From `forward_kinematics`.
        qd: (N, n) joint rates.
        forces: (N, 6 + n) generalised forces that act.

    Returns:
        By joint positions, by generalised rates, by generalised forces: each (N, 6 + n, 6 + n);
        columns of the base's position, and all of a fixed base, are zero.
    """
    count, width = forces.shape
    links = np.zeros(len(tree), LINK)
    by_q, by_v = np.zeros((count, width, width)), np.zeros((count, width, width))
    inverse = np.zeros((count, width, width))
    M, Q, D = np.zeros((width, width)), np.zeros((width, width)), np.zeros((width, width))
    acceleration = np.zeros(width)
    first = 0 if tree[0].kind == FREE else 6
    for s in range(count):
        place_links(kinematics.rotations[s], kinematics.origins[s], links)
        place_inertias(tree, links)
        for i in range(len(tree)):
            _move(tree, i, kinematics.twists[s], qd[s], links)
            _set_bias(tree[i], links[tree[i].number])
        compose(tree, links)
        _compose_forces(tree, links)
        M[:] = 0.0
        mass_matrix(tree, links, M)
        _invert(M, first, inverse[s])
        _accelerate(tree, links, inverse[s], forces[s], acceleration)
        _gradients(tree, links, Q, D)
        _into_accelerations(inverse[s], Q, first, by_q[s])
        _into_accelerations(inverse[s], D, first, by_v[s])
    return by_q, by_v, inverse


@inner  # type: ignore[untyped-decorator]
def _move(tree: Records, i: int, twists: Array, qd: Array, links: Records) -> None:
    """V, A at zero generalised acceleration, psi' and S' about the base's origin."""
    own = links[tree[i].number]
    if i == 0:
        put(own.velocity, 0, get(twists[0], 0))
        put(own.velocity, 3, get(twists[0], 3))
        put(own.acceleration, 0, times(-1.0, get(tree[0].gravity, 0)))
        put(own.acceleration, 3, (0.0, 0.0, 0.0))
        return
    parent, rate = links[tree[i].parent], qd[tree[i].number - 1]
    for a in range(6):
        own.psi[a] = own.swept[a] = 0.0
    add_motion_cross(parent.velocity, own.screw, 1.0, own.psi)
    for a in range(6):
        own.velocity[a] = parent.velocity[a] + own.screw[a] * rate
        own.acceleration[a] = parent.acceleration[a] + own.psi[a] * rate
    add_motion_cross(own.velocity, own.screw, 1.0, own.swept)


@inner  # type: ignore[untyped-decorator]
def _set_bias(body: Any, own: Any) -> None:
    """Momentum, K and f of a body alone, and its own inertia, which composing overwrites."""
    V, J, K, r = own.velocity, own.tensor, own.turning, get(own.moment, 0)
    v, w = get(V, 0), get(V, 3)
    P, L = apply_inertia(own.mass, r, J, v, w)
    L = plus(L, rotate(own.rotation, get(body.wheels, 0)))
    a, u = get(own.acceleration, 0), get(own.acceleration, 3)
    f, n = apply_inertia(own.mass, r, J, a, u)
    force, torque = force_cross(V, P, L)
    put(own.force, 0, plus(f, force))
    put(own.force, 3, plus(n, torque))
    put(own.momentum, 0, P)
    put(own.own_moment, 0, r)
    for b in range(3):
        spun = cross(w, (J[0, b], J[1, b], J[2, b]))  # a column of w x J
        for c in range(3):
            own.own_tensor[c, b] = J[c, b]
            K[c, b] = spun[c] - v[c] * r[b] - r[c] * v[b]
    for b in range(3):
        row = cross(w, (J[0, b], J[1, b], J[2, b]))
        minus = cross(L, unit(b))  # a row of -L x
        for c in range(3):
            K[b, c] += row[c] + minus[c]
        K[b, b] += 2.0 * dot(v, r)


@inner  # type: ignore[untyped-decorator]
def _compose_forces(tree: Records, links: Records) -> None:
    """Add momentum, K and f of every part of the tree to the one that bears it."""
    for i in range(len(tree) - 1, 0, -1):
        own, parent = links[tree[i].number], links[tree[i].parent]
        add(parent.momentum, 0, get(own.momentum, 0))
        for a in range(3):
            add(parent.turning[a], 0, get(own.turning[a], 0))
        for a in range(6):
            parent.force[a] += own.force[a]


@inner  # type: ignore[untyped-decorator]
def _factor(M: Array, first: int) -> None:
    """M[first:, first:] = L L^T for a symmetric positive definite M; L in its lower triangle."""
    for i in range(first, len(M)):
        for j in range(first, i + 1):
            total = M[i, j]
            for k in range(first, j):
                total -= M[i, k] * M[j, k]
            M[i, j] = np.sqrt(total) if i == j else total / M[j, j]


@inner  # type: ignore[untyped-decorator]
def _invert(M: Array, first: int, out: Array) -> None:
    """Inverse of the symmetric positive definite M[first:, first:], which is lost."""
    n = len(M)
    _factor(M, first)
    for c in range(first, n):  # L^-1 into the upper triangle of M's copy `out`, a row a column
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
    for i in range(first, n):
        for j in range(first, i + 1):
            out[i, j] = out[j, i] = M[i, j]


@inner  # type: ignore[untyped-decorator]
def _accelerate(
    tree: Records, links: Records, inverse: Array, forces: Array, acceleration: Array
) -> None:
    """Add what the forces accelerate to accelerations and forces, and finish the directions."""
    width = len(forces)
    acceleration[:] = 0.0
    for b in range(width):
        k = b - 5
        bias = links[0].force[b] if b < 6 else power(links[k].screw, links[k].force)
        for a in range(width):
            acceleration[a] += inverse[a, b] * (forces[b] - bias)
    _propagate(tree, links, acceleration)
    for i in range(1, len(tree)):
        own, parent = links[tree[i].number], links[tree[i].parent]
        own.psi_dot[:] = 0.0
        add_motion_cross(parent.acceleration, own.screw, 1.0, own.psi_dot)
        add_motion_cross(parent.velocity, own.psi, 1.0, own.psi_dot)


@inner  # type: ignore[untyped-decorator]
def _propagate(tree: Records, links: Records, acceleration: Array) -> None:
    """The links' accelerations on top of those at zero, and the forces that they need.

    `drift` is used for the acceleration, `bias` for the force.
    """
    for i in range(len(tree)):
        own, parent = links[tree[i].number], links[tree[i].parent]
        slope = 0.0 if i == 0 else acceleration[5 + tree[i].number]
        for a in range(6):
            own.drift[a] = parent.drift[a] + own.screw[a] * slope if i else acceleration[a]
            own.acceleration[a] += own.drift[a]
        v, w, r = get(own.drift, 0), get(own.drift, 3), get(own.own_moment, 0)
        f, n = apply_inertia(tree[i].inertial[0], r, own.own_tensor, v, w)
        put(own.bias, 0, f)
        put(own.bias, 3, n)
    for i in range(len(tree) - 1, -1, -1):
        own = links[tree[i].number]
        for a in range(6):
            own.force[a] += own.bias[a]
            if i > 0:
                links[tree[i].parent].bias[a] += own.bias[a]


@inner  # type: ignore[untyped-decorator]
def _weigh(own: Any, motion: Array, twice: Array, out: Array) -> None:
    """Write I motion + 2 B twice of a composite."""
    f, n = apply_inertia(own.mass, get(own.moment, 0), own.tensor, get(motion, 0), get(motion, 3))
    w = get(twice, 3)
    put(out, 0, plus(f, times(-2.0, cross(get(own.momentum, 0), w))))
    put(out, 3, plus(n, rotate(own.turning, w)))


@inner  # type: ignore[untyped-decorator]
def _gradients(tree: Records, links: Records, Q: Array, D: Array) -> None:
    """Derivatives of the needed forces by joint positions and by generalised rates."""
    Q[:], D[:] = 0.0, 0.0
    by_q, by_v, both, axis = np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6)
    for b in range(6):
        both[:], axis[b] = 0.0, 1.0
        add_motion_cross(links[0].velocity, axis, 1.0, both)
        _weigh(links[0], both, axis, by_v)
        for a in range(6):
            D[a, b] = by_v[a]
        axis[b] = 0.0
    for j in range(1, len(tree)):
        own, column = links[tree[j].number], 5 + tree[j].number
        for a in range(6):
            both[a] = own.psi[a] + own.swept[a]
        _weigh(own, own.psi_dot, own.psi, by_q)
        _weigh(own, both, own.screw, by_v)
        force, torque = force_cross(own.screw, get(own.force, 0), get(own.force, 3))
        add(by_q, 0, force)
        add(by_q, 3, torque)
        for a in range(6):
            Q[a, column], D[a, column] = by_q[a], by_v[a]
        at = tree[j].number
        for i in range(j, 0, -1):
            if tree[i].number == at:
                Q[5 + at, column] = power(links[at].screw, by_q)
                D[5 + at, column] = power(links[at].screw, by_v)
                at = tree[i].parent
        _gradients_of(j, tree, links, Q, D)


@inner  # type: ignore[untyped-decorator]
def _gradients_of(j: int, tree: Records, links: Records, Q: Array, D: Array) -> None:
    """The row of joint j by the joints that bear it and by the base."""
    own, row = links[tree[j].number], 5 + tree[j].number
    s_v, s_w, r = get(own.screw, 0), get(own.screw, 3), get(own.moment, 0)
    p, h = apply_inertia(own.mass, r, own.tensor, s_v, s_w)
    turned = rotate_back(own.turning, s_w)
    turned = plus(turned, times(-2.0, cross(s_v, get(own.momentum, 0))))
    at = tree[j].parent
    for i in range(j - 1, 0, -1):
        if tree[i].number == at:
            outer, column = links[at], 5 + at
            Q[row, column] = dot(turned, get(outer.psi, 3)) + _along(outer.psi_dot, p, h)
            D[row, column] = dot(turned, get(outer.screw, 3)) + _along(outer.psi, p, h)
            D[row, column] += _along(outer.swept, p, h)
            at = tree[i].parent
    force, torque = force_cross(links[0].velocity, p, h)
    put(D[row], 0, times(-1.0, force))
    put(D[row], 3, plus(turned, times(-1.0, torque)))


@inner  # type: ignore[untyped-decorator]
def _along(motion: Array, force: Triple, torque: Triple) -> float:
    return dot(get(motion, 0), force) + dot(get(motion, 3), torque)


@inner  # type: ignore[untyped-decorator]
def _into_accelerations(inverse: Array, gradient: Array, first: int, out: Array) -> None:
    """Write -M^-1 times the gradient of the needed forces."""
    n = len(inverse)
    for i in range(first, n):
        for k in range(first, n):
            weight = -inverse[i, k]
            for j in range(first, n):
                out[i, j] += weight * gradient[k, j]
