"""The joint equation of a robot at one state with its base eliminated, compiled.

A law asks for it once a sample: one call takes 15 us, one for each recursion and NumPy's solver
110 us (three joints, CPU time).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..types import Array
from .compiling import compiled
from .crba import crba
from .forward_kinematics import body_accelerations, forward_kinematics
from .rnea import rnea
from .tree import Records


@dataclass(frozen=True, slots=True, eq=False)
class ReducedEquation:
    """Joint equation with the base eliminated: H(q) q'' + c = tau.

    Args:
        H: (n, n) reduced inertia [kg m^2].
        c: (n,) velocity-dependent and gravity torques [N m].
    """

    H: Array
    c: Array


@compiled
def equation_of_motion(
    trees: tuple[Records, Records], q: Array, rates: Array, acceleration: Array
) -> Array:
    """(6 + n, 7 + n) mass matrix of [base; joints], and beside it the forces at an acceleration.

    Args:
        trees: `BODY` records of the base's equations, and of the joints'.
        q: (1, n) joint positions.
        rates: (1, 6 + n) generalized rates, base [linear; angular] in base coordinates.
        acceleration: (1, 6 + n) of the base, none of the joints.
    """
    n = q.shape[1]
    qdd = np.zeros((1, n))
    kinematics = forward_kinematics(trees[0], q, rates, rates[:, 6:].copy())
    accelerations = body_accelerations(trees[0], kinematics, acceleration)
    out = np.empty((6 + n, 7 + n))
    out[:, :-1] = crba(trees[0], kinematics)[0]
    out[:6, -1] = rnea(trees[0], kinematics, accelerations, qdd)[0, :6]
    out[6:, -1] = rnea(trees[1], kinematics, accelerations, qdd)[0, 6:]
    return out


@compiled
def eliminate(equation: Array, count: int) -> bool:
    """Eliminate the first accelerations, which nothing drives, in place.

    Gauss, without pivoting, as the inertia is symmetric and positive definite.

    Args:
        equation: (m, m + 1) inertia and bias of M a + bias = [0; tau].
        count: Number of accelerations to eliminate.

    Returns:
        Whether the inertia is positive definite.
    """
    size, is_definite = len(equation), True
    rest = equation.copy()
    for p in range(size):
        is_definite &= rest[p, p] > 0.0
        for row in range(p + 1, size):
            share = rest[row, p] / rest[p, p]
            for column in range(p, size + 1):
                rest[row, column] -= share * rest[p, column]
        if p == count - 1:
            equation[:] = rest
    return is_definite


def reduced(equation: Array, count: int) -> tuple[ReducedEquation, bool]:
    """What is left of M a + bias = [0; tau] without its first accelerations; overwrites it.

    Args:
        equation: (m, m + 1) inertia and bias.
        count: Number of accelerations that nothing drives.

    Returns:
        The joint equation, and whether the inertia is positive definite.
    """
    is_definite = eliminate(equation, count)
    return ReducedEquation(equation[count:, count:-1], equation[count:, -1]), is_definite
