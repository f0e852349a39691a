r"""Forward dynamics of a tree of bodies with spinning wheels, compiled.

The articulated-body algorithm (Featherstone, Rigid Body Dynamics Algorithms, section 7.3), in
base coordinates and each body's quantities about its own joint: between bodies they are only
shifted, and a fast wheel far from the base loses no digits. With V = [v; w] a body's spatial
velocity, I its inertia, J_m its motor's and X the shift by d from the parent's joint,

    V = X V(parent) + S q'                 X [v; w] = [v + w x d; w]
    P = I V + [0; R h]                     momentum, with h of the body's gyrostat
    p = V x* P = [w x P_v; w x P_w + v x P_v],    c = V x S q'
    U = I_A S,  D = S . U + J_m,  u = tau - S . p_A                            (tips to base)
    I_A(parent) += X^T (I_A - U U^T / D) X
    p_A(parent) += X^T (p_A + I_A c + U (u - U . c) / D)
    a' = X a(parent) + c,  q'' = (u - U . a') / D,  a = a' + S q''             (base to tips)

Three joints and two gyrostats: a call through `Dynamics.rate` takes 2.5 us where one around
Pinocchio's `aba`, with which the tests compare it, took 9; from compiled code, as in
`integrate_kernel`, it is 0.7 us. Compilation takes some ten seconds once a machine; the result is
cached beside this file.
"""

from __future__ import annotations

import math
from typing import Any

import numba

from ..types import Array, Vector3, Vector6
from .tree import Machine

compiled = numba.njit(cache=True, error_model='numpy')  # a singular machine gives NaN, no error


@compiled  # type: ignore[untyped-decorator]
def rate(machine: Machine, x: Array, tau: Array, wrench: Vector6, out: Array) -> None:
    """Write the time derivative of the state vector.

    Args:
        machine: From `machine_of`; its scratch memory is overwritten.
        x: (13 + 2 n,) state as `State.to_vector`; the quaternion may have any length.
        tau: (n,) joint torques [N m].
        wrench: (6,) [force; torque] on the base in base coordinates [N, N m].
        out: (13 + 2 n,) written; zero for the base if it is fixed.
    """
    bodies, scratch, is_free, joint_reaction, gravity = machine
    n = bodies.shape[0] - 1
    root = scratch[0]
    for a in range(3):
        for b in range(3):
            root.rotation[a, b] = 1.0 if a == b else 0.0
    for a in range(6):
        root.velocity[a] = x[7 + n + a] if is_free else 0.0
    _load(bodies[0], root, root)
    for i in range(1, n + 1):
        body, own, parent = bodies[i], scratch[i], scratch[bodies[i].parent]
        joint = body.joint
        _place(body, own, parent, x[7 + joint])
        _move(own, parent, x[13 + n + joint])
        _load(body, own, own if joint_reaction else root)
    for i in range(n, 0, -1):
        _fold(bodies[i], scratch[i], scratch[bodies[i].parent], tau[bodies[i].joint])
    _move_base(root, is_free, gravity, x, wrench, out)
    for i in range(1, n + 1):
        joint = bodies[i].joint
        out[7 + joint] = x[13 + n + joint]
        out[13 + n + joint] = _accelerate(scratch[i], scratch[bodies[i].parent])


@compiled  # type: ignore[untyped-decorator]
def _cross(a: Array, b: Array) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled  # type: ignore[untyped-decorator]
def _turned(R: Array, v: Array) -> tuple[float, float, float]:
    return (
        R[0, 0] * v[0] + R[0, 1] * v[1] + R[0, 2] * v[2],
        R[1, 0] * v[0] + R[1, 1] * v[1] + R[1, 2] * v[2],
        R[2, 0] * v[0] + R[2, 1] * v[1] + R[2, 2] * v[2],
    )


