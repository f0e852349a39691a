"""Physical consistency of adapted inertial parameters, on pseudo-inertias P of all bodies."""

from __future__ import annotations

import math

import numpy as np

from ...dynamics.compiling import compiled, inner
from ...dynamics.pseudo_inertia import BASIS, INVERSE
from ...types import Array

_MARGIN = 1e-6  # smallest eigenvalue of P, in units of the body's own mass and size
_SWEEPS = 20
_HALVINGS = 40


@inner
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


@inner
def _factor(P: Array, margin: float, C: Array) -> bool:
    """Write C (4, 4), lower, with C C^T = P - margin 1; False where that is not positive."""
    for j in range(4):
        d = P[j, j] - margin
        for k in range(j):
            d -= C[j, k] ** 2
            C[k, j] = 0.0
        if not d > 0.0:
            return False
        C[j, j] = math.sqrt(d)
        for i in range(j + 1, 4):
            total = P[i, j]
            for k in range(j):
                total -= C[i, k] * C[j, k]
            C[i, j] = total / C[j, j]
    return True


@compiled
def is_physical(pi: Array, scales: Array, margin: float = 0.0) -> bool:
    """Whether every massive body's pseudo-inertia in pi (p,) is positive definite."""
    P, C = np.empty((4, 4)), np.empty((4, 4))
    for body in range(len(scales)):
        if scales[body, 3] > 0.0:
            fill_pseudo_inertia(pi, body, scales[body], P)
            if not _factor(P, margin, C):
                return False
    return True


@compiled
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
    P = np.empty((4, 4))
    for _ in range(_SWEEPS):
        for body in range(len(scales)):
            if scales[body, 3] > 0.0:
                fill_pseudo_inertia(pi, body, scales[body], P)
                _raise_eigenvalues(pi, G, scales[body], body, P)
        if is_physical(pi, scales, _MARGIN):
            return True
    for halving in range(_HALVINGS + 1):
        share = 0.9 if halving < _HALVINGS else 0.0
        for k in range(len(pi)):
            pi[k] = anchor[k] + share * (pi[k] - anchor[k])
        if is_physical(pi, scales, _MARGIN):
            return True
    return True


@inner
def _raise_eigenvalues(pi: Array, G: Array, scale: Array, body: int, P: Array) -> None:
    """Raise every eigenvalue of one body's P that lies below the margin."""
    values, vectors = np.linalg.eigh(P)
    at, a, direction = 10 * body, np.zeros(10), np.zeros(len(pi))
    for e in range(4):
        if values[e] > 1.5 * _MARGIN:
            return
        value, reach = 0.0, 0.0
        direction[:] = 0.0
        for k in range(10):
            a[k] = 0.0
            for i in range(4):
                for j in range(4):
                    weight = scale[i] * vectors[i, e] * scale[j] * vectors[j, e]
                    a[k] += weight * BASIS[k, i, j]
            value += a[k] * pi[at + k]
            for m in range(len(pi)):
                direction[m] += a[k] * G[at + k, m]
        for k in range(10):
            reach += a[k] * direction[at + k]
        if reach > 0.0 and value < 2.0 * _MARGIN:
            for m in range(len(pi)):
                pi[m] += direction[m] * ((2.0 * _MARGIN - value) / reach)


@compiled
def natural_step(pi: Array, slope: Array, steps: Array, scales: Array) -> None:
    """Gradient step on the manifold of physical bodies: P <- P exp(step L P), always physical.

    tr(L dP) = slope . dpi (Lee, Kwon, Park 2018); the exponent is kept within one.

    Args:
        pi: (p,) physical parameters, the bodies' changed.
        slope: (p,) gradient Y^T sigma.
        steps: (b,) gain times period of each body.
        scales: (b, 4) from `body_scales`.
    """
    P, C, L, half = np.empty((4, 4)), np.empty((4, 4)), np.empty((4, 4)), np.empty((4, 4))
    for body in range(len(scales)):
        if not scales[body, 3] > 0.0:
            continue
        at, scale = slice(10 * body, 10 * body + 10), scales[body]
        fill_pseudo_inertia(pi, body, scale, P)
        if not _factor(P, 0.0, C):
            continue  # rounding at the boundary: nowhere to go from there
        _slope(slope[at], scale, L)
        _product(L, C, half)
        _product(C.T, half, L)
        values, vectors = np.linalg.eigh(L)
        _product(C, vectors, half)
        for e in range(4):
            growth = math.exp(0.5 * min(max(steps[body] * values[e], -1.0), 1.0))
            for i in range(4):
                half[i, e] *= growth
        _product(half, half.T, P)
        if _factor(P, 0.0, C):
            _parameters(P, scale, pi[at])


@inner
def _slope(by_parameter: Array, scale: Array, L: Array) -> None:
    """Write L (4, 4) with tr(L dP) = by_parameter . dpi, by_parameter (10,)."""
    for i in range(4):
        for j in range(4):
            L[i, j] = 0.0
            for k in range(10):
                L[i, j] += by_parameter[k] * INVERSE[k, 4 * i + j] / (scale[i] * scale[j])


@inner
def _parameters(P: Array, scale: Array, out: Array) -> None:
    """Write the parameters (10,) of a pseudo-inertia."""
    for k in range(10):
        out[k] = 0.0
        for i in range(4):
            for j in range(4):
                out[k] += INVERSE[k, 4 * i + j] * P[i, j] / (scale[i] * scale[j])


@inner
def _product(A: Array, B: Array, out: Array) -> None:
    """Write A B, (4, 4) each."""
    for i in range(4):
        for j in range(4):
            out[i, j] = 0.0
            for k in range(4):
                out[i, j] += A[i, k] * B[k, j]
