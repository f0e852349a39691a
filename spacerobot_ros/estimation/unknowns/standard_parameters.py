"""Which standard parameters (mass, centre of mass, inertia of a body) a minimal one groups."""

from __future__ import annotations

import numpy as np

from ...model.robot import Robot
from ...types import Array
from .minimal import MinimalSet

STANDARD = ('m', 'cx', 'cy', 'cz', 'Ixx', 'Iyy', 'Izz', 'Ixy', 'Ixz', 'Iyz')
_PAIRS = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])  # of an inertia's numbers
_STEP = 1e-3  # relative; the parameters are at most cubic in each number
_SEED = 3  # of a general place; any serves
_VISIBLE = 1e-7  # of a parameter's largest derivative; rounding stays below 1e-9


def standard_parameters(robot: Robot, minimal: MinimalSet, structure: str) -> tuple[str, ...]:
    """What each minimal parameter is made of, such as `base_link: m Ixx; link_1: m cx`.

    A number counts where changing it, near the robot file's values, changes the parameter.

    Args:
        robot: The robot.
        minimal: Its minimal set.
        structure: `symmetric` or `generic`, as the minimal set's.
    """
    effects = np.abs(_derivatives(robot, minimal, structure))
    seen = effects > _VISIBLE * np.max(effects, axis=(1, 2), keepdims=True)
    names = np.array(STANDARD)
    return tuple(
        '; '.join(
            f'{robot.bodies[k].name}: {" ".join(names[rows[k]])}'
            for k in np.flatnonzero(np.any(rows, axis=1))
        )
        for rows in seen
    )


def _derivatives(robot: Robot, minimal: MinimalSet, structure: str) -> Array:
    """(k, bodies, 10) derivatives by the standard parameters, each in units of its body's size."""
    mass = np.array([b.mass for b in robot.bodies])
    inertia = np.array([b.inertia for b in robot.bodies])
    com = np.array([b.com for b in robot.bodies])
    massive = np.where(mass > 0.0, mass, 1.0)
    length = np.sqrt(np.trace(inertia, axis1=1, axis2=2) / massive)
    # Beside the robot file's values: where they are zero, products of two have no derivative.
    free = np.ones(com.shape, dtype=bool) if structure == 'generic' else com != 0.0
    free[0] = True
    beside = np.random.default_rng(_SEED).normal(size=com.shape) * length[:, None]
    values = np.column_stack(
        [mass, com + np.where(free, beside, 0.0), inertia[:, _PAIRS[0], _PAIRS[1]]]
    )
    powers = np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2])
    sizes = length[:, None] ** powers * np.where(powers == 1, 1.0, massive[:, None])
    steps = _STEP * np.eye(values.size).reshape(-1, *values.shape) * sizes
    ahead, behind = (minimal.of_bodies(*_bodies(values + sign * steps)) for sign in (1.0, -1.0))
    slopes = (ahead - behind) / (2.0 * _STEP)
    return np.where(mass[:, None] > 0.0, slopes.T.reshape(-1, *values.shape), 0.0)


def _bodies(values: Array) -> tuple[Array, Array, Array]:
    """Masses (..., bodies), centres and inertias of their numbers in the order of `STANDARD`."""
    inertia = np.zeros((*values.shape[:-1], 3, 3))
    inertia[..., _PAIRS[0], _PAIRS[1]] = inertia[..., _PAIRS[1], _PAIRS[0]] = values[..., 4:]
    return values[..., 0], values[..., 1:4], inertia
