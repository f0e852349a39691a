r"""The regressors' inner loops, compiled.

Motion vectors are pairs (linear, angular) in body coordinates about the body's origin; W(v) pi is
the spatial momentum of a body with the ten parameters pi at the velocity v (columns in Pinocchio's
order). The columns of a body act on the joints between it and the base, so each body's wrench
columns are carried down its chain.

The result's pattern of zeros depends on the tree alone: arrays that start as zeros keep it.
"""

from __future__ import annotations

import numba

from ...types import Array
from .spatial import (
    Triple,
    cross,
    dot,
    into,
    out_of,
    part,
    plus,
    put,
    row,
    times,
    turned,
    unit_vector,
)
from .tree import Tree


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def place(tree: Tree, q: Array, R: Array, p: Array) -> None:
    """Joint placements.

    Args:
        tree: The tree.
        q: (n,) joint positions.
        R: (n + 1, 3, 3) written: body to parent coordinates.
        p: (n + 1, 3) written: body origin in the parent's frame.
    """
    for k in tree.order[1:]:
        axis, slides = row(tree.axes, k), tree.sliding[k] > 0.0
        angle = 0.0 if slides else q[k - 1]
        for j in range(3):
            unit = unit_vector(j)
            column = out_of(tree.rotations, k, turned(unit, axis, angle))
            R[k, 0, j], R[k, 1, j], R[k, 2, j] = column
        shift = out_of(tree.rotations, k, times(q[k - 1] if slides else 0.0, axis))
        put(p, k, plus(row(tree.translations, k), shift))


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def velocities(tree: Tree, R: Array, p: Array, V: Array, v: Array, w: Array) -> None:
    """Body velocities v, w (n + 1, 3) each, written, from V (6 + n,) [linear; angular; joints]."""
    put(v, 0, part(V, 0))
    put(w, 0, part(V, 3))
    for k in tree.order[1:]:
        parent, axis, rate = tree.parents[k], row(tree.axes, k), V[5 + k]
        linear = plus(row(v, parent), cross(row(w, parent), row(p, k)))
        slide = tree.sliding[k]
        put(v, k, plus(into(R, k, linear), times(slide * rate, axis)))
        put(w, k, plus(into(R, k, row(w, parent)), times((1.0 - slide) * rate, axis)))


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def reference_accelerations(
    tree: Tree, R: Array, p: Array, V: Array, Ar: Array, vr: Array, wr: Array, a: Array, b: Array
) -> None:
    """Linear a and angular b (n + 1, 3), written: J_i A_r + Jdot_i(V) V_r for every body."""
    put(a, 0, part(Ar, 0))
    put(b, 0, part(Ar, 3))
    for k in tree.order[1:]:
        parent, axis, slide = tree.parents[k], row(tree.axes, k), tree.sliding[k]
        linear = plus(row(a, parent), cross(row(b, parent), row(p, k)))
        # v_r x S q': a motion cross product with the joint's own velocity
        s_v, s_w = times(slide * V[5 + k], axis), times((1.0 - slide) * V[5 + k], axis)
        linear_rate = plus(cross(row(wr, k), s_v), cross(row(vr, k), s_w))
        qdd = Ar[5 + k]
        put(a, k, plus(plus(into(R, k, linear), times(slide * qdd, axis)), linear_rate))
        angular = plus(into(R, k, row(b, parent)), cross(row(wr, k), s_w))
        put(b, k, plus(angular, times((1.0 - slide) * qdd, axis)))


