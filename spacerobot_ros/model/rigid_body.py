"""Mass, centre of mass and inertia of a rigid body, and whether one may have them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..errors import ModelError
from ..types import Array, Matrix3, Vector3

# Relative slack of the triangle inequality: URDFs print inertias with about six digits, and a flat
# plate sits on the bound.
_TRIANGLE_SLACK = 1e-6


class Solid(NamedTuple):
    """What a body opposes to being accelerated, in some frame.

    Args:
        mass: Mass [kg].
        com: (3,) centre of mass [m].
        inertia: (3, 3) about the centre of mass [kg m^2].
    """

    mass: float
    com: Vector3
    inertia: Matrix3

    @classmethod
    def of_row(cls, row: Array) -> Solid:
        """From (10,) inertial parameters; nothing at all where these have no mass."""
        if not row[0]:
            return cls(0.0, np.zeros(3), np.zeros((3, 3)))
        mass, com = float(row[0]), row[1:4] / row[0]
        return cls(mass, com, row[[[4, 5, 7], [5, 6, 8], [7, 8, 9]]] - mass * _squared(com))

    @property
    def row(self) -> Array:
        """(10,) m, m c, and Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the origin of the frame."""
        about = self.inertia + self.mass * _squared(self.com)
        return np.array([self.mass, *(self.mass * self.com), *about[_COLUMNS, _ROWS]])

    def placed(self, rotation: Matrix3, translation: Vector3) -> Solid:
        """In the frame in which these place its own."""
        inertia = rotation @ self.inertia @ rotation.T
        return Solid(self.mass, rotation @ self.com + translation, inertia)

    def joined(self, other: Solid) -> Solid:
        """One body with another in the same frame."""
        mass, inertia = self.mass + other.mass, self.inertia + other.inertia
        if not mass:
            return Solid(mass, self.com, inertia)
        reduced = self.mass * other.mass / mass
        com = (self.mass * self.com + other.mass * other.com) / mass
        return Solid(mass, com, inertia + reduced * _squared(self.com - other.com))

    def without(self, part: Solid) -> Solid:
        """Less a part of it."""
        return self.joined(Solid(-part.mass, part.com, -part.inertia))


_ROWS, _COLUMNS = np.array([0, 0, 1, 0, 1, 2]), np.array([0, 1, 1, 2, 2, 2])


def _squared(v: Vector3) -> Matrix3:
    """Inertia about the origin of 1 kg at a place."""
    return np.asarray(v @ v * np.eye(3) - np.outer(v, v))


def check_inertia(mass: float, inertia: Matrix3, where: str) -> None:
    """Refuse a mass and an inertia about the centre of mass that no rigid body has.

    Args:
        mass: Mass [kg].
        inertia: (3, 3) about the centre of mass [kg m^2].
        where: Place for the error message.

    Raises:
        ModelError: negative mass, inertia without mass, asymmetric or indefinite tensor, triangle
            inequality violated.
    """
    if why := fault_of(mass, inertia):
        raise ModelError(where, why)


def fault_of(mass: float, inertia: Matrix3, axes: Matrix3 | None = None) -> str:
    """Why no rigid body has a mass and an inertia; empty where one may.

    Args:
        mass: [kg].
        inertia: (3, 3) about the centre of mass [kg m^2].
        axes: (3, 3) takes the axes in which a file gives the inertia to these; None: the same.
    """
    if not np.all(np.isfinite(inertia)) or not math.isfinite(mass):
        return 'mass or inertia is not finite'
    scale = float(np.max(np.abs(inertia)))
    a, b, c = np.linalg.eigvalsh(inertia)
    tests = (
        (mass < 0.0, f'negative mass {mass:g} kg'),
        (np.max(np.abs(inertia - inertia.T)) > 1e-9 * scale, 'inertia tensor is not symmetric'),
        (mass == 0.0 and scale > 0.0, 'has inertia but no mass'),
        (
            a < -_TRIANGLE_SLACK * scale,
            f'inertia is not positive: principal moments {a:.6g}, {b:.6g}, {c:.6g} kg m^2',
        ),
        (
            c > (a + b) * (1.0 + _TRIANGLE_SLACK),
            f'no rigid body has these principal moments: {c:.6g} > {a:.6g} + {b:.6g} kg m^2 '
            f'(triangle inequality); the nearest in its own axes: {_nearest(inertia, axes)}',
        ),
    )
    return next((why for is_wrong, why in tests if is_wrong), '')


def _nearest(inertia: Matrix3, axes: Matrix3 | None) -> str:
    """The closest inertia that keeps the triangle inequality, as a URDF says it.

    Least squares: each principal moment moves by a third of what the two smaller ones lack.
    """
    own = inertia if axes is None else axes.T @ inertia @ axes
    moments, principal = np.linalg.eigh(own)
    lack = (moments[2] - moments[0] - moments[1]) * (1.0 + _TRIANGLE_SLACK) / 3.0
    near = (principal * (moments + lack * np.array([1.0, 1.0, -1.0]))) @ principal.T
    rows, columns = np.triu_indices(3)
    return ' '.join(
        f'i{"xyz"[i]}{"xyz"[j]}="{near[i, j]:.7g}"' for i, j in zip(rows, columns, strict=True)
    )
