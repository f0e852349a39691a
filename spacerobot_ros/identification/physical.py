r"""Estimates on the physical manifold: mass, centre of mass and inertia of every body.

The minimal linear set over-parametrises the dynamics: the products of first moments in Q_kl are
not independent of each other, and generic sets of 45, 66 or 120 numbers come from bodies that span
only 30, 38 or 52 dimensions. Projecting the linear estimate onto what rigid bodies can produce, in
the metric of its own information, is the maximum-likelihood estimate over the bodies
(asymptotically), physically consistent by construction and more precise. If no set of bodies comes
near the linear estimate, the chi-square of the projection says so: then the URDF's structure is
wrong.

A body is m = exp(a), its centre of mass c, and the second-moment matrix about it S = L L^T with
positive diagonal, inertia I = tr(S) 1 - S: every such body is physical, and every physical body is
such a one (Traversaro 2016, Rucker and Wensing 2022).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy

from ..estimation.filters.momentum_process import MomentumModel
from ..model.robot import Body, Robot
from ..model.settings import IdentifierSettings
from ..types import Array
from .validity_limits import MISFIT_P

_STEP = 1e-6  # of the numerical Jacobian; the unknowns are of order one
_EVALUATIONS = 500  # a millisecond or two each; trust regions need some thirty in narrow valleys
_FREED_EVALUATIONS = 200


@dataclass(frozen=True, slots=True, eq=False)
class PhysicalEstimate:
    """Result of the projection.

    Args:
        robot: The robot with the estimated bodies.
        constants: (p,) [h_W; AAM; x], x on the manifold.
        covariance: (p, p); its rank is that of the manifold, where that is smaller.
        dimension: Number of independent directions that the bodies span.
        misfit: Chi-square of the projection.
        dof: Its degrees of freedom, size of the linear set minus `dimension`.
        contradiction: What contradicts the structure, empty where nothing does.
        coordinates: Of the bodies, to start the next projection from.
    """

    robot: Robot
    constants: Array
    covariance: Array
    dimension: int
    misfit: float
    dof: int
    contradiction: str
    coordinates: Array


class BodyParameters:
    """Unconstrained coordinates of the bodies' parameters, zero at the robot file's values.

    A massive body has up to ten: log mass, centre of mass in units of the body's own size, and the
    lower factor of its second moments (log diagonal, off-diagonal in units of its spread). With
    `symmetric`, what the URDF has at zero stays there, except the base's centre of mass.

    Args:
        robot: Gives the starting values and the zeros.
        structure: `symmetric` or `generic`.
    """

    def __init__(self, robot: Robot, structure: str) -> None:
        self._robot = robot
        bodies = robot.bodies
        self._mass = np.array([b.mass for b in bodies])
        self._com = np.array([b.com for b in bodies])
        massless = self._mass == 0.0
        self._factor = np.array([_second_moment_factor(b) for b in bodies])
        self._spread = np.sqrt(np.einsum('iab,iab->i', self._factor, self._factor) / 3.0)
        self._size = self._spread / np.sqrt(np.where(massless, 1.0, self._mass) / 3.0)
        free = np.array([_free_entries(b, structure, i == 0) for i, b in enumerate(bodies)])
        self._free = free & ~massless[:, None]
        self.size = int(np.sum(self._free))

    def bodies(self, coordinates: Array) -> tuple[Array, Array, Array]:
        """Masses (..., n+1), centres (..., n+1, 3) and inertias (..., n+1, 3, 3).

        Args:
            coordinates: (..., size).
        """
        values = np.zeros((*coordinates.shape[:-1], *self._free.shape))
        values[..., self._free] = coordinates
        mass = self._mass * np.exp(values[..., 0])
        com = self._com + self._size[:, None] * values[..., 1:4]
        lower = np.broadcast_to(
            self._factor, (*coordinates.shape[:-1], *self._factor.shape)
        ).copy()
        diagonal, below = np.arange(3), (np.array([1, 2, 2]), np.array([0, 0, 1]))
        lower[..., diagonal, diagonal] *= np.exp(values[..., 4:7])
        lower[..., below[0], below[1]] += self._spread[:, None] * values[..., 7:]
        moments = lower @ np.swapaxes(lower, -1, -2)
        trace = np.trace(moments, axis1=-2, axis2=-1)[..., None, None]
        return mass, com, trace * np.eye(3) - moments

    def minimal_values(self, model: MomentumModel, coordinates: Array) -> Array:
        """(..., k) minimal parameters of a model of the robot."""
        pi = model.tree.block_parameters(*self.bodies(coordinates))
        return np.asarray(pi @ model.minimal.regrouping.T)

    def robot(self, coordinates: Array) -> Robot:
        """The robot at given coordinates (size,)."""
        estimated = zip(*self.bodies(coordinates), strict=True)
        bodies = tuple(
            body if body.mass == 0.0 else replace(body, mass=float(m), com=c, inertia=i)
            for body, (m, c, i) in zip(self._robot.bodies, estimated, strict=True)
        )
        return replace(self._robot, bodies=bodies)


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Bodies whose minimal parameters are nearest to wanted ones; their coordinates are sought.

    Args:
        values: (..., k) minimal parameters by coordinates (..., size).
        wanted: (k,) linear estimate of them.
        root: (k, k) square root of its information.
        prior_std: Of the coordinates.
    """

    values: Callable[[Array], Array]
    wanted: Array
    root: Array
    prior_std: float

    def misfit(self, coordinates: Array) -> float:
        """Chi-square against the linear estimate, without the prior."""
        return float(np.sum((self.root @ (self.values(coordinates) - self.wanted)) ** 2))

    def residual(self, coordinates: Array) -> Array:
        """(..., k + size) misfit and prior."""
        misfit = (self.values(coordinates) - self.wanted) @ self.root.T
        return np.concatenate([misfit, coordinates / self.prior_std], axis=-1)

    def solve(self, start: Array, evaluations: int) -> tuple[Array, bool]:
        """Coordinates of the least misfit, and whether the search has settled."""
        slope = partial(central_differences, self.residual)
        solution = scipy.optimize.least_squares(
            self.residual, start, jac=slope, method='trf', max_nfev=evaluations
        )
        return solution.x, bool(solution.status > 0)

    def without(self, directions: Array) -> _Fit:
        """The same where the parameters may leave the bodies by directions (k, m)."""
        basis = scipy.linalg.orth(self.root @ directions)
        return replace(self, root=self.root - basis @ (basis.T @ self.root))


