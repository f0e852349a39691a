r"""Angular momentum about the system's centre of mass, and what it is linear in, compiled.

Of a tree whose base origin rests, in base coordinates: with mass M, first moment s, linear
momentum P and angular momentum L about the base's origin, all sums over the bodies,

    h = L - s x P / M = D w + Dq q'

which does not depend on the base's velocity (eqs. (3), (19) of the identification paper). Sums are
linear in the bodies' inertial parameters, ten a body in Pinocchio's order, so

    dh = dL - (ds x P + s x dP) / M + s x P dM / M^2.

A joint with the screw S that turns by dq carries all that is outwards along: with the momentum H,
the spatial inertia I of that part and the velocity V of its first body, all about the base's
origin, dH = S x* H - I (S x V).

Symbols: N states, n joints, b = n + 1 bodies.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..types import Array
from .body_regressors import momentum_column
from .compiling import Triple, compiled, inner
from .crba import apply_inertia, compose, place_inertias
from .forward_kinematics import propagate
from .spatial import (
    add6,
    cross,
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
    times,
    unit,
)
from .tree import LINK, Records


class AngularMomentum(NamedTuple):
    """At N states, in base coordinates.

    Args:
        momentum: (N, 3) h [N m s].
        inertia: (N, 3, 3) D and (N, 3, n) Dq side by side [kg m^2].
        by_joints: (N, 3, n) derivative of h by the joint positions.
        by_bodies: (N, 3, 10 b) derivative of h by the inertial parameters.
        rotations: (N, b, 3, 3) body to base coordinates.
        axes: (N, n, 3) about which joints turn; zero where they slide.
    """

    momentum: Array
    inertia: Array
    by_joints: Array
    by_bodies: Array
    rotations: Array
    axes: Array


@compiled
def angular_momentum(tree: Records, q: Array, omega: Array, qd: Array) -> AngularMomentum:
    """Angular momentum of the bodies, wheels at rest, and its derivatives.

    Args:
        tree: `BODY` records of a free robot.
        q: (N, n) joint positions.
        omega: (N, 3) omega_WB_B [rad/s].
        qd: (N, n) joint rates.
    """
    count, n, bodies = len(q), q.shape[1], len(tree)
    links, rates = np.zeros(bodies, LINK), np.zeros(6 + n)
    out = AngularMomentum(
        np.empty((count, 3)),
        np.empty((count, 3, 3 + n)),
        np.empty((count, 3, n)),
        np.empty((count, 3, 10 * bodies)),
        np.empty((count, bodies, 3, 3)),
        np.empty((count, n, 3)),
    )
    own = np.empty((bodies, 6))  # momentum of each part of the tree, about the base's origin
    for s in range(count):
        put(rates, 3, get(omega[s], 0))
        for j in range(n):
            rates[6 + j] = qd[s, j]
        propagate(tree, q[s], rates, qd[s], links)
        place_inertias(tree, links)
        for k in range(bodies):
            put6(own[k], *apply_inertia(links[k], *_velocity(links, k)))
        compose(tree, links)
        for i in range(bodies - 1, 0, -1):
            add6(own[tree[i].parent], *get6(own[tree[i].number]))
        _write(links, own, s, out)
    return out


@inner
def _velocity(links: Records, k: int) -> tuple[Triple, Triple]:
    """Velocity of a body at the base's origin."""
    v, w = get6(links[k].velocity)
    return plus(v, cross(get(links[k].origin, 0), w)), w


@inner
def _write(links: Records, own: Array, s: int, out: AngularMomentum) -> None:
    root = links[0]
    mass, first = root.mass, get(root.moment, 0)
    P, L = get6(own[0])
    centre, drift = times(1.0 / mass, first), times(1.0 / mass, P)
    put(out.momentum[s], 0, _about(centre, drift, L, P, (0.0, 0.0, 0.0)))
    for a in range(3):
        p, g = apply_inertia(root, (0.0, 0.0, 0.0), unit(a))
        put_column(out.inertia[s], a, plus(g, times(-1.0, cross(centre, p))))
    for k in range(1, len(links)):
        screw_v, screw_w = get6(links[k].screw)
        put(out.axes[s, k - 1], 0, screw_w)
        p, g = apply_inertia(links[k], screw_v, screw_w)
        put_column(out.inertia[s], 2 + k, plus(g, times(-1.0, cross(centre, p))))
        force, torque = force_cross(links[k].screw, *get6(own[k]))
        slip_v, slip_w = motion_cross(links[k].screw, *_velocity(links, k))
        p, g = apply_inertia(links[k], slip_v, slip_w)
        dP, dL = plus(force, times(-1.0, p)), plus(torque, times(-1.0, g))
        shift = plus(times(links[k].mass, screw_v), cross(screw_w, get(links[k].moment, 0)))
        put_column(out.by_joints[s], k - 1, _about(centre, drift, dL, dP, shift))
    for k in range(len(links)):
        R, origin = links[k].rotation, get(links[k].origin, 0)
        v, w = in_body(R, links[k].velocity)
        for a in range(3):
            put(out.rotations[s, k, a], 0, get(R[a], 0))
        for j in range(10):
            f, g = momentum_column(j, v, w)
            dP, dL = rotate(R, f), rotate(R, g)
            dL = plus(dL, cross(origin, dP))
            shift, gained = (0.0, 0.0, 0.0), 0.0
            if j == 0:
                shift, gained = origin, 1.0
            elif j < 4:
                shift = rotate(R, unit(j - 1))
            change = _about(centre, drift, dL, dP, shift)
            change = plus(change, times(gained, cross(centre, drift)))
            put_column(out.by_bodies[s], 10 * k + j, change)


@inner
def _about(centre: Triple, drift: Triple, dL: Triple, dP: Triple, shift: Triple) -> Triple:
    """DL - ds x P / M - s x dP / M."""
    lost = plus(cross(shift, drift), cross(centre, dP))
    return plus(dL, times(-1.0, lost))
