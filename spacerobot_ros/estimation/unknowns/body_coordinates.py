r"""Bodies as unknowns: mass, centre of mass and second moments, physical whatever their values.

A body is m = exp(a) m0, its centre c, and the second moments about it S = L L^T with positive
diagonal, inertia I = tr(S) 1 - S: every such body is physical, and every physical body is such a
one (Traversaro 2016, Rucker and Wensing 2022). Ten coordinates a body, zero at the robot file's:

    a            of the mass
    (c - c0) / r of the centre, in radii of gyration r = sqrt(tr(S0) / m0)
    ln L_ii/L0_ii, (L_ij - L0_ij) / l of the factor of the moments, l its root mean square

The robot file says how uncertain they are (`robot.uncertainty`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...dynamics.pseudo_inertia import pseudo_inertia
from ...model.robot import Body, Robot
from ...types import Array

_RUN_AWAY = 2.0  # of a step, by which coordinates may move as the parameters go straight
_STEP = 1e-5  # of the derivatives; the coordinates are of order one
_DIAGONAL, _BELOW = np.arange(3), (np.array([1, 2, 2]), np.array([0, 0, 1]))
_LOWER = (np.array([0, 0, 1, 0, 1, 2]), np.array([0, 1, 1, 2, 2, 2]))  # Ixx Ixy Iyy Ixz Iyz Izz
PARTS = ('mass', *3 * ('com',), *6 * ('inertia',))
"""What each of the ten coordinates of a body is of, as in `robot.uncertainty`."""


class BodyCoordinates:
    """The coordinates of a robot's bodies that can move; b bodies.

    Args:
        robot: Gives the values at zero.
        structure: `generic`: all ten of each body with mass. `symmetric`: what the URDF has at
            zero stays there, except the base's centre of mass.

    Attributes:
        size: Number m of coordinates.
        free: (b, 10) which of each body's coordinates they are, in this order.
        std: (m,) their standard deviations by the robot file.
    """

    def __init__(self, robot: Robot, structure: str) -> None:
        self._robot, bodies = robot, robot.bodies
        self._mass = np.array([b.mass for b in bodies])
        self._com = np.array([b.com for b in bodies])
        is_massless = self._mass == 0.0
        self._factor = np.array([_second_moment_factor(b) for b in bodies])
        self._spread = np.sqrt(np.einsum('iab,iab->i', self._factor, self._factor) / 3.0)
        self._size = self._spread / np.sqrt(np.where(is_massless, 1.0, self._mass) / 3.0)
        free = np.array([_free_entries(b, structure, i == 0) for i, b in enumerate(bodies)])
        self.free = free & ~is_massless[:, None]
        self.size = int(np.sum(self.free))
        stated = map(robot.uncertainty_of, range(len(bodies)))
        self.std = np.array([[getattr(u, part) for part in PARTS] for u in stated])[self.free]

    def bodies(self, coordinates: Array) -> tuple[Array, Array, Array]:
        """Masses (..., b), centres (..., b, 3) and inertias about them (..., b, 3, 3).

        Args:
            coordinates: (..., m).
        """
        values = np.zeros((*coordinates.shape[:-1], *self.free.shape))
        values[..., self.free] = coordinates
        return self._of(values)

    def _of(self, values: Array) -> tuple[Array, Array, Array]:
        mass = self._mass * np.exp(values[..., 0])
        com = self._com + self._size[:, None] * values[..., 1:4]
        lower = np.broadcast_to(self._factor, (*values.shape[:-1], 3, 3)).copy()
        lower[..., _DIAGONAL, _DIAGONAL] *= np.exp(values[..., 4:7])
        lower[..., _BELOW[0], _BELOW[1]] += self._spread[:, None] * values[..., 7:]
        moments = lower @ np.swapaxes(lower, -1, -2)
        trace = np.trace(moments, axis1=-2, axis2=-1)[..., None, None]
        return mass, com, trace * np.eye(3) - moments

    def coordinates(self, robot: Robot) -> Array:
        """(m,) coordinates of another robot's bodies; what may not move is left out."""
        values = np.zeros(self.free.shape)
        for k, body in enumerate(robot.bodies):
            if self._mass[k] > 0.0 and body.mass > 0.0:
                values[k] = self._coordinates(k, body.mass, body.com, _second_moment_factor(body))
        return values[self.free]

    def _coordinates(self, k: int, mass: float, com: Array, factor: Array) -> Array:
        """(10,) of a body of a mass, centre (3,) and factor (3, 3) of its second moments."""
        diagonal = np.log(np.diag(factor) / np.diag(self._factor[k]))
        below = (factor - self._factor[k])[_BELOW] / self._spread[k]
        centre = (com - self._com[k]) / self._size[k]
        return np.concatenate([[np.log(mass / self._mass[k])], centre, diagonal, below])

    def stepped(self, coordinates: Array, step: Array) -> Array:
        """(m,) coordinates after a step (m,) along which the inertial parameters are straight.

        Momentum is all but linear in the parameters, and bends along straight coordinates: what
        the data tell well would be lost on the way. A body that would leave the physical ones, or
        come so near that its coordinates run away, goes straight in the coordinates.
        """
        start, moved = np.zeros((2, *self.free.shape))
        start[self.free], moved[self.free] = coordinates, step
        rows = self.rows(coordinates) + np.einsum('kij,kj->ki', self.slopes(coordinates), moved)
        for k in np.flatnonzero(np.any(moved != 0.0, axis=1)).tolist():
            mass, com = rows[k, 0], rows[k, 1:4] / rows[k, 0]
            moments = pseudo_inertia(rows[k])[:3, :3] - mass * np.outer(com, com)
            if mass > 0.0 and np.linalg.eigvalsh(moments)[0] > 0.0:
                own = self._coordinates(k, mass, com, np.linalg.cholesky(moments))
                if np.max(np.abs(own - start[k])) <= _RUN_AWAY * np.max(np.abs(moved[k])):
                    moved[k] = own - start[k]
        return (start + moved)[self.free]

    def derivatives(self, of: Callable[[Array, Array, Array], Array], coordinates: Array) -> Array:
        """(k, m) derivatives of what bodies have, by the coordinates.

        Args:
            of: Values (..., k) of masses, centres and inertias as `bodies` gives them.
            coordinates: (m,).
        """
        steps = _STEP * np.eye(self.size)
        ahead, behind = (of(*self.bodies(coordinates + s * steps)) for s in (1.0, -1.0))
        return np.asarray((ahead - behind).T / (2.0 * _STEP))

    def rows(self, coordinates: Array) -> Array:
        """(..., b, 10) inertial parameters in Pinocchio's order."""
        return _inertial(*self.bodies(coordinates))

    def slopes(self, coordinates: Array) -> Array:
        """(b, 10, 10) derivatives of every body's inertial parameters by its ten coordinates.

        By central differences of all bodies at once: each depends on its own coordinates alone.
        """
        values = np.zeros(self.free.shape)
        values[self.free] = coordinates
        steps = _STEP * np.eye(10)[:, None, :]
        ahead, behind = (_inertial(*self._of(values + sign * steps)) for sign in (1.0, -1.0))
        slopes = np.moveaxis((ahead - behind) / (2.0 * _STEP), 0, -1)
        return np.asarray(slopes * self.free[:, None, :])

    def robot(self, coordinates: Array) -> Robot:
        """The robot at given coordinates (m,)."""
        found = zip(*self.bodies(coordinates), strict=True)
        bodies = tuple(
            body if body.mass == 0.0 else replace(body, mass=float(m), com=c, inertia=i)
            for body, (m, c, i) in zip(self._robot.bodies, found, strict=True)
        )
        return replace(self._robot, bodies=bodies)


