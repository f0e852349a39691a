r"""RNEA: inverse dynamics of a tree with gyrostats at N states at once, compiled.

The recursive Newton-Euler algorithm (Featherstone, Rigid Body Dynamics Algorithms, 5.3), with a
body's inertial parameters I, velocity V = [v; w], acceleration A (`forward_kinematics`) less
gravity, and the momentum h of its wheels, all in its own frame:

    P = I V + [0; h],    f = I A + [w x P_v; w x P_w + v x P_v]

The wrenches f are summed towards the base. The result is linear in inertial parameters, wheels and
motors together, so a difference of two robots (`tree.difference`) takes one call.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..types import Array, BoolArray
from .compiling import Triple, compiled, inner
from .forward_kinematics import BodyKinematics, way
from .spatial import add6, cross, dot, get, get6, plus, put6, rotate, rotate_back, times
from .tree import FREE, PRISMATIC, Records


@compiled
def rnea(tree: Records, kinematics: BodyKinematics, accelerations: Array, qdd: Array) -> Array:
    """Generalized forces that a motion needs.

    Args:
        tree: `BODY` records; gravity in base coordinates.
        kinematics: From `forward_kinematics`.
        accelerations: (N, n + 1, 6) from `body_accelerations`.
        qdd: (N, n) joint accelerations.

    Returns:
        (N, 6 + n); the first six are zero for a fixed base.
    """
    rotations, origins, twists, _ = kinematics
    bodies, is_free = len(tree), tree[0].kind == FREE
    out, total = np.zeros((len(qdd), 5 + bodies)), np.zeros((bodies, 6))
    has_inertia, supports = inertia_supports(tree)
    for s in range(len(qdd)):
        for i in range(bodies - 1, -1, -1):
            body, k = tree[i], tree[i].number
            if not supports[k]:  # of a difference of two robots most bodies do not
                if i > 0:
                    out[s, 5 + k] = body.motor * qdd[s, k - 1]
                continue
            R = rotations[s, k]
            if has_inertia[i]:
                g = rotate_back(R, get(tree[0].gravity, 0))
                f, n = body_wrench(body, twists[s, k], accelerations[s, k], g)
                add6(total[k], rotate(R, f), rotate(R, n))
            f, n = get6(total[k])
            if i > 0:
                out[s, 5 + k] = along_axis(body, R, f, n) + body.motor * qdd[s, k - 1]
                turned = cross(way(origins[s], k, body.parent), f)
                add6(total[body.parent], f, plus(n, turned))
            elif is_free:
                put6(out[s], f, n)
            put6(total[k], (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    return out


@inner
def inertia_supports(tree: Records) -> tuple[BoolArray, BoolArray]:
    """Which records have inertia or wheels, and which bodies, by number, support any."""
    has_inertia, supports = np.zeros(len(tree), np.bool_), np.zeros(len(tree), np.bool_)
    for i in range(len(tree) - 1, -1, -1):
        body = tree[i]
        for a in range(10):
            has_inertia[i] |= body.inertial[a] != 0.0 or body.wheels[a % 3] != 0.0
        supports[body.number] |= has_inertia[i]
        if i > 0:
            supports[body.parent] |= supports[body.number]
    return has_inertia, supports


@inner
def body_wrench(body: Any, twist: Array, acceleration: Array, g: Triple) -> tuple[Triple, Triple]:
    """Force and torque f that a body needs at its origin, in its frame."""
    phi, v, w = body.inertial, get(twist, 0), get(twist, 3)
    a, u = plus(get(acceleration, 0), times(-1.0, g)), get(acceleration, 3)
    h = get(phi, 1)
    p = plus(times(phi[0], v), cross(w, h))
    momentum = plus(plus(cross(h, v), inertia_times(phi, w)), get(body.wheels, 0))
    force = plus(plus(times(phi[0], a), cross(u, h)), cross(w, p))
    torque = plus(cross(h, a), inertia_times(phi, u))
    return force, plus(torque, plus(cross(w, momentum), cross(v, p)))


@inner
def inertia_times(phi: Array, w: Triple) -> Triple:
    """Rotational inertia of ten parameters times w."""
    return (
        phi[4] * w[0] + phi[5] * w[1] + phi[7] * w[2],
        phi[5] * w[0] + phi[6] * w[1] + phi[8] * w[2],
        phi[7] * w[0] + phi[8] * w[1] + phi[9] * w[2],
    )


@compiled
def generalized_force(
    tree: Records, body: int, kinematics: BodyKinematics, wrenches: Array
) -> Array:
    """Generalized force of a wrench on one body.

    Args:
        tree: `BODY` records.
        body: The body's number.
        kinematics: From `forward_kinematics`.
        wrenches: (N, 6) [force; torque] at the body's origin, in its frame.

    Returns:
        (N, 6 + n); the first six are zero for a fixed base.
    """
    rotations, origins = kinematics.rotations, kinematics.origins
    out = np.zeros((len(wrenches), 5 + len(tree)))
    for s in range(len(wrenches)):
        R = rotations[s, body]
        force, torque = rotate(R, get(wrenches[s], 0)), rotate(R, get(wrenches[s], 3))
        at = body
        for i in range(len(tree) - 1, 0, -1):
            if tree[i].number == at:
                out[s, 5 + at] = along_axis(tree[i], rotations[s, at], force, torque)
                torque = plus(torque, cross(way(origins[s], at, tree[i].parent), force))
                at = tree[i].parent
        if tree[0].kind == FREE:
            put6(out[s], force, torque)
    return out


@inner
def along_axis(body: Any, R: Array, force: Triple, torque: Triple) -> float:
    """What a joint feels of a wrench at its body's origin, base coordinates."""
    return dot(rotate(R, get(body.axis, 0)), force if body.kind == PRISMATIC else torque)
