"""The part of a tree from each joint outwards as one body, compiled.

In base coordinates about the base's origin; see `rnea_derivatives` for the quantities. A motion
is [v; w], a force [force; torque].
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..types import Array, Vector3
from .forward_kinematics import axis_in_base, compiled
from .tree import Records

# What is known of a body: own inertia, and that of the part of the tree from its joint outwards.
PART = np.dtype(
    [
        ('subspace', np.float64, 6),
        ('velocity', np.float64, 6),
        ('acceleration', np.float64, 6),
        ('psi', np.float64, 6),
        ('psi_dot', np.float64, 6),
        ('swept', np.float64, 6),
        ('mass', np.float64),
        ('moment', np.float64, 3),
        ('inertia', np.float64, (3, 3)),
        ('own_mass', np.float64),
        ('own_moment', np.float64, 3),
        ('own_inertia', np.float64, (3, 3)),
        ('momentum', np.float64, 3),
        ('turning', np.float64, (3, 3)),
        ('force', np.float64, 6),
    ],
    align=True,
)


@compiled  # type: ignore[untyped-decorator]
def motion_cross(V: Array, m: Array, out: Array) -> None:
    """V x m."""
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        out[a] = V[3 + b] * m[c] - V[3 + c] * m[b] + V[b] * m[3 + c] - V[c] * m[3 + b]
        out[3 + a] = V[3 + b] * m[3 + c] - V[3 + c] * m[3 + b]


@compiled  # type: ignore[untyped-decorator]
def add_force_cross(V: Array, f: Array, out: Array) -> None:
    """Add V x* f."""
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        out[a] += V[3 + b] * f[c] - V[3 + c] * f[b]
        out[3 + a] += V[3 + b] * f[3 + c] - V[3 + c] * f[3 + b] + V[b] * f[c] - V[c] * f[b]


@compiled  # type: ignore[untyped-decorator]
def add_inertia(m: float, r: Array, J: Array, x: Array, out: Array) -> None:
    """Add I x."""
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        out[a] += m * x[a] + x[3 + b] * r[c] - x[3 + c] * r[b]
        out[3 + a] += r[b] * x[c] - r[c] * x[b]
        out[3 + a] += J[a, 0] * x[3] + J[a, 1] * x[4] + J[a, 2] * x[5]


@compiled  # type: ignore[untyped-decorator]
def dot(x: Array, y: Array) -> float:
    """Product of a motion and a force."""
    total = 0.0
    for a in range(6):
        total += x[a] * y[a]
    return total


@compiled  # type: ignore[untyped-decorator]
def load(s: int, i: int, tree: Records, loads: Any, places: Any, parts: Any) -> None:
    """A body's own inertia, in base coordinates about the base's origin."""
    own = tree[i].joint + 1
    R, p, phi, part = places[0][s, own], places[1][s, own], loads[0][own], parts[i]
    m, r, J = phi[0], part.own_moment, part.own_inertia
    part.own_mass = m
    for a in range(3):
        r[a] = R[a, 0] * phi[1] + R[a, 1] * phi[2] + R[a, 2] * phi[3]
    across = 2.0 * (p[0] * r[0] + p[1] * r[1] + p[2] * r[2])
    square = m * (p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
    for a in range(3):
        x = R[a, 0] * phi[4] + R[a, 1] * phi[5] + R[a, 2] * phi[7]
        y = R[a, 0] * phi[5] + R[a, 1] * phi[6] + R[a, 2] * phi[8]
        z = R[a, 0] * phi[7] + R[a, 1] * phi[8] + R[a, 2] * phi[9]
        for b in range(3):
            J[a, b] = x * R[b, 0] + y * R[b, 1] + z * R[b, 2]
            J[a, b] -= p[a] * r[b] + r[a] * p[b] + m * p[a] * p[b]
        J[a, a] += across + square
    for a in range(3):
        r[a] += m * p[a]


@compiled  # type: ignore[untyped-decorator]
def move(s: int, i: int, tree: Records, g: Vector3, places: Any, qd: Array, parts: Any) -> None:
    """Velocity, acceleration at zero generalised acceleration, and the joint's directions."""
    part, body = parts[i], tree[i]
    V, A, S = part.velocity, part.acceleration, part.subspace
    if i == 0:
        for a in range(6):
            V[a] = places[2][s, 0, a]
            A[a] = -g[a] if a < 3 else 0.0
        return
    parent = parts[body.parent]
    rate = qd[s, body.joint]
    axis = axis_in_base(s, body.joint + 1, body, places[0])
    p = places[1][s, body.joint + 1]
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        S[a] = axis[a] if body.slides else p[b] * axis[c] - p[c] * axis[b]
        S[3 + a] = 0.0 if body.slides else axis[a]
    motion_cross(parent.velocity, S, part.psi)
    for a in range(6):
        V[a] = parent.velocity[a] + S[a] * rate
        A[a] = parent.acceleration[a] + part.psi[a] * rate
    motion_cross(V, S, part.swept)