def _inertial(mass: Array, com: Array, inertia: Array) -> Array:
    """(..., 10) of masses, centres and inertias about them."""
    square = np.sum(com**2, axis=-1)[..., None, None] * np.eye(3)
    moments = inertia + mass[..., None, None] * (square - com[..., :, None] * com[..., None, :])
    parts = mass[..., None], mass[..., None] * com, moments[..., _LOWER[0], _LOWER[1]]
    return np.concatenate(parts, axis=-1)


def _second_moment_factor(body: Body) -> Array:
    """(3, 3) lower factor of S = tr(I)/2 1 - I, a little inside the boundary for flat bodies."""
    moments = 0.5 * np.trace(body.inertia) * np.eye(3) - body.inertia
    values, vectors = np.linalg.eigh(moments)
    values = np.maximum(values, 1e-4 * max(float(values[-1]), 1e-12))
    return np.linalg.cholesky((vectors * values) @ vectors.T)


def _free_entries(body: Body, structure: str, is_base: bool) -> np.ndarray:
    """(10,) which of log mass, centre (3), log diagonal (3), off-diagonal (3) may move."""
    free = np.ones(10, dtype=bool)
    if structure == 'symmetric':
        free[1:4] = (body.com != 0.0) | is_base
        free[7:] = body.inertia[[1, 2, 2], [0, 0, 1]] != 0.0
    return free