@compiled  # type: ignore[untyped-decorator]
def _place(body: Any, own: Any, parent: Any, q: float) -> None:
    """Rotation, offset from the parent's joint and motion subspace S at joint position q."""
    sine, versine = (0.0, 0.0) if body.slides else (math.sin(q), 1.0 - math.cos(q))
    still, with_sine, with_versine = body.turn[0], body.turn[1], body.turn[2]
    for b in range(3):
        column = (
            still[0, b] + sine * with_sine[0, b] + versine * with_versine[0, b],
            still[1, b] + sine * with_sine[1, b] + versine * with_versine[1, b],
            still[2, b] + sine * with_sine[2, b] + versine * with_versine[2, b],
        )
        own.rotation[0, b], own.rotation[1, b], own.rotation[2, b] = _turned(
            parent.rotation, column
        )
    offset, axis = _turned(parent.rotation, body.translation), _turned(own.rotation, body.axis)
    along = q if body.slides else 0.0
    for a in range(3):
        own.offset[a] = offset[a] + along * axis[a]
        own.subspace[a] = axis[a] if body.slides else 0.0
        own.subspace[3 + a] = 0.0 if body.slides else axis[a]


@compiled  # type: ignore[untyped-decorator]
def _move(own: Any, parent: Any, qd: float) -> None:
    """Velocity V and drift c."""
    S, V = own.subspace, own.velocity
    carried = _cross(parent.velocity[3:], own.offset)
    for a in range(3):
        V[a] = parent.velocity[a] + carried[a] + S[a] * qd
        V[3 + a] = parent.velocity[3 + a] + S[3 + a] * qd
    turning, slipping, spinning = _cross(V[3:], S[:3]), _cross(V[:3], S[3:]), _cross(V[3:], S[3:])
    for a in range(3):
        own.drift[a] = (turning[a] + slipping[a]) * qd
        own.drift[3 + a] = spinning[a] * qd


@compiled  # type: ignore[untyped-decorator]
def _load(body: Any, own: Any, wheel_load: Any) -> None:
    """Inertia, and the bias force p of body and wheels."""
    R, J, m = own.rotation, own.inertia, body.mass
    c = _turned(R, body.com)
    square = c[0] * c[0] + c[1] * c[1] + c[2] * c[2]
    for a in range(3):
        row = _turned(body.inertia, R[a])  # symmetric
        for b in range(a + 1):
            J[3 + a, 3 + b] = (
                row[0] * R[b, 0] + row[1] * R[b, 1] + row[2] * R[b, 2] - m * c[a] * c[b]
            )
            J[a, b] = 0.0
        J[3 + a, 3 + a] += m * square
        J[a, a] = m
        J[3 + a, a] = 0.0
    J[3, 1], J[3, 2] = -m * c[2], m * c[1]
    J[4, 0], J[4, 2] = m * c[2], -m * c[0]
    J[5, 0], J[5, 1] = -m * c[1], m * c[0]
    v, w = own.velocity[:3], own.velocity[3:]
    slip, swing = _cross(w, c), _cross(c, v)
    p = (m * (v[0] + slip[0]), m * (v[1] + slip[1]), m * (v[2] + slip[2]))
    h = (
        swing[0] * m + J[3, 3] * w[0] + J[4, 3] * w[1] + J[5, 3] * w[2],
        swing[1] * m + J[4, 3] * w[0] + J[4, 4] * w[1] + J[5, 4] * w[2],
        swing[2] * m + J[5, 3] * w[0] + J[5, 4] * w[1] + J[5, 5] * w[2],
    )
    force, torque, twist = _cross(w, p), _cross(w, h), _cross(v, p)
    for a in range(3):
        own.bias[a] = force[a]
        own.bias[3 + a] = torque[a] + twist[a]
    gyroscopic = _cross(w, _turned(R, body.wheels))
    for a in range(3):
        wheel_load.bias[3 + a] += gyroscopic[a]


@compiled  # type: ignore[untyped-decorator]
def _times(J: Array, S: Array, out: Array) -> None:
    """Product with a symmetric matrix of which the lower triangle is kept."""
    for a in range(6):
        total = 0.0
        for b in range(6):
            total += (J[a, b] if a >= b else J[b, a]) * S[b]
        out[a] = total


@compiled  # type: ignore[untyped-decorator]
def _dot(a: Array, b: Array) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


