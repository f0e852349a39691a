r"""Body regressors: torques and momenta linear in all bodies' inertial parameters, compiled.

Velocities are quasi-velocities V = [v_WB_B; omega_WB_B; q'], their derivatives those of the
components. A body at velocity v has the momentum W(v) pi, with its ten parameters pi in
Pinocchio's order; a column of W, turned into base coordinates, acts on the joints between the body
and the base. Columns are ten a body, bodies in the robot's order, then three a link with wheels.
The momentum's pattern of zeros depends on the tree alone: arrays that start as zeros keep it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..types import Array
from .compiling import Triple, compiled, inner
from .crba import apply_inertia, compose, place_inertias
from .forward_kinematics import accelerate, propagate
from .spatial import (
    add,
    along,
    column,
    cross,
    dot,
    force_cross,
    get,
    get6,
    in_body,
    motion_cross,
    plus,
    put,
    put6,
    put_column,
    rotate,
    rotate_back,
    times,
    unit,
)
from .tree import LOWER, Records

WHEELS = np.dtype([('body', np.int64), ('rotation', np.float64, (3, 3))], align=True)
"""A link with wheels: its body's number, and link to body coordinates."""

Regression = tuple[Records, Records, Records, Records]
"""`BODY` records of its own, `WHEELS` records, and `LINK` records (overwritten) of the velocity
and of the reference velocity."""
_ZERO = (0.0, 0.0, 0.0)
_ROW, _COLUMN = LOWER  # of the inertia, where its six numbers stand


@compiled
def fill_slotine_li(
    machine: Regression, q: Array, V: Array, Vr: Array, Ar: Array, Y: Array
) -> None:
    """Write Y_SL with Y_SL pi = M(q) A_r + C(q, V) V_r and M' - 2 C skew, wheels included.

    Body by body W(a_r + 1/2 v x v_r) + 1/2 [v x* W(v_r) + v_r x* W(v)], wheels -h x w_r. With
    V_r = V it is the regressor of the torques (RNEA's).

    Args:
        machine: The tree.
        q: (n,) joint positions.
        V: (6 + n,) velocity.
        Vr: (6 + n,) reference velocity.
        Ar: (6 + n,) derivative of its components.
        Y: (6 + n, p) written.
    """
    tree, wheels, links, reference = machine
    propagate(tree, q, V, V[6:], links)
    propagate(tree, q, Vr, V[6:], reference)
    column = 10 * len(tree)
    Y[:] = 0.0
    for i in range(len(tree)):
        k = tree[i].number
        _accelerate(tree[i], reference[tree[i].parent], reference[k], Ar)
        own, R = reference[k], links[k].rotation
        v, w = in_body(R, links[k].velocity)
        vr, wr = in_body(R, own.velocity)
        a, b = in_body(R, own.acceleration)
        a = plus(a, times(0.5, plus(cross(w, vr), cross(v, wr))))
        b = plus(b, times(0.5, cross(w, wr)))
        for j in range(10):
            f, g = momentum_column(j, a, b)
            fr, gr = momentum_column(j, vr, wr)
            fo, go = momentum_column(j, v, w)
            f = plus(f, times(0.5, plus(cross(w, fr), cross(wr, fo))))
            g = plus(g, times(0.5, plus(cross(w, gr), cross(v, fr))))
            g = plus(g, times(0.5, plus(cross(wr, go), cross(vr, fo))))
            add_rows(tree, i, links, 10 * k + j, rotate(R, f), rotate(R, g), Y)
        for m in range(len(wheels)):
            if wheels[m].body == k:
                for j in range(3):
                    g = rotate(R, cross(wr, rotate(wheels[m].rotation, unit(j))))
                    add_rows(tree, i, links, column + 3 * m + j, _ZERO, g, Y)


