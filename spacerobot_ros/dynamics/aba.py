r"""ABA: forward dynamics of a tree of bodies with spinning wheels, compiled.

The articulated-body algorithm (Featherstone, Rigid Body Dynamics Algorithms, 7.3), in base
coordinates and each body's quantities about its own joint: between bodies they are only shifted,
and a fast wheel far from the base loses no digits. V, S and c are those of `forward_kinematics`;
with I a body's inertia, J_m its motor's and X the shift by d from the parent's joint,

    P = I V + [0; R h]                     momentum, with h of the body's gyrostat
    p = V x* P = [w x P_v; w x P_w + v x P_v]
    U = I_A S,  D = S . U + J_m,  u = tau - S . p_A                            (tips to base)
    I_A(parent) += X^T (I_A - U U^T / D) X
    p_A(parent) += X^T (p_A + I_A c + U (u - U . c) / D)
    a' = X a(parent) + c,  q'' = (u - U . a') / D,  a = a' + S q''             (base to tips)

Three joints and two gyrostats: a call through `Dynamics.rate` takes 2.5 us where one around
Pinocchio's `aba`, with which the tests compare it, took 9; from compiled code, as in the
integrator, it is 0.7 us.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..model.robot import Robot
from ..types import Array
from .compiling import Triple, compiled, inner
from .forward_kinematics import accelerate, propagate
from .rnea import inertia_times
from .spatial import add, add6, cross, dot, get, get6, plus, power, put, put6, rotate, times, turn
from .tree import FREE, LINK, Records, tree_of

RobotRecords = tuple[Records, Records, bool]
"""Records `BODY` and `LINK` (overwritten), and whether the wheels' torques load the joints, as
they do in every machine. A plain tuple: one with names costs a microsecond a call."""


def robot_records(robot: Robot, joint_reaction: bool = True) -> RobotRecords:
    """What `aba` takes of a robot."""
    return tree_of(robot), np.zeros(len(robot.bodies), LINK), joint_reaction


@compiled
def aba(machine: RobotRecords, x: Array, tau: Array, wrench: Array, out: Array) -> None:
    """Write the time derivatives of N state vectors.

    Args:
        machine: From `robot_records`.
        x: (N, 13 + 2 n) states as `State.to_vector`; the quaternions may have any length.
        tau: (N, n) joint torques [N m].
        wrench: (N, 6) [force; torque] on the base in base coordinates [N, N m].
        out: (N, 13 + 2 n) written; zero for the base if it is fixed.
    """
    tree, links, joint_reaction = machine
    n = len(tree) - 1
    for s in range(len(x)):
        propagate(tree, x[s, 7 : 7 + n], x[s, 7 + n :], x[s, 13 + n :], links)
        for i in range(n + 1):
            own = links[tree[i].number]
            _set_inertia(tree[i], own)
            _set_bias(tree[i], own)
        for i in range(n + 1):
            own = links[tree[i].number]
            w = get(own.velocity, 3)
            gyroscopic = cross(w, rotate(own.rotation, get(tree[i].wheels, 0)))
            add(own.bias if joint_reaction else links[0].bias, 3, gyroscopic)
        for i in range(n, 0, -1):
            own = links[tree[i].number]
            _articulate(own, links[tree[i].parent], tau[s, tree[i].number - 1], tree[i].motor)
        _accelerate_base(tree[0], links[0], x[s], wrench[s], out[s])
        for i in range(1, n + 1):
            k = tree[i].number
            out[s, 6 + k] = x[s, 12 + n + k]
            out[s, 12 + n + k] = _accelerate(links[k], links[tree[i].parent])


@inner
def _set_inertia(body: Any, own: Any) -> None:
    """Articulated inertia of the body alone; of all symmetric matrices the lower triangle."""
    R, J, phi = own.rotation, own.articulated, body.inertial
    h = rotate(R, get(phi, 1))
    put(own.moment, 0, h)
    for a in range(3):
        row = rotate(R, inertia_times(phi, get(R[a], 0)))
        for b in range(a + 1):
            J[3 + a, 3 + b] = row[b]
            J[a, b] = 0.0
        J[a, a] = phi[0]
        J[3 + a, a] = 0.0
    J[3, 1], J[3, 2] = -h[2], h[1]
    J[4, 0], J[4, 2] = h[2], -h[0]
    J[5, 0], J[5, 1] = -h[1], h[0]


@inner
def _set_bias(body: Any, own: Any) -> None:
    """Bias force p of the body alone, without its wheels."""
    J, h, (v, w) = own.articulated, get(own.moment, 0), get6(own.velocity)
    spin = (
        J[3, 3] * w[0] + J[4, 3] * w[1] + J[5, 3] * w[2],
        J[4, 3] * w[0] + J[4, 4] * w[1] + J[5, 4] * w[2],
        J[5, 3] * w[0] + J[5, 4] * w[1] + J[5, 5] * w[2],
    )
    p = plus(times(body.inertial[0], v), cross(w, h))
    put6(own.bias, cross(w, p), plus(cross(w, plus(cross(h, v), spin)), cross(v, p)))


@inner
def _times(J: Array, S: Array, out: Array) -> None:
    """Product with a symmetric matrix of which the lower triangle is kept."""
    for a in range(6):
        total = 0.0
        for b in range(6):
            total += (J[a, b] if a >= b else J[b, a]) * S[b]
        out[a] = total


@inner
def _articulate(own: Any, parent: Any, tau: float, motor: float) -> None:
    """Pass a link's articulated inertia and bias force to its parent."""
    J, U, F = own.articulated, own.force, own.acceleration
    _times(J, own.subspace, U)
    _times(J, own.drift, F)
    own.pivot = 1.0 / (power(U, own.subspace) + motor)
    own.torque = tau - power(own.subspace, own.bias)
    held = (own.torque - power(U, own.drift)) * own.pivot
    for a in range(6):
        share = U[a] * own.pivot
        F[a] += own.bias[a] + held * U[a]
        for b in range(a + 1):
            J[a, b] -= share * U[b]
    d, (force, torque) = get(own.offset, 0), get6(F)
    _shift_inertia(J, d, parent.articulated)
    add6(parent.bias, force, plus(torque, cross(d, force)))