@numba.njit(inline='always')  # type: ignore[untyped-decorator]
def _product(j: int, w: Triple) -> Triple:
    """Column j of K(w): dI/dI_j @ w."""
    if j == 0:
        return (w[0], 0.0, 0.0)
    if j == 1:
        return (w[1], w[0], 0.0)
    if j == 2:
        return (0.0, w[1], 0.0)
    if j == 3:
        return (w[2], 0.0, w[0])
    if j == 4:
        return (0.0, w[2], w[1])
    return (0.0, 0.0, w[2])


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def momentum_columns(v: Triple, w: Triple, f: Array, g: Array) -> None:
    """W(v): force part f and moment part g, (10, 3) each, written."""
    put(f, 0, v)
    put(g, 0, (0.0, 0.0, 0.0))
    for j in range(3):
        unit = unit_vector(j)
        put(f, 1 + j, cross(w, unit))
        put(g, 1 + j, cross(unit, v))
    for j in range(6):
        put(f, 4 + j, (0.0, 0.0, 0.0))
        put(g, 4 + j, _product(j, w))


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def slotine_li_columns(
    v: Triple, w: Triple, vr: Triple, wr: Triple, a: Triple, b: Triple, f: Array, g: Array
) -> None:
    """Wrench columns W(a + 1/2 v x v_r) + 1/2 [v x* W(v_r) + v_r x* W(v)] of one body.

    Args:
        v: Linear velocity.
        w: Angular.
        vr: Linear reference velocity.
        wr: Angular.
        a: Linear reference acceleration.
        b: Angular.
        f: (10, 3) written: force part.
        g: (10, 3) written: moment part.
    """
    half = plus(cross(w, vr), cross(v, wr))
    a_mid, b_mid = plus(a, times(0.5, half)), plus(b, times(0.5, cross(w, wr)))
    put(f, 0, plus(a, cross(w, vr)))
    put(g, 0, (0.0, 0.0, 0.0))
    for j in range(3):
        unit = unit_vector(j)
        we, wre = cross(w, unit), cross(wr, unit)
        force = times(0.5, plus(cross(w, wre), cross(wr, we)))
        put(f, 1 + j, plus(cross(b_mid, unit), force))
        moment = plus(cross(w, cross(unit, vr)), cross(v, wre))
        moment = plus(moment, plus(cross(wr, cross(unit, v)), cross(vr, we)))
        put(g, 1 + j, plus(cross(unit, a_mid), times(0.5, moment)))
    for j in range(6):
        spin = plus(cross(w, _product(j, wr)), cross(wr, _product(j, w)))
        put(f, 4 + j, (0.0, 0.0, 0.0))
        put(g, 4 + j, plus(_product(j, b_mid), times(0.5, spin)))


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def carry(
    tree: Tree, R: Array, p: Array, body: int, f: Array, g: Array, start: int, Y: Array
) -> None:
    """Rows of a body's wrench columns: J^T [f; g], columns from `start` on; spoils f and g."""
    k, size = body, len(f)
    while k > 0:
        axis, slide, at = row(tree.axes, k), tree.sliding[k], row(p, k)
        for c in range(size):
            force, moment = row(f, c), row(g, c)
            Y[5 + k, start + c] = slide * dot(axis, force) + (1.0 - slide) * dot(axis, moment)
            force = out_of(R, k, force)
            put(f, c, force)
            put(g, c, plus(out_of(R, k, moment), cross(at, force)))
        k = tree.parents[k]
    for c in range(size):
        Y[0, start + c], Y[1, start + c], Y[2, start + c] = row(f, c)
        Y[3, start + c], Y[4, start + c], Y[5, start + c] = row(g, c)


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def carry_momentum(
    tree: Tree,
    R: Array,
    p: Array,
    v: Array,
    w: Array,
    body: int,
    f: Array,
    g: Array,
    start: int,
    Yp: Array,
    Yc: Array,
) -> None:
    """Rows of J^T H in Yp and of C^T V in Yc for momentum columns H = [f; g]; spoils f and g.

    The joint's row of C^T V is dT/dq = (v x S) . H, the base's is -v x* H.
    """
    k, size = body, len(f)
    while k > 0:
        axis, slide, at = row(tree.axes, k), tree.sliding[k], row(p, k)
        s_v, s_w = times(slide, axis), times(1.0 - slide, axis)
        linear = plus(cross(row(w, k), s_v), cross(row(v, k), s_w))
        angular = cross(row(w, k), s_w)
        for c in range(size):
            force, moment = row(f, c), row(g, c)
            Yp[5 + k, start + c] = dot(s_v, force) + dot(s_w, moment)
            Yc[5 + k, start + c] = dot(linear, force) + dot(angular, moment)
            force = out_of(R, k, force)
            put(f, c, force)
            put(g, c, plus(out_of(R, k, moment), cross(at, force)))
        k = tree.parents[k]
    for c in range(size):
        force, moment, column = row(f, c), row(g, c), start + c
        Yp[0, column], Yp[1, column], Yp[2, column] = force
        Yp[3, column], Yp[4, column], Yp[5, column] = moment
        turning = cross(force, row(w, 0))
        Yc[0, column], Yc[1, column], Yc[2, column] = turning
        turning = plus(cross(moment, row(w, 0)), cross(force, row(v, 0)))
        Yc[3, column], Yc[4, column], Yc[5, column] = turning