@inner
def add_uniform_acceleration(machine: Regression, a: Triple, Y: Array) -> None:
    """Add to Y_SL, just filled, what a further linear acceleration of the base makes of it."""
    tree, _, links, _ = machine
    for i in range(len(tree)):
        k, R = tree[i].number, links[tree[i].number].rotation
        for j in range(4):
            f, g = momentum_column(j, rotate_back(R, a), _ZERO)
            add_rows(tree, i, links, 10 * k + j, rotate(R, f), rotate(R, g), Y)


@compiled
def fill_momentum(machine: Regression, q: Array, V: Array, Yp: Array, Yc: Array) -> None:
    """Write the momentum regressors: Yp pi = M V, wheels included, and Yc pi = C^T V.

    The generalized momentum obeys d/dt (Yp pi) - Yc pi = u. A joint's row of C^T V is dT/dq =
    (V x S) . H for the momentum H, the base's is -V x* H.

    Args:
        machine: The tree.
        q: (n,) joint positions.
        V: (6 + n,) velocity.
        Yp: (6 + n, p) written.
        Yc: (6 + n, p) written.
    """
    tree, wheels, links, _ = machine
    propagate(tree, q, V, V[6:], links)
    column = 10 * len(tree)
    for i in range(len(tree)):
        k = tree[i].number
        own, R = links[k], links[k].rotation
        v, w = in_body(R, own.velocity)
        put6(own.swept, *motion_cross(own.velocity, *get6(own.subspace)))
        for j in range(10):
            f, g = momentum_column(j, v, w)
            _set_momentum(tree, i, links, 10 * k + j, rotate(R, f), rotate(R, g), (Yp, Yc))
        for m in range(len(wheels)):
            if wheels[m].body == k:
                for j in range(3):
                    g = rotate(R, rotate(wheels[m].rotation, unit(j)))
                    _set_momentum(tree, i, links, column + 3 * m + j, _ZERO, g, (Yp, Yc))


@inner
def _accelerate(body: Any, parent: Any, own: Any, acceleration: Array) -> None:
    """A link's acceleration, the parent's known."""
    if body.number == 0:
        own.acceleration[:] = acceleration[:6]
        return
    accelerate(own, parent)
    for a in range(6):
        own.acceleration[a] += own.subspace[a] * acceleration[5 + body.number]


@inner
def momentum_column(j: int, v: Triple, w: Triple) -> tuple[Triple, Triple]:
    """Column j of W: force and moment parts of the momentum by m, m c (3), Ixx, Ixy, Iyy, ..."""
    if j == 0:
        return v, _ZERO
    if j < 4:
        return cross(w, unit(j - 1)), cross(unit(j - 1), v)
    a, b = _ROW[j - 4], _COLUMN[j - 4]
    g = times(w[b], unit(a))
    return _ZERO, g if a == b else plus(g, times(w[a], unit(b)))


@inner
def add_rows(
    tree: Records, i: int, links: Records, column: int, f: Triple, g: Triple, Y: Array
) -> None:
    """Add J^T [f; g] of a wrench at body i's origin, base coordinates."""
    at = tree[i].number
    for m in range(i, 0, -1):
        if tree[m].number == at:
            own = links[at]
            Y[5 + at, column] += along(own.subspace, f, g)
            g = plus(g, cross(get(own.offset, 0), f))
            at = tree[m].parent
    for a in range(3):
        Y[a, column] += f[a]
        Y[3 + a, column] += g[a]


@inner
def _set_momentum(
    tree: Records, i: int, links: Records, column: int, f: Triple, g: Triple, Y: Any
) -> None:
    """Rows of Yp and Yc for a momentum at body i's origin, base coordinates."""
    Yp, Yc = Y
    at = tree[i].number
    for m in range(i, 0, -1):
        if tree[m].number == at:
            own = links[at]
            Yp[5 + at, column] = along(own.subspace, f, g)
            Yc[5 + at, column] = along(own.swept, f, g)
            g = plus(g, cross(get(own.offset, 0), f))
            at = tree[m].parent
    force, torque = force_cross(links[0].velocity, f, g)
    for a in range(3):
        Yp[a, column], Yp[3 + a, column] = f[a], g[a]
        Yc[a, column], Yc[3 + a, column] = -force[a], -torque[a]


