r"""RNEA derivatives, and by the mass matrix those of the accelerations, at N states.

Singh, Russo and Wensing, IEEE Robotics and Automation Letters 7 (2022), in base coordinates about
the base's origin, with the gyrostats' momentum h among the momenta. With I, 2 B and f of the part
of the tree from a joint outwards, V and A of body and parent p, for joint j and any i,

    psi' = V_p x S,  psi'' = A_p x S + V_p x psi',  S' = V x S
    d tau_i / d q_j  = S_i . [2 B psi'_j + I psi''_j (+ S_j x* f_j where i is nearer the base)]
    d tau_i / d q'_j = S_i . [2 B S_j + I (psi'_j + S'_j)]

B and I those of the outer of i and j, nothing where neither bears the other. Of a body with
momentum P = I V + [0; h] the matrix 2 B takes a motion m to V x* I m - I (V x m) + m x* P.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..types import Array
from .compiling import compiled, inner
from .crba import apply_inertia, compose, crba, place_inertias, place_links
from .forward_kinematics import BodyKinematics, body_accelerations, shifted
from .rnea import rnea
from .spatial import add6, force_cross, get, get6, motion_cross, plus, power, put6, rotate, times
from .tree import FREE, LINK, Records

_AXES = np.eye(6)


def acceleration_derivatives(
    tree: Records, kinematics: BodyKinematics, forces: Array
) -> tuple[Array, Array, Array]:
    """Derivatives of the accelerations [base; joints].

    Args:
        tree: `BODY` records; gravity in base coordinates.
        kinematics: From `forward_kinematics`.
        forces: (N, 6 + n) generalized forces that act.

    Returns:
        By joint positions, by generalized rates, by generalized forces: each (N, 6 + n, 6 + n);
        columns of the base's position, and all of a fixed base, are zero.
    """
    first = 0 if tree[0]['kind'] == FREE else 6
    M, still = crba(tree, kinematics), np.zeros(forces.shape)
    inverse = np.zeros_like(M)
    inverse[:, first:, first:] = np.linalg.inv(M[:, first:, first:])
    coasting = body_accelerations(tree, kinematics, still)
    forces = forces - rnea(tree, kinematics, coasting, still[:, 6:].copy())
    acceleration = np.einsum('nij,nj->ni', inverse, forces)
    accelerations = body_accelerations(tree, kinematics, acceleration)
    by_q, by_v = rnea_derivatives(tree, kinematics, accelerations)
    return -inverse @ by_q, -inverse @ by_v, inverse


@compiled
def rnea_derivatives(
    tree: Records, kinematics: BodyKinematics, accelerations: Array
) -> tuple[Array, Array]:
    """Derivatives of the generalized forces that a motion needs.

    Args:
        tree: `BODY` records; gravity in base coordinates.
        kinematics: From `forward_kinematics`.
        accelerations: (N, n + 1, 6) from `body_accelerations`.

    Returns:
        By joint positions and by generalized rates, (N, 6 + n, 6 + n) each; columns of the base's
        position are zero.
    """
    count, width = len(accelerations), 5 + len(tree)
    by_q, by_v = np.zeros((count, width, width)), np.zeros((count, width, width))
    links = np.zeros(len(tree), LINK)
    for s in range(count):
        place_links(kinematics.rotations[s], kinematics.origins[s], links)
        place_inertias(tree, links)
        for i in range(len(tree)):
            own, k = links[tree[i].number], tree[i].number
            own.offset[:] = -own.origin  # the way back
            _set_motion(own, kinematics.twists[s, k], own.velocity)
            _set_motion(own, accelerations[s, k], own.acceleration)
            add6(own.acceleration, times(-1.0, get(tree[0].gravity, 0)), (0.0, 0.0, 0.0))
            _set_forces(tree[i], own)
            if i > 0:
                _set_directions(own, links[tree[i].parent])
        compose(tree, links)
        _compose_forces(tree, links)
        _base_columns(links[0], by_v[s])
        for j in range(1, len(tree)):
            _joint_columns(j, tree, links, by_q[s], by_v[s])
            _joint_rows(j, tree, links, by_q[s], by_v[s])
    return by_q, by_v


@inner
def _set_motion(own: Any, motion: Array, out: Array) -> None:
    """Write a motion of a body's frame, given in it, about the base's origin."""
    v, w = get6(motion)
    put6(out, rotate(own.rotation, v), rotate(own.rotation, w))
    put6(out, *shifted(out, own.offset))


@inner
def _set_directions(own: Any, parent: Any) -> None:
    """psi', psi'' and psi' + S' of a joint."""
    S = get6(own.screw)
    put6(own.psi, *motion_cross(parent.velocity, *S))
    put6(own.psi_dot, *motion_cross(parent.acceleration, *S))
    add6(own.psi_dot, *motion_cross(parent.velocity, *get6(own.psi)))
    put6(own.swept, *motion_cross(own.velocity, *S))
    add6(own.swept, *get6(own.psi))