def project(
    model: MomentumModel,
    settings: IdentifierSettings,
    constants: Array,
    factor: Array,
    start: Array | None = None,
) -> PhysicalEstimate:
    """Project a linear estimate onto the physical manifold.

    What bodies do not constrain (momenta, nuisances) is eliminated first, and follows.

    Args:
        model: Robot and minimal set.
        settings: Structure of the minimal set; the prior on the coordinates about the robot file's
            values only decides between bodies that the data cannot tell apart.
        constants: (p,) linear estimate [h_W; AAM; x].
        factor: (p, p) square root of its information.
        start: Coordinates to start from, of an earlier projection; the robot file's by default.
    """
    bodies, wanted = BodyParameters(model.robot, settings.structure), constants[model.x]
    others = np.delete(np.arange(model.size), model.x)
    head = len(others)
    ordered = np.hstack([factor[:, others], factor[:, model.x]])
    triangle = np.asarray(np.linalg.qr(ordered, mode='r'))
    own, across = triangle[:head, :head], triangle[:head, head:]
    values = partial(bodies.minimal_values, model)
    fit = _Fit(values, wanted, triangle[head:, head:], settings.prior_std)
    first = np.zeros(bodies.size) if start is None else start
    found, is_settled = fit.solve(first, _EVALUATIONS)
    J, manifold = (central_differences(f, found) for f in (fit.residual, values))
    spread = np.zeros((model.size, head + bodies.size))
    spread[model.x, head:] = scipy.linalg.solve_triangular(
        np.linalg.qr(J, mode='r'), manifold.T, trans='T'
    ).T
    ahead = np.hstack([np.eye(head), -across @ spread[model.x, head:]])
    spread[others] = scipy.linalg.solve_triangular(own, ahead)
    projected = constants.copy()
    projected[model.x] = values(found)
    projected[others] -= scipy.linalg.solve_triangular(own, across @ (projected[model.x] - wanted))
    misfit, rank = fit.misfit(found), column_rank(fit.root @ manifold)
    dof = len(wanted) - rank
    return PhysicalEstimate(
        bodies.robot(found),
        projected,
        spread @ spread.T,
        head + rank,
        misfit,
        dof,
        _contradiction(model, settings, fit, found, dof, is_settled),
        found,
    )


def _contradiction(
    model: MomentumModel,
    settings: IdentifierSettings,
    fit: _Fit,
    found: Array,
    dof: int,
    is_settled: bool,
) -> str:
    """What contradicts the structure, and which bodies would have to be unphysical, in words.

    Each body's own inertia is freed of being that of a mass distribution, and the bodies are
    sought again: whichever bodies alone remove the contradiction are named.
    """
    misfit, misfits = fit.misfit(found), {}
    if not _is_unlikely(misfit, dof):
        return ''
    if not is_settled:
        return 'the search for physical bodies has not settled'
    for index, body in enumerate(model.robot.bodies):
        own = slice(6 * index, 6 * index + 6)  # its inertia among the block parameters
        freed = fit.without(model.minimal.regrouping[:, own])
        misfits[body.name] = freed.misfit(freed.solve(found, _FREED_EVALUATIONS)[0])
    explaining = [n for n, m in misfits.items() if not _is_unlikely(m, max(dof - 6, 1))]
    nearest = min(misfits, key=lambda n: misfits[n])
    why = f'no single body is at fault; {nearest} is nearest'
    if explaining:
        why = f'{" or ".join(explaining)} alone, with an inertia that no body has, would'
    return (
        f'no physical bodies of this {settings.structure} structure explain the linear '
        f'estimate: chi-square {misfit:.4g} for {dof} degrees of freedom; {why}'
    )


def _is_unlikely(misfit: float, dof: int) -> bool:
    return dof > 0 and bool(scipy.special.chdtrc(dof, misfit) < MISFIT_P)


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


def central_differences(
    function: Callable[[Array], Array], at: Array, step: float = _STEP
) -> Array:
    """Jacobian (m, size) of a function that takes stacked arguments (..., size)."""
    steps = step * np.eye(len(at))
    return (function(at + steps) - function(at - steps)).T / (2.0 * step)


def column_rank(matrix: Array, known: float = 1e-7) -> int:
    """Rank with columns of unit norm, by the share of the largest singular value that counts."""
    norms = np.linalg.norm(matrix, axis=0)
    singular = np.linalg.svd(matrix / np.where(norms > 0.0, norms, 1.0), compute_uv=False)
    return int(np.sum(singular > known * singular[0]))
