r"""Forward kinematics of a tree at N states at once, compiled.

In base coordinates and each body about its own origin, so that nothing loses digits far from the
base. With d the way from the parent's origin, X [v; w] = [v + w x d; w] and the joint's subspace
S,

    V = X V(parent) + S q',    c = V x S q',    A = X A(parent) + S q'' + c.

A is the time derivative of V's components in the body's own frame. For a fixed base generalized
vectors still have six entries for it, which count for nothing.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..types import Array
from .compiling import Triple, compiled, inner
from .spatial import add6, cross, get, get6, in_body, motion_cross, plus, put, put6, rotate, times
from .tree import FREE, LINK, PRISMATIC, Records


class BodyKinematics(NamedTuple):
    """Places and velocities of all bodies at N states.

    Args:
        rotations: (N, n + 1, 3, 3) body to base coordinates.
        origins: (N, n + 1, 3) in the base [m].
        twists: (N, n + 1, 6) [linear; angular] velocity of each body's frame, in it.
        drifts: (N, n + 1, 6) acceleration at zero generalized acceleration, base coordinates.
    """

    rotations: Array
    origins: Array
    twists: Array
    drifts: Array


@inner
def propagate(tree: Records, q: Array, rates: Array, qd: Array, links: Records) -> None:
    """One state: rotation, origin, offset d, subspace S, velocity V and drift c of every link.

    Args:
        tree: `BODY` records.
        q: (n,) joint positions.
        rates: (6 + n,) generalized rates, base [linear; angular] in base coordinates.
        qd: (n,) joint rates that turn the subspaces: of `rates`, but for a reference velocity.
        links: (n + 1,) records `LINK`, written.
    """
    root = links[0]
    for a in range(3):
        root.origin[a] = 0.0
        for b in range(3):
            root.rotation[a, b] = 1.0 if a == b else 0.0
    for a in range(6):
        root.velocity[a] = rates[a] if tree[0].kind == FREE else 0.0
        root.drift[a] = 0.0
    for i in range(1, len(tree)):
        body = tree[i]
        own, parent = links[body.number], links[body.parent]
        _place(body, own, parent, q[body.number - 1])
        _move(own, parent, rates[5 + body.number], qd[body.number - 1])


@inner
def _place(body: Any, own: Any, parent: Any, q: float) -> None:
    slides = body.kind == PRISMATIC
    sine, versine = (0.0, 0.0) if slides else (math.sin(q), 1.0 - math.cos(q))
    turn, R = body.turn, own.rotation
    for b in range(3):
        column = rotate(
            parent.rotation,
            (
                turn[0, 0, b] + sine * turn[1, 0, b] + versine * turn[2, 0, b],
                turn[0, 1, b] + sine * turn[1, 1, b] + versine * turn[2, 1, b],
                turn[0, 2, b] + sine * turn[1, 2, b] + versine * turn[2, 2, b],
            ),
        )
        R[0, b], R[1, b], R[2, b] = column
    axis = rotate(R, get(body.axis, 0))
    d = rotate(parent.rotation, get(body.translation, 0))
    if slides:
        d = plus(d, times(q, axis))
    put(own.offset, 0, d)
    put(own.origin, 0, plus(get(parent.origin, 0), d))
    rest = (0.0, 0.0, 0.0)
    put6(own.subspace, axis if slides else rest, rest if slides else axis)


@inner
def _move(own: Any, parent: Any, rate: float, qd: float) -> None:
    s_v, s_w = get6(own.subspace)
    v, w = shifted(parent.velocity, own.offset)
    put6(own.velocity, plus(v, times(rate, s_v)), plus(w, times(rate, s_w)))
    turned, spun = motion_cross(own.velocity, s_v, s_w)
    put6(own.drift, times(qd, turned), times(qd, spun))


@inner
def shifted(motion: Array, d: Array) -> tuple[Triple, Triple]:
    """X of a motion (6,): the same motion at an origin further by d (3,)."""
    v, w = get6(motion)
    return plus(v, cross(w, get(d, 0))), w


@inner
def accelerate(own: Any, parent: Any) -> None:
    """Write a link's acceleration but for its own joint's."""
    a, u = shifted(parent.acceleration, own.offset)
    put6(own.acceleration, plus(a, get(own.drift, 0)), plus(u, get(own.drift, 3)))


@compiled
def forward_kinematics(tree: Records, q: Array, rates: Array, qd: Array) -> BodyKinematics:
    """Places, velocities and drifts of all bodies.

    Args:
        tree: `BODY` records.
        q: (N, n) joint positions.
        rates: (N, 6 + n) generalized rates, base [linear; angular] in base coordinates.
        qd: (N, n) joint rates that turn the subspaces, see `propagate`.
    """
    count, bodies = len(q), len(tree)
    links = np.zeros(bodies, LINK)
    rotations, origins = np.empty((count, bodies, 3, 3)), np.empty((count, bodies, 3))
    twists, drifts = np.empty((count, bodies, 6)), np.empty((count, bodies, 6))
    for s in range(count):
        propagate(tree, q[s], rates[s], qd[s], links)
        for i in range(bodies):
            k = tree[i].number
            own = links[k]
            put(origins[s, k], 0, get(own.origin, 0))
            for a in range(3):
                put(rotations[s, k, a], 0, get(own.rotation[a], 0))
            put6(twists[s, k], *in_body(own.rotation, own.velocity))
            put6(drifts[s, k], *get6(own.drift))
            if i > 0:
                add6(drifts[s, k], *shifted(drifts[s, tree[i].parent], own.offset))
    return BodyKinematics(rotations, origins, twists, drifts)


@compiled
def body_accelerations(tree: Records, kinematics: BodyKinematics, acceleration: Array) -> Array:
    """Accelerations of all bodies in their own frames.

    Args:
        tree: `BODY` records.
        kinematics: From `forward_kinematics`.
        acceleration: (N, 6 + n) time derivative of the generalized rates.

    Returns:
        (N, n + 1, 6).
    """
    rotations, origins, _, drifts = kinematics
    count, bodies = len(acceleration), len(tree)
    out = np.empty((count, bodies, 6))
    forced = np.zeros((bodies, 6))  # what the generalized acceleration adds
    for s in range(count):
        for a in range(6):
            forced[0, a] = acceleration[s, a] if tree[0].kind == FREE else 0.0
        for i in range(bodies):
            body, k = tree[i], tree[i].number
            R = rotations[s, k]
            if i > 0:
                v, w = get6(forced[body.parent])
                put6(forced[k], plus(v, cross(w, way(origins[s], k, body.parent))), w)
                axis, slides = rotate(R, get(body.axis, 0)), body.kind == PRISMATIC
                slope = acceleration[s, 5 + k]
                along, about = (slope, 0.0) if slides else (0.0, slope)
                add6(forced[k], times(along, axis), times(about, axis))
            put6(out[s, k], *get6(forced[k]))
            add6(out[s, k], *get6(drifts[s, k]))
            put6(out[s, k], *in_body(R, out[s, k]))
    return out


@inner
def way(origins: Array, body: int, parent: int) -> Triple:
    """From the parent's origin to the body's."""
    return plus(get(origins[body], 0), times(-1.0, get(origins[parent], 0)))
