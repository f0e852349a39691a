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

from ...dynamics.body_regressors import (
    Regression,
    add_uniform_acceleration,
    fill_slotine_li,
    momentum_map,
    rest_centre,
)
from ...dynamics.compiling import Triple, compiled, inner, summed
from ...dynamics.spatial import cross, dot, get, plus, put, times, turn
from ...types import Array

_SMALL = 1e-9  # half angle below which its sine is itself


@inner
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
    e, eta = get(attitude, 0), attitude[3]
    e_d, eta_d = get(target, 0), target[3]
    scalar = eta * eta_d + e[0] * e_d[0] + e[1] * e_d[1] + e[2] * e_d[2]
    eps = plus(plus(times(eta, e_d), times(-eta_d, e)), cross(e_d, e))
    if scalar < 0.0:
        scalar, eps = -scalar, times(-1.0, eps)
    feed = turn(eps, scalar, 2.0, get(target, 4))
    feed_rate = plus(turn(eps, scalar, 2.0, get(target, 7)), cross(feed, omega))
    slip = plus(feed, times(-1.0, omega))
    rate = plus(feed, times(2.0 * bandwidth, eps))
    eps_rate = plus(times(scalar, slip), cross(slip, eps))
    return eps, scalar, rate, plus(feed_rate, times(bandwidth, eps_rate))


@compiled
def reference_motion(
    state: Array, target: Array, bandwidths: Array, rates: Array, motion: Array, error: Array
) -> None:
    """Write V, and V_r and A_r but for their linear parts.

    Where an error asks for more than a joint's largest rate, V_r is that.

    Args:
        state: (10 + 2 n,) q_WB_xyzw, v_WB_B, omega_WB_B, q, qd.
        target: (10 + 3 n,) q_WD_xyzw, omega_WD_D, its derivative, q, qd, qdd.
        bandwidths: (1 + n,) Lambda of the attitude and of the joints [1/s].
        rates: (n,) largest rates of the joints [rad/s].
        motion: (3, 6 + n) V, V_r and A_r, written.
        error: (3 + n,) written: rotation vector to the wanted attitude and joint errors.
    """
    n = len(bandwidths) - 1
    V, Vr, Ar = motion[0], motion[1], motion[2]
    for i in range(6):
        V[i] = state[4 + i]
    for i in range(n):
        V[6 + i] = state[10 + n + i]
    eps, eta, rate, rate_dot = attitude_reference(state, target, get(V, 3), bandwidths[0])
    half = math.sqrt(dot(eps, eps))
    put(error, 0, times(2.0 if half < _SMALL else 2.0 * math.atan2(half, eta) / half, eps))
    put(Vr, 3, rate)
    put(Ar, 3, rate_dot)
    for j in range(n):
        late = target[10 + j] - state[10 + j]
        late_rate = target[10 + n + j] - V[6 + j]
        error[3 + j] = late
        Vr[6 + j] = target[10 + n + j] + bandwidths[1 + j] * late
        Ar[6 + j] = target[10 + 2 * n + j] + bandwidths[1 + j] * late_rate
        if abs(Vr[6 + j]) > rates[j]:
            Vr[6 + j] = math.copysign(rates[j], Vr[6 + j])
            if Ar[6 + j] * Vr[6 + j] > 0.0:
                Ar[6 + j] = 0.0


@summed
def command(
    machine: Regression,
    q: Array,
    motion: Array,
    pi: Array,
    gains: tuple[Array, float, float],
    at_rest: tuple[bool, bool],
    out: tuple[Array, Array, Array, Array],
) -> None:
    """Torques, with the free linear reference acceleration.

    Args:
        machine: The tree.
        q: (n,) joint positions.
        motion: (3, 6 + n) V; V_r, whose first three go on by a period; A_r, whose first three are
            written.
        pi: (p,) parameters.
        gains: K (6 + n, 6 + n) of the rates, zero for the translation; kappa of the translation's
            reference [1/s]; period [s].
        at_rest: Whether V's and V_r's linear parts follow from a centre of mass at rest.
        out: Written: [0; base torque; joint torques] (6 + n,), Y_SL (6 + n, p), Y_SL^T sigma (p,)
            and P (3, 6 + n).
    """
    V, Vr, Ar = motion[0], motion[1], motion[2]
    K, kappa, period = gains
    u, Y, slope, P = out
    mass = momentum_map(machine, q, V, pi, P)
    if at_rest[0]:
        rest_centre(P, V)
    if at_rest[1]:
        rest_centre(P, Vr)
    _rate_feedback(K, kappa / mass, P, V, Vr, u)
    put(Ar, 0, (0.0, 0.0, 0.0))
    fill_slotine_li(machine, q, V, Vr, Ar, Y)
    for i in range(3):
        total = u[i]
        for j in range(len(pi)):
            total += Y[i, j] * pi[j]
        Ar[i] = -total / mass
    add_uniform_acceleration(machine, get(Ar, 0), Y)
    slope[:] = 0.0
    for i in range(len(u)):
        total, sigma = 0.0, Vr[i] - V[i]
        for j in range(len(pi)):
            total += Y[i, j] * pi[j]
            slope[j] += Y[i, j] * sigma
        u[i] += total
    for i in range(3):
        Vr[i] += period * Ar[i]


@inner
def _rate_feedback(K: Array, rate: float, P: Array, V: Array, Vr: Array, u: Array) -> None:
    """Write u = K_D sigma, K_D = K + rate P^T P."""
    a = (0.0, 0.0, 0.0)
    for j in range(len(u)):
        a = plus(a, times(Vr[j] - V[j], (P[0, j], P[1, j], P[2, j])))
    for i in range(len(u)):
        u[i] = rate * dot((P[0, i], P[1, i], P[2, i]), a)
        for j in range(3, len(u)):
            u[i] += K[i, j] * (Vr[j] - V[j])


@compiled
def into_base(attitude: Array, a: Array) -> tuple[float, float, float]:
    """A vector (3,) of the inertial frame in base coordinates."""
    eps = (-attitude[0], -attitude[1], -attitude[2])
    return turn(eps, attitude[3], 2.0, get(a, 0))