@compiled  # type: ignore[untyped-decorator]
def bias(part: Any, wheels: Array, R: Array) -> None:
    """Momentum, 2 B and f of a body alone, as those of its part of the tree to begin with."""
    m, r, J, V, f = part.own_mass, part.own_moment, part.own_inertia, part.velocity, part.force
    P = np.zeros(6)
    add_inertia(m, r, J, V, P)
    for a in range(3):
        P[3 + a] += R[a, 0] * wheels[0] + R[a, 1] * wheels[1] + R[a, 2] * wheels[2]
        f[a], f[3 + a] = 0.0, 0.0
    add_inertia(m, r, J, part.acceleration, f)
    add_force_cross(V, P, f)
    K, along = part.turning, 2.0 * (V[0] * r[0] + V[1] * r[1] + V[2] * r[2])
    part.mass = m
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        part.moment[a], part.momentum[a] = r[a], P[a]
        for d in range(3):
            part.inertia[a, d] = J[a, d]
            K[a, d] = -V[a] * r[d] - r[a] * V[d]
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        for d in range(3):
            spun = V[3 + b] * J[c, d] - V[3 + c] * J[b, d]
            K[a, d] += spun
            K[d, a] += spun
        K[a, a] += along
        K[b, c] += P[3 + a]
        K[c, b] -= P[3 + a]


@compiled  # type: ignore[untyped-decorator]
def compose(tree: Records, parts: Any) -> None:
    """Add every part of the tree to the one that carries it."""
    for i in range(len(tree) - 1, 0, -1):
        part, parent = parts[i], parts[tree[i].parent]
        parent.mass += part.mass
        for a in range(3):
            parent.moment[a] += part.moment[a]
            parent.momentum[a] += part.momentum[a]
            for b in range(3):
                parent.inertia[a, b] += part.inertia[a, b]
                parent.turning[a, b] += part.turning[a, b]
        for a in range(6):
            parent.force[a] += part.force[a]


@compiled  # type: ignore[untyped-decorator]
def mass_matrix(tree: Records, motors: Array, parts: Any, M: Array) -> None:
    """Write the mass matrix of [base; joints], motors included."""
    M[:] = 0.0
    unit, held = np.zeros(6), np.zeros(6)
    root = parts[0]
    for b in range(6):
        unit[b], held[:] = 1.0, 0.0
        add_inertia(root.mass, root.moment, root.inertia, unit, held)
        M[b, :6], unit[b] = held, 0.0
    for j in range(1, len(tree)):
        part, column = parts[j], 6 + tree[j].joint
        held[:] = 0.0
        add_inertia(part.mass, part.moment, part.inertia, part.subspace, held)
        i = j
        while i > 0:
            row = 6 + tree[i].joint
            M[row, column] = dot(parts[i].subspace, held)
            M[column, row] = M[row, column]
            i = tree[i].parent
        for a in range(6):
            M[a, column] = held[a]
            M[column, a] = held[a]
        M[column, column] += motors[tree[j].joint]


@compiled  # type: ignore[untyped-decorator]
def bias_forces(tree: Records, parts: Any, out: Array) -> None:
    """Write the forces that the accelerations so far need."""
    out[:6] = parts[0].force
    for i in range(1, len(tree)):
        out[6 + tree[i].joint] = dot(parts[i].subspace, parts[i].force)