@inner
def _shift_inertia(J: Array, d: Triple, out: Array) -> None:
    """Add X^T I X. With J = [[M, L^T], [L, C]]: L' = L + d x M, C' = C + d x L + (d x L')^T."""
    shifts = (
        cross(d, (J[0, 0], J[1, 0], J[2, 0])),
        cross(d, (J[1, 0], J[1, 1], J[2, 1])),
        cross(d, (J[2, 0], J[2, 1], J[2, 2])),
    )
    for a in range(3):
        for b in range(a + 1):
            out[a, b] += J[a, b]
    for a in range(3):
        row = (J[3 + a, 0], J[3 + a, 1], J[3 + a, 2])
        new = (row[0] + shifts[0][a], row[1] + shifts[1][a], row[2] + shifts[2][a])
        before, after = cross(d, row), cross(d, new)
        for b in range(3):
            out[3 + a, b] += new[b]
        for b in range(a + 1):
            out[3 + a, 3 + b] += J[3 + a, 3 + b] + before[b]
        for b in range(a, 3):
            out[3 + b, 3 + a] += after[b]


@inner
def _accelerate(own: Any, parent: Any) -> float:
    """Joint acceleration; leaves the link's own."""
    A = own.acceleration
    accelerate(own, parent)
    qdd = (own.torque - power(own.force, A)) * own.pivot
    for i in range(6):
        A[i] += own.subspace[i] * qdd
    return qdd


@inner
def _accelerate_base(body: Any, root: Any, x: Array, wrench: Array, out: Array) -> None:
    """Rates of the base; gravity is an acceleration of the frame that the tree moves in."""
    n, g = (len(x) - 13) // 2, get(body.gravity, 0)
    if body.kind != FREE:
        for a in range(7):
            out[a] = 0.0
        for a in range(6):
            out[7 + n + a] = root.acceleration[a] = 0.0
        put(root.acceleration, 0, times(-1.0, g))
        return
    for a in range(6):
        root.acceleration[a] = wrench[a] - root.bias[a]
    _solve(root.articulated, root.acceleration)
    e, eta, w = get(x, 3), x[6], get(root.velocity, 3)
    k = 2.0 / (dot(e, e) + eta * eta)
    put(out, 0, turn(e, eta, k, get(root.velocity, 0)))
    put(out, 3, times(0.5, plus(times(eta, w), cross(e, w))))
    out[6] = -0.5 * dot(e, w)
    put(out, 7 + n, plus(get(root.acceleration, 0), turn(e, -eta, k, g)))
    put(out, 10 + n, get(root.acceleration, 3))


@inner
def _solve(M: Array, b: Array) -> None:
    """Solve M x = b in place for a symmetric positive definite M, by M = L D L^T."""
    for i in range(6):
        for j in range(i):
            total = M[i, j]
            for k in range(j):
                total -= M[i, k] * M[j, k] * M[k, k]
            M[i, j] = total / M[j, j]
            M[i, i] -= M[i, j] * M[i, j] * M[j, j]
    for i in range(6):
        for j in range(i):
            b[i] -= M[i, j] * b[j]
    for i in range(6):
        b[i] /= M[i, i]
    for i in range(5, -1, -1):
        for j in range(i + 1, 6):
            b[i] -= M[j, i] * b[j]
