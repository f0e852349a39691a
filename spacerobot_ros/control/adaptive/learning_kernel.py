r"""Regression without accelerations and recursive least squares, compiled.

The momentum p = Y_p pi obeys d/dt(Y_p pi) - Y_c pi = u. Low-pass filtering both sides,

    F <- a F + (1 - a) [(Y_p,k - Y_p,k-1) / h - (Y_c,k + Y_c,k-1) / 2]
    T <- a T + (1 - a) u_{k-1},    a = exp(-rate h)

leaves T = F pi, in which no rate is differentiated: noise of the momentum enters as rate x noise.
A second low-pass of both lowers that noise by another sqrt(rate h / 4). It must be low, for noise
in the regressor biases least squares.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...dynamics.compiling import compiled, inner, summed
from ...types import Array

_SAMPLED = 0.2  # part of the stability limit that a gradient step may take


@compiled
def filter_step(rate: float, h: float, u: Array, now: Any, before: Any, filtered: Any) -> None:
    """Advance both stages over h [s] under the torques u (N,).

    Args:
        rate: Corner of the low-pass [1/s].
        h: Time since the last sample [s].
        u: (N,) torques since then.
        now: Y_p and Y_c, (N, p) each.
        before: The same at the last sample; they become those of now.
        filtered: First stage's F (N, p) and T (N,), then the second's; written.
    """
    Yp, Yc = now
    Yp_before, Yc_before = before
    F1, T1, F, T = filtered
    a = math.exp(-rate * h)
    gain = (1.0 - a) / h
    half = 0.5 * (1.0 - a)
    for i in range(F.shape[0]):
        T1[i] = a * T1[i] + (1.0 - a) * u[i]
        T[i] = a * T[i] + (1.0 - a) * T1[i]
        for j in range(F.shape[1]):
            change = gain * (Yp[i, j] - Yp_before[i, j]) - half * (Yc[i, j] + Yc_before[i, j])
            F1[i, j] = a * F1[i, j] + change
            F[i, j] = a * F[i, j] + (1.0 - a) * F1[i, j]
            Yp_before[i, j] = Yp[i, j]
            Yc_before[i, j] = Yc[i, j]


@summed
def least_squares_step(
    F: Array, T: Array, variances: Array, G: Array, pi: Array, scratch: tuple[Array, Array, Array]
) -> float:
    """Recursive least squares on T = F pi, all rows at once.

        pi <- pi + G F^T S^-1 (T - F pi),  G <- G - G F^T S^-1 F G,  S = F G F^T + R

    Args:
        F: (N, p) regressor.
        T: (N,) torques.
        variances: (N,) diagonal of R.
        G: (p, p) covariance, updated and kept symmetric.
        pi: (p,) updated.
        scratch: (N, p), (N, N) and (N,).

    Returns:
        Largest ratio of predicted to noise variance: below one the sample tells nothing.
    """
    B, S, z = scratch
    excitation = 0.0
    for i in range(F.shape[0]):
        predicted = _spread(F[i], G, pi, B[i])
        z[i] = T[i] - predicted
        for m in range(i + 1):
            S[i, m] = _inner(B[i], F[m])
        excitation = max(excitation, S[i, i] / variances[i])
        S[i, i] += variances[i]
    _whiten(S, B, z)
    for i in range(F.shape[0]):
        for j in range(len(pi)):
            pi[j] += B[i, j] * z[i]
    _shrink(G, B)
    return excitation


@summed
def _inner(a: Array, b: Array) -> float:
    """Dot product; the order of the sum is free, so that it runs on vector units."""
    total = 0.0
    for k in range(len(a)):
        total += a[k] * b[k]
    return total


@inner
def _spread(f: Array, G: Array, pi: Array, out: Array) -> float:
    """Write f G (p,); returns f . pi."""
    out[:] = 0.0
    for k in range(len(f)):
        if f[k] != 0.0:
            for j in range(len(out)):
                out[j] += f[k] * G[k, j]
    return _inner(f, pi)


@inner
def _shrink(G: Array, B: Array) -> None:
    """G (p, p) <- G - B^T B, symmetric to the last bit."""
    for k in range(len(G)):
        for i in range(len(B)):
            b = B[i, k]
            for j in range(k + 1):
                G[k, j] -= b * B[i, j]
    for k in range(len(G)):
        for j in range(k):
            G[j, k] = G[k, j]


@inner
def _whiten(S: Array, B: Array, z: Array) -> None:
    """Turn B (N, p) and z (N,) into L^-1 B and L^-1 z, S = L L^T; S keeps L."""
    for i in range(len(z)):
        for k in range(i):
            s = S[i, k]
            for m in range(k):
                s -= S[i, m] * S[k, m]
            S[i, k] = s / S[k, k]
        s = S[i, i]
        for m in range(i):
            s -= S[i, m] ** 2
        S[i, i] = math.sqrt(s)
        for k in range(i):
            for j in range(B.shape[1]):
                B[i, j] -= S[i, k] * B[k, j]
            z[i] -= S[i, k] * z[k]
        for j in range(B.shape[1]):
            B[i, j] /= S[i, i]
        z[i] /= S[i, i]


@summed
def sampled_step(step: float, W: Array, Y: Array, G: Array, width: int) -> float:
    r"""Gain times period of the gradient, as far as held torques allow.

    In a mode of the rates, with x its part of sigma, z the acceleration that wrong parameters
    cause there, and lambda an eigenvalue of M^-1 Y Gamma Y^T, the sampled loop is

        x+ = (1 - kappa h) x + h z,   z+ = z - h lambda x.

    Its poles have the product 1 - kappa h + h^2 lambda, so it is stable for h lambda < kappa: the
    largest eigenvalue of h K_D^-1 Y Gamma Y^T must be below one. The step keeps the sum of all
    eigenvalues below c = 1/5: four fifths of the damping are left for the couplings and for the
    outer loop. Where this acts, the law is that of a lower Gamma; sigma has no part in it.

    Args:
        step: Gain times period, wanted [s/J].
        W: (N, N) lower, W^T W = K_D^-1.
        Y: (N, p) regressor.
        G: (p, p) metric: Gamma by its gain.
        width: Of the blocks along G's diagonal, outside which it is zero.
    """
    rows = len(W)
    Z = np.zeros((Y.shape[1], rows))  # (W Y)^T
    for j in range(Y.shape[1]):
        for k in range(rows):
            if Y[k, j] != 0.0:
                for i in range(k, rows):
                    Z[j, i] += W[i, k] * Y[k, j]
    trace = 0.0
    for k in range(len(Z)):
        for j in range(k // width * width, k + 1):
            if G[k, j] != 0.0:
                weight = G[k, j] if j == k else 2.0 * G[k, j]
                trace += weight * _inner(Z[k], Z[j])
    return step if step * trace <= _SAMPLED else _SAMPLED / trace


@summed
def descend(step: float, G: Array, width: int, slope: Array, pi: Array) -> None:
    """Pi (p,) <- pi + step G slope, G (p, p) symmetric with blocks along the diagonal."""
    for k in range(len(slope)):
        start = k // width * width
        size = step * slope[k]
        if size != 0.0:
            for j in range(start, min(start + width, len(pi))):
                pi[j] += size * G[k, j]


@compiled
def is_within(V: Array, limits: Array) -> bool:
    """Whether the rates in V (6 + n,), all but the base's velocity, lie within their limits."""
    beyond = 0
    for i in range(3, len(V)):
        beyond += abs(V[i]) > limits[i]
    return beyond == 0


@compiled
def has_moved(q: Array, before: Array, most: float) -> bool:
    """Whether one of the joints (n,) is further than that from where it was before."""
    beyond = 0
    for i in range(len(q)):
        beyond += abs(q[i] - before[i]) > most
    return beyond > 0