@inner
def _set_forces(body: Any, own: Any) -> None:
    """F and, a column a row, 2 B of a body alone."""
    V = own.velocity
    p, h = apply_inertia(own, *get6(V))
    h = plus(h, rotate(own.rotation, get(body.wheels, 0)))
    put6(own.force, *apply_inertia(own, *get6(own.acceleration)))
    add6(own.force, *force_cross(V, p, h))
    for b in range(6):
        m = get6(_AXES[b])
        f, n = apply_inertia(own, *motion_cross(V, *m))
        put6(own.turning[b], times(-1.0, f), times(-1.0, n))
        add6(own.turning[b], *force_cross(V, *apply_inertia(own, *m)))
        add6(own.turning[b], *force_cross(_AXES[b], p, h))


@inner
def _compose_forces(tree: Records, links: Records) -> None:
    """Add f and 2 B of every part of the tree to the one that bears it."""
    for i in range(len(tree) - 1, 0, -1):
        own, parent = links[tree[i].number], links[tree[i].parent]
        add6(parent.force, *get6(own.force))
        for b in range(6):
            add6(parent.turning[b], *get6(own.turning[b]))


@inner
def _weigh(own: Any, once: Array, twice: Array, out: Array) -> None:
    """Write I once + 2 B twice of a composite."""
    put6(out, *apply_inertia(own, *get6(once)))
    for b in range(6):
        for a in range(6):
            out[a] += own.turning[b, a] * twice[b]


@inner
def _base_columns(root: Any, D: Array) -> None:
    """Columns of the base's rates, in its own rows."""
    for b in range(6):
        put6(root.swept, *motion_cross(root.velocity, *get6(_AXES[b])))
        _weigh(root, root.swept, _AXES[b], root.bias)
        for a in range(6):
            D[a, b] = root.bias[a]


@inner
def _joint_columns(j: int, tree: Records, links: Records, Q: Array, D: Array) -> None:
    """Columns of joint j, in its own row and those of all that bear it."""
    own, column = links[tree[j].number], 5 + tree[j].number
    by_q, by_v = own.bias, own.drift
    _weigh(own, own.psi_dot, own.psi, by_q)
    _weigh(own, own.swept, own.screw, by_v)
    add6(by_q, *force_cross(own.screw, *get6(own.force)))
    for a in range(6):
        Q[a, column], D[a, column] = by_q[a], by_v[a]
    at = tree[j].number
    for i in range(j, 0, -1):
        if tree[i].number == at:
            Q[5 + at, column] = power(links[at].screw, by_q)
            D[5 + at, column] = power(links[at].screw, by_v)
            at = tree[i].parent


@inner
def _joint_rows(j: int, tree: Records, links: Records, Q: Array, D: Array) -> None:
    """The row of joint j by the joints that bear it and by the base, S . I and S . 2 B first."""
    own, row = links[tree[j].number], 5 + tree[j].number
    once, twice = own.bias, own.drift
    put6(once, *apply_inertia(own, *get6(own.screw)))
    for b in range(6):
        twice[b] = power(own.turning[b], own.screw)
    at = tree[j].parent
    for i in range(j - 1, 0, -1):
        if tree[i].number == at:
            outer = links[at]
            Q[row, 5 + at] = power(outer.psi_dot, once) + power(outer.psi, twice)
            D[row, 5 + at] = power(outer.swept, once) + power(outer.screw, twice)
            at = tree[i].parent
    force, torque = force_cross(links[0].velocity, *get6(once))
    put6(D[row], *get6(twice))
    add6(D[row], times(-1.0, force), times(-1.0, torque))
