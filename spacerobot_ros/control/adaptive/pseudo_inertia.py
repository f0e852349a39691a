r"""Physical consistency of inertial parameters, on pseudo-inertia matrices.

Ten parameters belong to a rigid body exactly where

    P = [[tr(I)/2 1 - I, h], [h^T, m]] > 0          # Wensing, Kim, Slotine 2018

P is linear in the parameters, so the physical ones are a convex cone.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from ...types import Array

_MARGIN = 1e-6  # smallest eigenvalue of P, in units of the body's own mass and size
_SWEEPS = 20
_HALVINGS = 40


def _basis() -> Array:
    """(10, 4, 4) derivatives of P by m, h (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz."""
    out = np.zeros((10, 4, 4))
    out[0, 3, 3] = 1.0
    for i in range(3):
        out[1 + i, i, 3] = out[1 + i, 3, i] = 1.0
    for index, i, j in ((4, 0, 0), (5, 0, 1), (6, 1, 1), (7, 0, 2), (8, 1, 2), (9, 2, 2)):
        if i == j:
            out[index, :3, :3] = 0.5 * np.eye(3)
            out[index, i, i] -= 1.0
        else:
            out[index, i, j] = out[index, j, i] = -1.0
    return out


BASIS = _basis()
INVERSE = np.linalg.pinv(BASIS.reshape(10, 16).T)  # (10, 16): parameters of a symmetric P


def pseudo_inertia(parameters: Array) -> Array:
    """(..., 4, 4) pseudo-inertia of parameters (..., 10)."""
    return np.einsum('...k,kij->...ij', parameters, BASIS)


def parameters_of(P: Array) -> Array:
    """(..., 10) parameters of pseudo-inertias (..., 4, 4)."""
    return np.einsum('kn,...n->...k', INVERSE, P.reshape(*P.shape[:-2], 16))


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


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def fill_pseudo_inertia(pi: Array, body: int, scale: Array, P: Array) -> None:
    """Write d P d (4, 4) of a body's ten entries of pi (p,)."""
    m = pi[10 * body : 10 * body + 10]
    half = 0.5 * (m[4] + m[6] + m[9])
    P[0, 0], P[1, 1], P[2, 2], P[3, 3] = half - m[4], half - m[6], half - m[9], m[0]
    P[1, 0], P[2, 0], P[2, 1] = -m[5], -m[7], -m[8]
    P[3, 0], P[3, 1], P[3, 2] = m[1], m[2], m[3]
    for i in range(4):
        for j in range(i + 1):
            P[i, j] *= scale[i] * scale[j]
            P[j, i] = P[i, j]


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def _is_positive(P: Array, margin: float) -> bool:
    """Whether P - margin 1 (4, 4) is positive definite; spoils the lower triangle."""
    for j in range(4):
        d = P[j, j] - margin
        for k in range(j):
            d -= P[j, k] ** 2
        if not d > 0.0:
            return False
        d = math.sqrt(d)
        P[j, j] = d
        for i in range(j + 1, 4):
            s = P[i, j]
            for k in range(j):
                s -= P[i, k] * P[j, k]
            P[i, j] = s / d
    return True


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def is_physical(pi: Array, scales: Array, margin: float = 0.0) -> bool:
    """Whether every massive body's pseudo-inertia in pi (p,) is positive definite."""
    P = np.empty((4, 4))
    for body in range(len(scales)):
        if scales[body, 3] > 0.0:
            fill_pseudo_inertia(pi, body, scales[body], P)
            if not _is_positive(P, margin):
                return False
    return True


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def project(pi: Array, G: Array, scales: Array, anchor: Array) -> bool:
    """Move parameters onto physical bodies, in the metric of the information G^-1.

    For the most negative eigenvector v of a body's P, with a = d(v^T P v)/dpi,
    pi <- pi + G a (margin - a.pi) / (a^T G a): the step is along what the data know least.

    Args:
        pi: (p,) parameters, changed.
        G: (p, p) covariance.
        scales: (b, 4) from `body_scales`.
        anchor: (p,) physical parameters; where the sweeps do not arrive, the point nearest to pi
            on the way there.

    Returns:
        Whether pi had to be moved.
    """
    if is_physical(pi, scales, _MARGIN):
        return False
    P, a = np.empty((4, 4)), np.zeros(len(pi))
    for _ in range(_SWEEPS):
        for body in range(len(scales)):
            if scales[body, 3] > 0.0:
                fill_pseudo_inertia(pi, body, scales[body], P)
                _lift(pi, G, scales[body], body, P, a)
        if is_physical(pi, scales, _MARGIN):
            return True
    way = pi - anchor
    for _ in range(_HALVINGS):
        way *= 0.9
        pi[:] = anchor + way
        if is_physical(pi, scales, _MARGIN):
            return True
    pi[:] = anchor
    return True


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def _lift(pi: Array, G: Array, scale: Array, body: int, P: Array, a: Array) -> None:
    """Raise every eigenvalue of one body's P that lies below the margin."""
    values, vectors = np.linalg.eigh(P)
    at = 10 * body
    for e in range(4):
        if values[e] > 1.5 * _MARGIN:
            return
        v = vectors[:, e] * scale
        for k in range(10):
            total = 0.0
            for i in range(4):
                for j in range(4):
                    total += v[i] * BASIS[k, i, j] * v[j]
            a[at + k] = total
        direction = np.zeros(len(pi))
        for k in range(at, at + 10):
            direction += a[k] * G[k]
        reach = a[at : at + 10] @ direction[at : at + 10]
        value = a[at : at + 10] @ pi[at : at + 10]
        if reach > 0.0 and value < 2.0 * _MARGIN:
            pi += direction * ((2.0 * _MARGIN - value) / reach)


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def natural_step(pi: Array, slope: Array, step: float, scales: Array) -> None:
    """Gradient step on the manifold of physical bodies: P <- P exp(step L P), always physical.

    tr(L dP) = slope . dpi (Lee, Kwon, Park 2018); the exponent is kept within one.

    Args:
        pi: (p,) physical parameters, the bodies' changed.
        slope: (p,) gradient Y^T sigma.
        step: Gain times period.
        scales: (b, 4) from `body_scales`.
    """
    P, L, C = np.empty((4, 4)), np.empty((4, 4)), np.empty((4, 4))
    for body in range(len(scales)):
        scale = scales[body]
        if not scale[3] > 0.0:
            continue
        fill_pseudo_inertia(pi, body, scale, P)
        g = slope[10 * body : 10 * body + 10]
        L[0, 0], L[1, 1], L[2, 2], L[3, 3] = g[6] + g[9], g[4] + g[9], g[4] + g[6], g[0]
        L[1, 0], L[2, 0], L[2, 1] = -0.5 * g[5], -0.5 * g[7], -0.5 * g[8]
        L[3, 0], L[3, 1], L[3, 2] = 0.5 * g[1], 0.5 * g[2], 0.5 * g[3]
        for i in range(4):
            for j in range(i + 1):
                L[i, j] /= scale[i] * scale[j]
                L[j, i] = L[i, j]
        C[:] = P
        if not _is_positive(C, 0.0):  # rounding at the boundary: nowhere to go from there
            continue
        C[0, 1:], C[1, 2:], C[2, 3:] = 0.0, 0.0, 0.0
        values, vectors = np.linalg.eigh(step * np.dot(np.dot(C.T, L), C))
        half = np.dot(C, vectors) * np.exp(0.5 * np.minimum(np.maximum(values, -1.0), 1.0))
        P[:] = np.dot(half, half.T)
        C[:] = P
        if not _is_positive(C, 0.0):
            continue
        for i in range(4):
            for j in range(4):
                P[i, j] /= scale[i] * scale[j]
        m = pi[10 * body : 10 * body + 10]
        m[0], m[1], m[2], m[3] = P[3, 3], P[3, 0], P[3, 1], P[3, 2]
        m[4], m[6], m[9] = P[1, 1] + P[2, 2], P[0, 0] + P[2, 2], P[0, 0] + P[1, 1]
        m[5], m[7], m[8] = -P[1, 0], -P[2, 0], -P[2, 1]
