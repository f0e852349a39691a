r"""Kinematics of a tree at N states at once, compiled.

Each body's place in the base, and in its own frame its velocity V = [v; w], its acceleration A and
the part of A that is there at zero generalised acceleration, the drift. With E a body's rotation
in its parent, d its origin there, X [v; w] = [E^T (v + w x d); E^T w] and S the joint's subspace,

    V = X V(parent) + S q',    drift = X drift(parent) + V x S q',    A = X A(parent) + S q'' + ...

All are derivatives of components: A is d/dt of V as the body's frame sees it. For a fixed base
generalised vectors still have six entries for it, which count for nothing.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np

from ..types import Array
from .tree import Records

compiled = numba.njit(cache=True, nogil=True, error_model='numpy')


@compiled  # type: ignore[untyped-decorator]
def forward_kinematics(
    tree: Records, is_free: bool, q: Array, rates: Array
) -> tuple[Array, Array, Array, Array]:
    """Places, velocities and drifts of all bodies, base first.

    Args:
        tree: From `body_records`.
        is_free: Whether the base moves.
        q: (N, n) joint positions.
        rates: (N, 6 + n) generalised rates, base [linear; angular] in base coordinates.

    Returns:
        Rotations (N, n + 1, 3, 3) and origins (N, n + 1, 3) in the base; velocities and drifts
        (N, n + 1, 6) in the bodies' frames.
    """
    count, n = q.shape
    rotations = np.zeros((count, n + 1, 3, 3))
    origins = np.zeros((count, n + 1, 3))
    twists = np.zeros((count, n + 1, 6))
    drifts = np.zeros((count, n + 1, 6))
    turn, offset = np.empty((3, 3)), np.empty(3)
    for s in range(count):
        for a in range(3):
            rotations[s, 0, a, a] = 1.0
        if is_free:
            for a in range(6):
                twists[s, 0, a] = rates[s, a]
        for i in range(1, n + 1):
            body = tree[i]
            own, parent = body.joint + 1, tree[body.parent].joint + 1
            _turn(body, q[s, body.joint], turn, offset)
            _place(s, own, parent, turn, offset, rotations, origins)
            _shift(s, own, parent, turn, offset, twists)
            _shift(s, own, parent, turn, offset, drifts)
            _move(s, own, body, rates[s, 6 + body.joint], twists, drifts)
    return rotations, origins, twists, drifts


@compiled  # type: ignore[untyped-decorator]
def _turn(body: Any, q: float, turn: Array, offset: Array) -> None:
    """Rotation and origin of a body in its parent."""
    sine, versine = (0.0, 0.0) if body.slides else (math.sin(q), 1.0 - math.cos(q))
    parts, axis, translation = body.turn, body.axis, body.translation
    for a in range(3):
        for b in range(3):
            turn[a, b] = parts[0, a, b] + sine * parts[1, a, b] + versine * parts[2, a, b]
    for a in range(3):
        offset[a] = translation[a]
        if body.slides:
            offset[a] += q * (turn[a, 0] * axis[0] + turn[a, 1] * axis[1] + turn[a, 2] * axis[2])


@compiled  # type: ignore[untyped-decorator]
def _place(
    s: int, own: int, parent: int, turn: Array, offset: Array, rotations: Array, origins: Array
) -> None:
    for a in range(3):
        origins[s, own, a] = origins[s, parent, a]
        for b in range(3):
            origins[s, own, a] += rotations[s, parent, a, b] * offset[b]
            total = 0.0
            for c in range(3):
                total += rotations[s, parent, a, c] * turn[c, b]
            rotations[s, own, a, b] = total


@compiled  # type: ignore[untyped-decorator]
def _shift(s: int, own: int, parent: int, turn: Array, d: Array, x: Array) -> None:
    """X x(parent)."""
    w0, w1, w2 = x[s, parent, 3], x[s, parent, 4], x[s, parent, 5]
    v0 = x[s, parent, 0] + w1 * d[2] - w2 * d[1]
    v1 = x[s, parent, 1] + w2 * d[0] - w0 * d[2]
    v2 = x[s, parent, 2] + w0 * d[1] - w1 * d[0]
    for a in range(3):
        x[s, own, a] = turn[0, a] * v0 + turn[1, a] * v1 + turn[2, a] * v2
        x[s, own, 3 + a] = turn[0, a] * w0 + turn[1, a] * w1 + turn[2, a] * w2


@compiled  # type: ignore[untyped-decorator]
def _move(s: int, own: int, body: Any, qd: float, V: Array, drift: Array) -> None:
    """Add the joint's rate to the velocity, and V x S q' to the drift."""
    axis = body.axis
    first = 0 if body.slides else 3
    for a in range(3):
        V[s, own, first + a] += axis[a] * qd
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        turning = qd * (V[s, own, 3 + b] * axis[c] - V[s, own, 3 + c] * axis[b])
        drift[s, own, first + a] += turning
        if not body.slides:
            drift[s, own, a] += qd * (V[s, own, b] * axis[c] - V[s, own, c] * axis[b])


@compiled  # type: ignore[untyped-decorator]
def body_accelerations(
    tree: Records,
    is_free: bool,
    rotations: Array,
    origins: Array,
    drifts: Array,
    acceleration: Array,
) -> Array:
    """Accelerations of all bodies in their own frames.

    Args:
        tree: As in `forward_kinematics`.
        is_free: As in `forward_kinematics`.
        rotations: From `forward_kinematics`.
        origins: From there.
        drifts: From there.
        acceleration: (N, 6 + n) time derivative of the generalised rates.

    Returns:
        (N, n + 1, 6).
    """
    count, bodies = origins.shape[:2]
    out = np.empty((count, bodies, 6))
    forced = np.zeros((bodies, 6))  # in base coordinates, at the base's origin
    for s in range(count):
        for a in range(6):
            forced[0, a] = acceleration[s, a] if is_free else 0.0
        for i in range(bodies):
            body = tree[i]
            own = body.joint + 1
            if i > 0:
                parent = tree[body.parent].joint + 1
                slope = acceleration[s, 6 + body.joint]
                _add_joint(s, own, parent, body, slope, rotations, origins, forced)
            _in_body(s, own, rotations, origins, forced, out)
            for a in range(6):
                out[s, own, a] += drifts[s, own, a]
    return out


@compiled  # type: ignore[untyped-decorator]
def _add_joint(
    s: int,
    own: int,
    parent: int,
    body: Any,
    slope: float,
    rotations: Array,
    origins: Array,
    forced: Array,
) -> None:
    x, y, z = axis_in_base(s, own, body, rotations)
    p = origins[s, own]
    for a in range(6):
        forced[own, a] = forced[parent, a]
    first = 0 if body.slides else 3
    forced[own, first] += slope * x
    forced[own, first + 1] += slope * y
    forced[own, first + 2] += slope * z
    if not body.slides:
        forced[own, 0] += slope * (p[1] * z - p[2] * y)
        forced[own, 1] += slope * (p[2] * x - p[0] * z)
        forced[own, 2] += slope * (p[0] * y - p[1] * x)


@compiled  # type: ignore[untyped-decorator]
def axis_in_base(s: int, own: int, body: Any, rotations: Array) -> tuple[float, float, float]:
    """A joint's axis in base coordinates."""
    R, axis = rotations[s, own], body.axis
    return (
        R[0, 0] * axis[0] + R[0, 1] * axis[1] + R[0, 2] * axis[2],
        R[1, 0] * axis[0] + R[1, 1] * axis[1] + R[1, 2] * axis[2],
        R[2, 0] * axis[0] + R[2, 1] * axis[1] + R[2, 2] * axis[2],
    )


