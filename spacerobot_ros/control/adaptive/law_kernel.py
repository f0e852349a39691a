r"""One evaluation of the control law, compiled.

Reference velocities V_r follow the wanted motion with first-order error dynamics, and

    u = Y_SL(q, V, V_r, A_r) pi + K_D sigma,  sigma = V_r - V,  K_D = K + kappa / m P^T P

whose three force rows must vanish, since nothing pushes the base: they fix the linear part of A_r.
P V is the linear momentum, so the second part of K_D pulls V_r's linear momentum to V's and, with
the right parameters, the torques do not feel it: they are those with the translation eliminated,
whatever the configuration. K_D is positive definite, and enters the proof by that alone.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from ...types import Array
from .regressor_kernel import fill_slotine_li, place, reference_accelerations, velocities
from .spatial import Triple, cross, dot, out_of, part, plus, put, row, times
from .tree import Tree

_SMALL = 1e-9  # half angle below which its sine is itself


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def attitude_reference(
    attitude: Array, target: Array, omega: Triple, bandwidth: float
) -> tuple[Triple, float, Triple, Triple]:
    """Attitude error and the reference rate of the base.

        q_e = q^-1 q_d,  w_r = R_e w_d + 2 Lambda eps_e

    with the sign of q_e that turns the shorter way (no unwinding).

    Args:
        attitude: (4,) q_WB_xyzw.
        target: (10,) q_WD_xyzw, omega_WD_D, and the latter's time derivative.
        omega: omega_WB_B.
        bandwidth: Lambda [1/s].

    Returns:
        eps_e and eta_e >= 0 of the error, w_r in B, and the derivative of its components.
    """
    e, eta = part(attitude, 0), attitude[3]
    e_d, eta_d = part(target, 0), target[3]
    scalar = eta * eta_d + e[0] * e_d[0] + e[1] * e_d[1] + e[2] * e_d[2]
    eps = plus(plus(times(eta, e_d), times(-eta_d, e)), cross(e_d, e))
    if scalar < 0.0:
        scalar, eps = -scalar, times(-1.0, eps)
    feed = _rotated(eps, scalar, part(target, 4))
    feed_rate = plus(_rotated(eps, scalar, part(target, 7)), cross(feed, omega))
    slip = plus(feed, times(-1.0, omega))
    rate = plus(feed, times(2.0 * bandwidth, eps))
    eps_rate = plus(times(scalar, slip), cross(slip, eps))
    return eps, scalar, rate, plus(feed_rate, times(bandwidth, eps_rate))


@numba.njit(inline='always')  # type: ignore[untyped-decorator]
def _rotated(eps: Triple, eta: float, a: Triple) -> Triple:
    """A vector turned by a unit quaternion."""
    t = times(2.0, cross(eps, a))
    return plus(a, plus(times(eta, t), cross(eps, t)))


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def total_mass(tree: Tree, pi: Array) -> float:
    """Sum of the masses in pi (p,)."""
    mass = 0.0
    for k in range(len(tree.parents)):
        mass += pi[10 * k]
    return mass


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def rest_centre(tree: Tree, R: Array, p: Array, V: Array, pi: Array, motion: Array) -> None:
    """Give V (6 + n,) the base velocity at which the linear momentum is zero."""
    V[:3] = 0.0
    v, w, f = motion[0], motion[1], motion[5]
    velocities(tree, R, p, V, v, w)
    for k in range(len(tree.parents)):
        h = part(pi, 10 * k + 1)
        put(f, k, plus(times(pi[10 * k], row(v, k)), cross(row(w, k), h)))
    for k in tree.order[:0:-1]:
        parent = tree.parents[k]
        put(f, parent, plus(row(f, parent), out_of(R, k, row(f, k))))
    mass = total_mass(tree, pi)
    for i in range(3):
        V[i] = -f[0, i] / mass


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def momentum_map(tree: Tree, R: Array, p: Array, pi: Array, motion: Array, P: Array) -> float:
    """Write P (3, 6 + n), the linear momentum P V in base coordinates; returns the total mass."""
    moment, mass = motion[0], motion[1, :, 0]
    for k in range(len(tree.parents)):
        mass[k] = pi[10 * k]
        put(moment, k, part(pi, 10 * k + 1))
    for k in tree.order[:0:-1]:
        parent = tree.parents[k]
        shifted = plus(out_of(R, k, row(moment, k)), times(mass[k], row(p, k)))
        mass[parent] += mass[k]
        put(moment, parent, plus(row(moment, parent), shifted))
    h = row(moment, 0)
    P[:, :6] = 0.0
    for i in range(3):
        P[i, i] = mass[0]
    P[0, 4], P[1, 3], P[0, 5], P[2, 3] = h[2], -h[2], -h[1], h[1]
    P[1, 5], P[2, 4] = h[0], -h[0]
    for k in tree.order[1:]:
        axis, slide = row(tree.axes, k), tree.sliding[k]
        turned = times(1.0 - slide, cross(axis, row(moment, k)))
        column = plus(times(slide * mass[k], axis), turned)
        i = k
        while i > 0:
            column = out_of(R, i, column)
            i = tree.parents[i]
        P[0, 5 + k], P[1, 5 + k], P[2, 5 + k] = column
    return mass[0]


@numba.njit(cache=True, fastmath={'reassoc', 'contract'})  # type: ignore[untyped-decorator]
def command(
    tree: Tree,
    R: Array,
    p: Array,
    V: Array,
    Vr: Array,
    Ar: Array,
    h: float,
    K: Array,
    kappa: float,
    pi: Array,
    motion: Array,
    columns: Array,
    P: Array,
    Y: Array,
    slope: Array,
    sigma: Array,
    u: Array,
) -> None:
    """Torques, with the free linear reference acceleration.

    Args:
        tree: The tree.
        R: From `place`.
        p: From `place`.
        V: (6 + n,) velocity.
        Vr: (6 + n,) reference velocity; the first three go on by h.
        Ar: (6 + n,) its derivative; the first three are written.
        h: Period over which the first three of V_r go on [s].
        K: (6 + n, 6 + n) gain of the rates, zero for the translation.
        kappa: Bandwidth of the translation's reference [1/s].
        pi: (p,) parameters.
        motion: Scratch.
        columns: Scratch.
        P: Scratch (3, 6 + n).
        Y: (6 + n, p) written: Slotine-Li regressor.
        slope: (p,) written: Y^T sigma.
        sigma: (6 + n,) written: V_r - V.
        u: (6 + n,) written: [0; base torque; joint torques].
    """
    for i in range(len(u)):
        sigma[i] = Vr[i] - V[i]
    mass = momentum_map(tree, R, p, pi, motion, P)
    _rate_feedback(K, kappa / mass, P, sigma, u)
    force = _inertial_force(tree, R, p, V, Vr, Ar, pi, motion)
    for i in range(3):
        Ar[i] = -(force[i] + u[i]) / mass
    fill_slotine_li(tree, R, p, V, Vr, Ar, motion, columns, Y)
    slope[:] = 0.0
    for i in range(len(u)):
        total = 0.0
        for j in range(len(pi)):
            total += Y[i, j] * pi[j]
            slope[j] += Y[i, j] * sigma[i]
        u[i] += total
    for i in range(3):
        Vr[i] += h * Ar[i]


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def _rate_feedback(K: Array, rate: float, P: Array, sigma: Array, u: Array) -> None:
    """Write u = K_D sigma, K_D = K + rate P^T P."""
    a = np.dot(P, sigma)
    for i in range(len(u)):
        u[i] = rate * (P[0, i] * a[0] + P[1, i] * a[1] + P[2, i] * a[2])
        for j in range(3, len(u)):
            u[i] += K[i, j] * sigma[j]


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def _inertial_force(
    tree: Tree, R: Array, p: Array, V: Array, Vr: Array, Ar: Array, pi: Array, motion: Array
) -> Triple:
    """Force rows of Y_SL pi at a linear reference acceleration of zero, which is written to Ar."""
    Ar[:3] = 0.0
    v, w, vr, wr, a, b = motion[0], motion[1], motion[2], motion[3], motion[4], motion[5]
    velocities(tree, R, p, V, v, w)
    velocities(tree, R, p, Vr, vr, wr)
    reference_accelerations(tree, R, p, V, Ar, vr, wr, a, b)
    for k in range(len(tree.parents)):
        w_k, wr_k, h = row(w, k), row(wr, k), part(pi, 10 * k + 1)
        bend = plus(row(b, k), times(0.5, cross(w_k, wr_k)))
        spin = plus(cross(w_k, cross(wr_k, h)), cross(wr_k, cross(w_k, h)))
        pull = times(pi[10 * k], plus(row(a, k), cross(w_k, row(vr, k))))
        put(a, k, plus(pull, plus(cross(bend, h), times(0.5, spin))))
    for k in tree.order[:0:-1]:
        parent = tree.parents[k]
        put(a, parent, plus(row(a, parent), out_of(R, k, row(a, k))))
    return row(a, 0)


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def reference_motion(
    tree: Tree,
    state: Array,
    target: Array,
    bandwidths: Array,
    R: Array,
    p: Array,
    V: Array,
    Vr: Array,
    Ar: Array,
    error: Array,
) -> None:
    """Write placement, V, and V_r and A_r but for their linear parts.

    Args:
        tree: The tree.
        state: (10 + 2 n,) q_WB_xyzw, v_WB_B, omega_WB_B, q, qd.
        target: (10 + 3 n,) q_WD_xyzw, omega_WD_D, its derivative, q, qd, qdd.
        bandwidths: (1 + n,) Lambda of the attitude and of the joints [1/s].
        R: Written, as by `place`.
        p: Written.
        V: (6 + n,) written.
        Vr: (6 + n,) written.
        Ar: (6 + n,) written.
        error: (3 + n,) written: rotation vector to the wanted attitude and joint errors.
    """
    n = len(bandwidths) - 1
    place(tree, state[10 : 10 + n], R, p)
    V[:6] = state[4:10]
    V[6:] = state[10 + n :]
    eps, eta, rate, rate_dot = attitude_reference(state[:4], target, part(V, 3), bandwidths[0])
    half = math.sqrt(dot(eps, eps))
    turn = 2.0 if half < _SMALL else 2.0 * math.atan2(half, eta) / half
    error[0], error[1], error[2] = times(turn, eps)
    Vr[3], Vr[4], Vr[5] = rate
    Ar[3], Ar[4], Ar[5] = rate_dot
    for j in range(n):
        late = target[10 + j] - state[10 + j]
        late_rate = target[10 + n + j] - V[6 + j]
        error[3 + j] = late
        Vr[6 + j] = target[10 + n + j] + bandwidths[1 + j] * late
        Ar[6 + j] = target[10 + 2 * n + j] + bandwidths[1 + j] * late_rate


@numba.njit(cache=True)  # type: ignore[untyped-decorator]
def into_base(attitude: Array, a: Array) -> tuple[float, float, float]:
    """A vector (3,) of the inertial frame in base coordinates."""
    eps = (-attitude[0], -attitude[1], -attitude[2])
    return _rotated(eps, attitude[3], part(a, 0))