@numba.njit(inline='always')  # type: ignore[untyped-decorator]
def _wheel_axis(tree: Tree, wheel: int, j: int) -> Triple:
    turn = tree.wheel_rotations
    return (turn[wheel, 0, j], turn[wheel, 1, j], turn[wheel, 2, j])


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def fill_slotine_li(
    tree: Tree,
    R: Array,
    p: Array,
    V: Array,
    Vr: Array,
    Ar: Array,
    motion: Array,
    columns: Array,
    Y: Array,
) -> None:
    """Write the Slotine-Li regressor.

    Args:
        tree: The tree.
        R: From `place`.
        p: From `place`.
        V: (6 + n,) velocity.
        Vr: (6 + n,) reference velocity.
        Ar: (6 + n,) its derivative.
        motion: (6, n + 1, 3) scratch: v, w, vr, wr, a, b of every body.
        columns: (2, 10, 3) scratch.
        Y: (6 + n, p) written.
    """
    v, w, vr, wr, a, b = motion[0], motion[1], motion[2], motion[3], motion[4], motion[5]
    f, g = columns[0], columns[1]
    velocities(tree, R, p, V, v, w)
    velocities(tree, R, p, Vr, vr, wr)
    reference_accelerations(tree, R, p, V, Ar, vr, wr, a, b)
    bodies = len(tree.parents)
    for k in range(bodies):
        slotine_li_columns(
            row(v, k), row(w, k), row(vr, k), row(wr, k), row(a, k), row(b, k), f, g
        )
        carry(tree, R, p, k, f, g, 10 * k, Y)
    for i in range(len(tree.wheel_bodies)):
        k = tree.wheel_bodies[i]
        for j in range(3):
            put(f, j, (0.0, 0.0, 0.0))
            put(g, j, cross(row(wr, k), _wheel_axis(tree, i, j)))
        carry(tree, R, p, k, f[:3], g[:3], 10 * bodies + 3 * i, Y)


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def fill_momentum(
    tree: Tree,
    R: Array,
    p: Array,
    V: Array,
    motion: Array,
    columns: Array,
    Yp: Array,
    Yc: Array,
) -> None:
    """Write the momentum regressors: Yp pi = M V and Yc pi = C^T V, wheels included.

    Args:
        tree: The tree.
        R: From `place`.
        p: From `place`.
        V: (6 + n,) velocity.
        motion: (6, n + 1, 3) scratch.
        columns: (2, 10, 3) scratch.
        Yp: (6 + n, p) written.
        Yc: (6 + n, p) written.
    """
    v, w, f, g = motion[0], motion[1], columns[0], columns[1]
    velocities(tree, R, p, V, v, w)
    bodies = len(tree.parents)
    for k in range(bodies):
        momentum_columns(row(v, k), row(w, k), f, g)
        carry_momentum(tree, R, p, v, w, k, f, g, 10 * k, Yp, Yc)
    for i in range(len(tree.wheel_bodies)):
        k = tree.wheel_bodies[i]
        for j in range(3):
            put(f, j, (0.0, 0.0, 0.0))
            put(g, j, _wheel_axis(tree, i, j))
        carry_momentum(tree, R, p, v, w, k, f[:3], g[:3], 10 * bodies + 3 * i, Yp, Yc)