@compiled
def momentum_map(machine: Regression, q: Array, V: Array, pi: Array, P: Array) -> float:
    """Write P (3, 6 + n) of the linear momentum P V in base coordinates; returns the total mass.

    Leaves the composites (`crba`) of the parameters pi (p,) in the links.
    """
    tree, _, links, _ = machine
    for i in range(len(tree)):
        for a in range(10):
            tree[i].inertial[a] = pi[10 * tree[i].number + a]
    propagate(tree, q, V, V[6:], links)
    place_inertias(tree, links)
    compose(tree, links)
    root = links[0]
    for b in range(6):
        put_column(P, b, apply_inertia(root, unit(b), unit(b - 3))[0])
    for k in range(1, len(tree)):
        put_column(P, 5 + k, apply_inertia(links[k], *get6(links[k].screw))[0])
    return root.mass


@compiled
def rest_centre(P: Array, V: Array) -> None:
    """Give V (6 + n,) the base velocity at which the linear momentum P V is zero."""
    for a in range(3):
        total = 0.0
        for j in range(3, len(V)):
            total += P[a, j] * V[j]
        V[a] = -total / P[0, 0]


@compiled
def fill_resting_momentum(
    machine: Regression, q: Array, V: Array, pi: Array, P: Array, Y: Any
) -> None:
    """`fill_momentum` where the base's velocity follows from zero linear momentum.

    With P(pi) V = 0 the velocity moves with the parameters, dv = -Y_p,lin dpi / m: added to the
    regressors this gives the derivatives of momentum and of C^T V by the parameters. At the
    parameters that v is computed with, the values do not change (Y_p,lin pi = 0). Force rows are
    zero.

    Args:
        machine: The tree.
        q: (n,) joint positions.
        V: (6 + n,) velocity, whose first three are written.
        pi: (p,) parameters.
        P: (3, 6 + n) scratch.
        Y: Yp and Yc, (6 + n, p) each, written.
    """
    Yp, Yc = Y
    tree, _, links, _ = machine
    mass = momentum_map(machine, q, V, pi, P)
    rest_centre(P, V)
    Yp[:], Yc[:] = 0.0, 0.0
    fill_momentum(machine, q, V, Yp, Yc)
    for k in range(len(tree)):  # the links' own linear momentum, then that of all outwards
        own, h = links[k], rotate(links[k].rotation, get(pi, 10 * k + 1))
        v, w = get6(own.velocity)
        put(own.momentum, 0, plus(times(pi[10 * k], v), cross(w, h)))
    for i in range(len(tree) - 1, 0, -1):
        add(links[tree[i].parent].momentum, 0, get(links[tree[i].number].momentum, 0))
    w0 = get(links[0].velocity, 3)
    for j in range(Yp.shape[1]):
        lost = times(-1.0 / mass, column(Yp, j))
        for i in range(3, Yp.shape[0]):
            Yp[i, j] += dot(column(P, i), lost)
        put_column(Yc[3:], j, cross(column(Yp[3:], j), w0))
    for k in range(1, len(tree)):
        slope = _slope_by_velocity(links[k])
        for j in range(Yp.shape[1]):
            Yc[5 + k, j] -= dot(slope, column(Yp, j)) / mass
    Yp[:3], Yc[:3] = 0.0, 0.0


@inner
def _slope_by_velocity(own: Any) -> Triple:
    """Derivative of a joint's row of C^T V by the base's velocity, from composites."""
    linear, angular = get6(own.swept)
    linear = plus(linear, cross(get(own.origin, 0), angular))  # about the base's origin
    slope = plus(times(own.mass, linear), cross(angular, get(own.moment, 0)))
    return plus(slope, cross(get(own.subspace, 3), get(own.momentum, 0)))
