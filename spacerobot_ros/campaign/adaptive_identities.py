"""The algebra behind the adaptive laws, measured on random states of the robot."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ..control.adaptive.regressors import Regressors, parameter_values
from ..identification.physical import column_rank
from ..types import Array
from .adaptive_scenario import minisat
from .pinocchio_peer import peer

_STATES = 100
_KNOWN = 1e-9  # of the largest singular value


LIMITS = {
    'rnea': ('Y pi against RNEA', 1e-12, 'N m'),
    'slotine_li': ('Slotine-Li regressor against two calls', 1e-12, ''),
    'coriolis': ('Y_SL pi against M A_r + C V_r', 1e-12, 'N m'),
    'lyapunov': ('Lyapunov identity, random estimates', 1e-11, 'W'),
}
"""What the residuals are, and the largest good ones: rounding of 1e-16 of some 100 N m, summed
over fifty parameters; the Lyapunov identity sums their products with rates."""


def identities(seed: int = 0) -> dict[str, float]:
    """Residuals, largest over random states, and ranks.

    Returns:
        rnea: Y(q, V, V, A) pi against Pinocchio's RNEA.
        slotine_li: Against the two-call recipe on Pinocchio's regressor.
        coriolis: Y_SL pi against M A_r + C V_r with Pinocchio's C.
        lyapunov: d/dt (sigma^T M sigma / 2) against -sigma^T K sigma + sigma^T Y (pi - pi_hat).
        rank: Of Y with ten rows.
        rank_without_force: With the paper's seven.
    """
    robot = minisat()
    model, regressors, pi = peer(robot).model, Regressors(robot), parameter_values(robot)
    data, rng = model.createData(), np.random.default_rng(seed)
    worst, rows = np.zeros(4), []
    for _ in range(_STATES):
        q = rng.uniform(-np.pi, np.pi, 4)
        V, Vr, Ar, A = rng.standard_normal((4, 10))
        q_pin = np.concatenate([np.zeros(6), [1.0], q])
        Y = regressors.slotine_li(q, V, Vr, Ar)
        rows.append(regressors.slotine_li(q, V, V, A))
        M = pin.crba(model, data, q_pin)
        M = np.triu(M) + np.triu(M, 1).T
        C = pin.computeCoriolisMatrix(model, data, q_pin, V)
        twice = two_calls(model, data, q_pin, V, Vr, Ar)
        wrong = pi * (1.0 + 0.4 * rng.standard_normal(len(pi)))
        residuals = [
            np.max(np.abs(rows[-1] @ pi - pin.rnea(model, data, q_pin, V, A))),
            np.max(np.abs(twice - Y)),
            np.max(np.abs(Y @ pi - M @ Ar - C @ Vr)),
            _lyapunov_residual(M, C, (V, Vr, Ar), Y, pi, wrong),
        ]
        worst = np.maximum(worst, residuals)
    whole = np.array(rows)
    return {
        **dict(zip(LIMITS, worst.tolist(), strict=True)),
        'rank': column_rank(whole.reshape(-1, len(pi)), _KNOWN),
        'rank_without_force': column_rank(whole[:, 3:].reshape(-1, len(pi)), _KNOWN),
    }


def two_calls(
    model: pin.Model, data: pin.Data, q_pin: Array, V: Array, Vr: Array, Ar: Array
) -> Array:
    """Slotine-Li regressor from two of Pinocchio's ordinary ones, without gravity.

        Y_SL = 1/4 [Y(q, V + V_r, 2 a) - Y(q, V - V_r, -2 a)],  a = A_r + 1/2 [V_0 x V_r,0; 0]

    The cross product of the base's twists is the Lie bracket of the quasi-velocities: without it
    the polarisation is wrong by as much as the torques themselves.
    """
    a = Ar.copy()
    a[:6] += 0.5 * pin.Motion(V[:6]).cross(pin.Motion(Vr[:6])).vector
    plus = pin.computeJointTorqueRegressor(model, data, q_pin, V + Vr, 2.0 * a).copy()
    minus = pin.computeJointTorqueRegressor(model, data, q_pin, V - Vr, -2.0 * a)
    return np.asarray(0.25 * (plus - minus))


def _lyapunov_residual(
    M: Array, C: Array, moved: tuple[Array, Array, Array], Y: Array, pi: Array, wrong: Array
) -> float:
    """Rate of sigma^T M sigma / 2 along the loop, against what the proof says it is.

    `moved` is velocity, reference velocity and reference acceleration.
    """
    V, Vr, Ar = moved
    sigma, K = Vr - V, 2.0 * M
    u = Y @ wrong + K @ sigma
    A = np.linalg.solve(M, u - C @ V)
    rate = sigma @ M @ (Ar - A) + 0.5 * sigma @ (C + C.T) @ sigma
    claimed = -sigma @ K @ sigma + sigma @ Y @ (pi - wrong)
    return float(abs(rate - claimed))
