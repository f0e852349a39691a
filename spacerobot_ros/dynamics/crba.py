"""CRBA: mass matrices of a tree at N states at once, compiled.

The composite-rigid-body algorithm (Featherstone, Rigid Body Dynamics Algorithms, 6.2) in base
coordinates about the base's origin: the part of the tree from each joint outwards is one body with
mass m, first moment r and inertia J, and with the joints' subspaces S

    M_ij = S_i . I S_j,    I [v; w] = [m v + w x r; r x v + J w],    I that of the outer joint.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..types import Array
from .compiling import Triple, compiled, inner
from .forward_kinematics import BodyKinematics
from .rnea import inertia_times
from .spatial import add, cross, dot, get, get6, plus, power, put, put6, rotate, times, unit
from .tree import LINK, PRISMATIC, Records


@compiled
def crba(tree: Records, kinematics: BodyKinematics) -> Array:
    """(N, 6 + n, 6 + n) mass matrices of [base; joints], motors included.

    Args:
        tree: `BODY` records; rows of a fixed base are those of a free one.
        kinematics: From `forward_kinematics`.
    """
    count, width = len(kinematics.origins), 5 + len(tree)
    out, links = np.zeros((count, width, width)), np.zeros(len(tree), LINK)
    for s in range(count):
        place_links(kinematics.rotations[s], kinematics.origins[s], links)
        place_inertias(tree, links)
        compose(tree, links)
        mass_matrix(tree, links, out[s])
    return out


@inner
def place_links(rotations: Array, origins: Array, links: Records) -> None:
    """Write one state's rotations (n + 1, 3, 3) and origins (n + 1, 3)."""
    for k in range(len(links)):
        put(links[k].origin, 0, get(origins[k], 0))
        for a in range(3):
            put(links[k].rotation[a], 0, get(rotations[k, a], 0))


@inner
def place_inertias(tree: Records, links: Records) -> None:
    """Write mass, moment and tensor of every body alone, and the joint's screw S, of placed links.

    All about the base's origin; `compose` makes them those of the tree from the joint outwards.
    """
    for i in range(len(tree)):
        body, own = tree[i], links[tree[i].number]
        R, p, phi, J = own.rotation, get(own.origin, 0), body.inertial, own.tensor
        m, h = phi[0], rotate(R, get(phi, 1))
        cross_term, square = 2.0 * dot(p, h), m * dot(p, p)
        for a in range(3):
            row = inertia_times(phi, get(R[a], 0))
            column = rotate(R, row)
            for b in range(3):
                J[a, b] = column[b] - p[a] * h[b] - h[a] * p[b] - m * p[a] * p[b]
            J[a, a] += cross_term + square
        own.mass = m
        put(own.moment, 0, plus(h, times(m, p)))
        if i > 0:
            axis = rotate(R, get(body.axis, 0))
            slides = body.kind == PRISMATIC
            put6(
                own.screw, axis if slides else cross(p, axis), (0.0, 0.0, 0.0) if slides else axis
            )


@inner
def compose(tree: Records, links: Records) -> None:
    """Add mass, moment and tensor of every part of the tree to the one that bears it."""
    for i in range(len(tree) - 1, 0, -1):
        own, parent = links[tree[i].number], links[tree[i].parent]
        parent.mass += own.mass
        add(parent.moment, 0, get(own.moment, 0))
        for a in range(3):
            for b in range(3):
                parent.tensor[a, b] += own.tensor[a, b]


@inner
def apply_inertia(own: Any, v: Triple, w: Triple) -> tuple[Triple, Triple]:
    """I [v; w] with a link's mass, moment and tensor."""
    r = get(own.moment, 0)
    return plus(times(own.mass, v), cross(w, r)), plus(cross(r, v), rotate(own.tensor, w))


@inner
def mass_matrix(tree: Records, links: Records, M: Array) -> None:
    """Write the mass matrix (6 + n, 6 + n), which is zero where joints share no chain."""
    held = np.zeros(6)
    for b in range(6):
        put6(M[b], *apply_inertia(links[0], unit(b), unit(b - 3)))
    for j in range(1, len(tree)):
        column = 5 + tree[j].number
        own = links[tree[j].number]
        put6(held, *apply_inertia(own, *get6(own.screw)))
        i = tree[j].number
        for k in range(j, 0, -1):
            if tree[k].number == i:
                M[5 + i, column] = M[column, 5 + i] = power(links[i].screw, held)
                i = tree[k].parent
        for a in range(6):
            M[a, column] = M[column, a] = held[a]
        M[column, column] += tree[j].motor