@compiled  # type: ignore[untyped-decorator]
def _fold(body: Any, own: Any, parent: Any, tau: float) -> None:
    """Pass a body's articulated inertia and bias force to its parent."""
    J, U, F = own.inertia, own.force, own.acceleration
    _times(J, own.subspace, U)
    _times(J, own.drift, F)
    own.pivot = 1.0 / (_dot(U, own.subspace) + body.motor)
    own.torque = tau - _dot(own.subspace, own.bias)
    held = (own.torque - _dot(U, own.drift)) * own.pivot
    for a in range(6):
        share = U[a] * own.pivot
        F[a] += own.bias[a] + held * U[a]
        for b in range(a + 1):
            J[a, b] -= share * U[b]
    _shift_inertia(J, own.offset, parent.inertia)
    moment = _cross(own.offset, F[:3])
    for a in range(3):
        parent.bias[a] += F[a]
        parent.bias[3 + a] += F[3 + a] + moment[a]


@compiled  # type: ignore[untyped-decorator]
def _shift_inertia(J: Array, d: Array, out: Array) -> None:
    """Add X^T I X. With J = [[M, L^T], [L, C]]: L' = L + d x M, C' = C + d x L + (d x L')^T."""
    M0, M1, M2 = (
        (J[0, 0], J[1, 0], J[2, 0]),
        (J[1, 0], J[1, 1], J[2, 1]),
        (J[2, 0], J[2, 1], J[2, 2]),
    )
    shifted = (_cross(d, M0), _cross(d, M1), _cross(d, M2))
    for a in range(3):
        for b in range(a + 1):
            out[a, b] += J[a, b]
    for a in range(3):
        row = (J[3 + a, 0], J[3 + a, 1], J[3 + a, 2])
        new = (row[0] + shifted[0][a], row[1] + shifted[1][a], row[2] + shifted[2][a])
        before, after = _cross(d, row), _cross(d, new)
        for b in range(3):
            out[3 + a, b] += new[b]
        for b in range(a + 1):
            out[3 + a, 3 + b] += J[3 + a, 3 + b] + before[b]
        for b in range(a, 3):
            out[3 + b, 3 + a] += after[b]


@compiled  # type: ignore[untyped-decorator]
def _accelerate(own: Any, parent: Any) -> float:
    """Joint acceleration; leaves the body's own."""
    A = own.acceleration
    carried = _cross(parent.acceleration[3:], own.offset)
    for a in range(3):
        A[a] = parent.acceleration[a] + carried[a] + own.drift[a]
        A[3 + a] = parent.acceleration[3 + a] + own.drift[3 + a]
    qdd = (own.torque - _dot(own.force, A)) * own.pivot
    for a in range(6):
        A[a] += own.subspace[a] * qdd
    return qdd


@compiled  # type: ignore[untyped-decorator]
def _move_base(
    root: Any, is_free: bool, gravity: Vector3, x: Array, wrench: Vector6, out: Array
) -> None:
    """Rates of the base; gravity is an acceleration of the frame that the tree moves in."""
    n = (x.shape[0] - 13) // 2
    if not is_free:
        for a in range(3):
            root.acceleration[a], root.acceleration[3 + a] = -gravity[a], 0.0
        for a in range(7):
            out[a] = 0.0
        for a in range(7 + n, 13 + n):
            out[a] = 0.0
        return
    for a in range(6):
        root.acceleration[a] = wrench[a] - root.bias[a]
    _solve(root.inertia, root.acceleration)
    q = x[3:7]
    k = 2.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    velocity = _rotated(q, q[3], k, root.velocity)
    fall = _rotated(q, -q[3], k, gravity)
    spin = _cross(q, root.velocity[3:])
    for a in range(3):
        out[a] = velocity[a]
        out[3 + a] = 0.5 * (q[3] * root.velocity[3 + a] + spin[a])
        out[7 + n + a] = root.acceleration[a] + fall[a]
        out[10 + n + a] = root.acceleration[3 + a]
    w = root.velocity[3:]
    out[6] = -0.5 * (q[0] * w[0] + q[1] * w[1] + q[2] * w[2])


@compiled  # type: ignore[untyped-decorator]
def _rotated(e: Array, w: float, k: float, v: Array) -> tuple[float, float, float]:
    """R v = v + k e x (e x v + w v) for the quaternion [e, w], with k = 2 / (e . e + w^2)."""
    s = _cross(e, v)
    t = _cross(e, (s[0] + w * v[0], s[1] + w * v[1], s[2] + w * v[2]))
    return v[0] + k * t[0], v[1] + k * t[1], v[2] + k * t[2]


@compiled  # type: ignore[untyped-decorator]
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
