"""Whether a mass and an inertia are those of a rigid body."""

from __future__ import annotations

import math

import numpy as np

from ..errors import ModelError
from ..types import Matrix3

# Relative slack of the triangle inequality: URDFs print inertias with about six digits, and a flat
# plate sits on the bound.
_TRIANGLE_SLACK = 1e-6


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


def fault_of(mass: float, inertia: Matrix3) -> str:
    """Why no rigid body has a mass [kg] and (3, 3) an inertia about its centre of mass [kg m^2].

    Empty where one may.
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
            f'(triangle inequality); the nearest in the axes of the link: {_nearest(inertia)}',
        ),
    )
    return next((why for is_wrong, why in tests if is_wrong), '')


def _nearest(inertia: Matrix3) -> str:
    """The closest inertia that keeps the triangle inequality, as a URDF says it.

    Least squares: each principal moment moves by a third of what the two smaller ones lack.
    """
    moments, axes = np.linalg.eigh(inertia)
    lack = (moments[2] - moments[0] - moments[1]) * (1.0 + _TRIANGLE_SLACK) / 3.0
    near = (axes * (moments + lack * np.array([1.0, 1.0, -1.0]))) @ axes.T
    rows, columns = np.triu_indices(3)
    return ' '.join(
        f'i{"xyz"[i]}{"xyz"[j]}="{near[i, j]:.7g}"' for i, j in zip(rows, columns, strict=True)
    )