@compiled  # type: ignore[untyped-decorator]
def _in_body(
    s: int, own: int, rotations: Array, origins: Array, at_base: Array, out: Array
) -> None:
    """A motion vector at the base's origin, in a body's frame."""
    R, p, x = rotations[s, own], origins[s, own], at_base[own]
    v0 = x[0] + x[4] * p[2] - x[5] * p[1]
    v1 = x[1] + x[5] * p[0] - x[3] * p[2]
    v2 = x[2] + x[3] * p[1] - x[4] * p[0]
    for a in range(3):
        out[s, own, a] = R[0, a] * v0 + R[1, a] * v1 + R[2, a] * v2
        out[s, own, 3 + a] = R[0, a] * x[3] + R[1, a] * x[4] + R[2, a] * x[5]


@compiled  # type: ignore[untyped-decorator]
def generalized_force(
    tree: Records,
    is_free: bool,
    place: int,
    rotations: Array,
    origins: Array,
    wrenches: Array,
) -> Array:
    """Generalised force of a wrench on one body.

    Args:
        tree: As in `forward_kinematics`.
        is_free: As in `forward_kinematics`.
        place: The body's number.
        rotations: From `forward_kinematics`.
        origins: From there.
        wrenches: (N, 6) [force; torque] at the body's origin, in its frame.

    Returns:
        (N, 6 + n).
    """
    count, bodies = origins.shape[:2]
    out = np.zeros((count, 5 + bodies))
    last = 0
    for i in range(bodies):
        if tree[i].joint + 1 == place:
            last = i
    total = np.empty(6)
    for s in range(count):
        to_base(s, place, rotations, origins, wrenches[s], total)
        if is_free:
            for a in range(6):
                out[s, a] = total[a]
        i = last
        while i > 0:
            body = tree[i]
            out[s, 6 + body.joint] = along_axis(s, body, rotations, origins, total)
            i = body.parent
    return out


@compiled  # type: ignore[untyped-decorator]
def to_base(s: int, own: int, rotations: Array, origins: Array, wrench: Array, out: Array) -> None:
    """A wrench in a body's frame as one at the base's origin."""
    R, p = rotations[s, own], origins[s, own]
    for a in range(3):
        out[a] = R[a, 0] * wrench[0] + R[a, 1] * wrench[1] + R[a, 2] * wrench[2]
        out[3 + a] = R[a, 0] * wrench[3] + R[a, 1] * wrench[4] + R[a, 2] * wrench[5]
    out[3] += p[1] * out[2] - p[2] * out[1]
    out[4] += p[2] * out[0] - p[0] * out[2]
    out[5] += p[0] * out[1] - p[1] * out[0]


@compiled  # type: ignore[untyped-decorator]
def along_axis(s: int, body: Any, rotations: Array, origins: Array, wrench: Array) -> float:
    """What a joint feels of a wrench at the base's origin."""
    own = body.joint + 1
    x, y, z = axis_in_base(s, own, body, rotations)
    p, f = origins[s, own], wrench
    if body.slides:
        return x * f[0] + y * f[1] + z * f[2]
    return (
        x * (f[3] - p[1] * f[2] + p[2] * f[1])
        + y * (f[4] - p[2] * f[0] + p[0] * f[2])
        + z * (f[5] - p[0] * f[1] + p[1] * f[0])
    )
