r"""Covariances of ten inertial parameters that are uncertain as those of bodies are.

In the pseudo-inertia P (`pseudo_inertia`) a solid of mass m and centre c with second moments S
about it is m ([c; 1] [c; 1]^T + [[S, 0], [0, 0]]), and a body moved by c0 is A P A^T with
A = [[1, c0], [0, 1]].
"""

from __future__ import annotations

import numpy as np

from ..model.uncertainty import BodyUncertainty
from ..types import Array
from .pseudo_inertia import INVERSE, pseudo_inertia

_TINY = 1e-3  # smallest relative eigenvalue of a pseudo-inertia that sets a scale
_RODS = 3.0  # whose second moments a random solid has: the fewest that fill space


def random_solid(mass: float, centre: Array, spread: Array, extent: float) -> Array:
    r"""(10, 10) covariance of what a solid adds that is put somewhere, or lost there.

        m ~ N(0, mass^2),  c ~ N(centre, spread),  S = extent^2 / n sum_n g g^T,  g ~ N(0, 1)

    By the fourth moments of u = [c - centre; 1], with B = E u u^T, e = [0; 1], Q = extent^2 on the
    axes:

        E u_i u_j u_k u_l = B_ij B_kl + B_ik B_jl + B_il B_jk - 2 e_i e_j e_k e_l
        E S_ij S_kl = Q_ij Q_kl + (Q_ik Q_jl + Q_il Q_jk) / n

    Args:
        mass: Standard deviation of the mass [kg].
        centre: (3,) where it is put, in the link's frame [m].
        spread: (3, 3) covariance of where it is put [m^2].
        extent: Radius of its second moments about each axis [m].
    """
    last = np.diag([0.0, 0.0, 0.0, 1.0])
    B, Q = last.copy(), extent**2 * (np.eye(4) - last)
    B[:3, :3] = spread
    moments = _pairs(B, B, 1.0) - 2.0 * np.einsum('ij,kl->ijkl', last, last)
    moments += _pairs(Q, Q, 1.0 / _RODS)
    moments += np.einsum('ij,kl->ijkl', B, Q) + np.einsum('ij,kl->ijkl', Q, B)
    moved = np.eye(4)
    moved[:3, 3] = centre
    basis = mass * INVERSE @ np.kron(moved, moved)
    return np.asarray(basis @ moments.reshape(16, 16) @ basis.T)


def _pairs(one: Array, other: Array, share: float) -> Array:
    """(4, 4, 4, 4) of the pairings of four indices, but for the first pair a share."""
    crossed = np.einsum('ik,jl->ijkl', one, other) + np.einsum('il,jk->ijkl', one, other)
    return np.asarray(np.einsum('ij,kl->ijkl', one, other) + share * crossed)


def body_scales(parameters: Array) -> Array:
    """(b, 4) scales d that make d P d of order one: by mass and radius of gyration; 0: massless.

    Args:
        parameters: (b, 10) of every body.
    """
    mass = np.abs(parameters[:, 0])
    spread = np.abs(parameters[:, [4, 6, 9]]).sum(axis=1) / 2.0
    safe_mass = np.where(mass > 0.0, mass, 1.0)
    safe_spread = np.where(spread > 0.0, spread, 1.0)
    scales = np.empty((len(parameters), 4))
    scales[:, :3] = 1.0 / np.sqrt(safe_spread)[:, None]
    scales[:, 3] = 1.0 / np.sqrt(safe_mass)
    scales[(mass == 0.0) & (spread == 0.0)] = 0.0
    return scales


def deformation_widths(own: BodyUncertainty) -> Array:
    """(4, 4) twice the standard deviations of a body's E: a mass grows by twice an entry of it."""
    out = np.full((4, 4), own.com)
    out[:3, :3], out[3, 3] = own.inertia, own.mass
    return out


def deformed(row: Array, own: BodyUncertainty) -> Array:
    """(10, 10) covariance of a body that is random deformations of what a file says.

    P = (1 + E) P0 (1 + E)^T, entries of E independent. An indefinite body counts by its absolute
    eigenvalues; a massless one is known to be massless.

    Args:
        row: (10,) its inertial parameters.
        own: How uncertain it is.
    """
    (scale,) = body_scales(row[None])
    if not scale[3] > 0.0:
        return np.zeros((10, 10))
    values, vectors = np.linalg.eigh(pseudo_inertia(row) * np.outer(scale, scale))
    values = np.maximum(np.abs(values), _TINY * np.max(np.abs(values)))
    P = (vectors * values) @ vectors.T / np.outer(scale, scale)
    # entries i, j of E in units of the body's size, so that a shift weighs like a stretch: E P
    units = np.outer(1.0 / scale, scale)
    grown = np.einsum('ij,ia,jb->ijab', units, np.eye(4), P)
    columns = INVERSE @ (grown + np.swapaxes(grown, 2, 3)).reshape(16, 16).T
    widths = deformation_widths(own).ravel()
    largest = np.max(widths)
    columns *= widths / largest
    return np.asarray((0.5 * largest) ** 2 * columns @ columns.T)
