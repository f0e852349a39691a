"""Which standard parameters (mass, centre of mass, inertia of a body) a minimal one groups."""

from __future__ import annotations

import numpy as np

from ..dynamics.blocks import BlockTree
from ..model.robot import Robot
from ..types import Array
from .minimal import MinimalSet

STANDARD = ('m', 'cx', 'cy', 'cz', 'Ixx', 'Iyy', 'Izz', 'Ixy', 'Ixz', 'Iyz')
_STEP = 1e-3  # relative; the parameters are at most cubic in each number
_SEED = 3  # of a general place; any serves
_VISIBLE = 1e-7  # of a parameter's largest derivative; rounding stays below 1e-9


def standard_parameters(robot: Robot, minimal: MinimalSet, structure: str) -> tuple[str, ...]:
    """What each minimal parameter is made of, such as `base_link: m Ixx; link_1: m cx`.

    A number counts where changing it, near the robot file's values, changes the parameter.

    Args:
        robot: Robot with revolute joints.
        minimal: Its minimal set.
        structure: `symmetric` or `generic`, as the minimal set's.
    """
    effects = np.abs(_derivatives(robot, minimal, structure))
    seen = effects > _VISIBLE * np.max(effects, axis=(1, 2), keepdims=True)
    return tuple(
        '; '.join(
            f'{body.name}: {" ".join(np.array(STANDARD)[row])}'
            for body, row in zip(robot.bodies, rows, strict=True)
            if np.any(row)
        )
        for rows in seen
    )


def _derivatives(robot: Robot, minimal: MinimalSet, structure: str) -> Array:
    """(k, bodies, 10) derivatives by the standard parameters, each in units of its body's size."""
    tree = BlockTree(robot)
    mass = np.array([b.mass for b in robot.bodies])
    inertia = np.array([b.inertia for b in robot.bodies])
    com = np.array([b.com for b in robot.bodies])
    length = np.sqrt(np.trace(inertia, axis1=1, axis2=2) / np.where(mass > 0.0, mass, 1.0))
    # Beside the robot file's values: where they are zero, products of two have no derivative.
    free = np.ones(com.shape, dtype=bool) if structure == 'generic' else com != 0.0
    free[0] = True
    com += (
        np.where(free, np.random.default_rng(_SEED).normal(size=com.shape), 0.0) * length[:, None]
    )
    out = np.zeros((len(minimal), len(mass), len(STANDARD)))
    for body in np.flatnonzero(mass > 0.0):
        sizes = [mass[body], *(3 * [length[body]]), *(6 * [mass[body] * length[body] ** 2])]
        for place, size in enumerate(sizes):
            ends = []
            for sign in (1.0, -1.0):
                m, c, moments = mass.copy(), com.copy(), inertia.copy()
                _change(m, c, moments, int(body), place, sign * _STEP * size)
                ends.append(minimal.grouping @ tree.block_parameters(m, c, moments))
            out[:, body, place] = (ends[0] - ends[1]) / (2.0 * _STEP)
    return out


def _change(mass: Array, com: Array, inertia: Array, body: int, place: int, change: float) -> None:
    """Add to one of the ten numbers of a body, in the order of `STANDARD`."""
    if place == 0:
        mass[body] += change
    elif place < 4:
        com[body, place - 1] += change
    else:
        a, b = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))[place - 4]
        inertia[body, a, b] += change
        inertia[body, b, a] = inertia[body, a, b]
