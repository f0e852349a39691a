"""Integration that keeps momentum.

`hold_step` advances one control period under held torques with classical Runge-Kutta steps; the
attitude quaternion is integrated by its own rate stage by stage (one exponential of an averaged
rate would be second order, whatever the rest is). `simulate_smooth` follows a smooth torque with
error-controlled DOP853.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from ..errors import SimulationDivergedError
from ..types import Array, Vector6
from .equations import Dynamics

Torque = Callable[[float, Array], Array]


def rk4_step(rate: Callable[[float, Array], Array], t: float, x: Array, dt: float) -> Array:
    """One classical fourth-order Runge-Kutta step; local error O(dt^5)."""
    k1 = rate(t, x)
    k2 = rate(t + 0.5 * dt, x + 0.5 * dt * k1)
    k3 = rate(t + 0.5 * dt, x + 0.5 * dt * k2)
    k4 = rate(t + dt, x + dt * k3)
    return x + dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)


def hold_step(
    dynamics: Dynamics,
    x: Array,
    tau: Array,
    period: float,
    substeps: int = 1,
    base_wrench: Vector6 | None = None,
    t: float = 0.0,
) -> Array:
    """Advance the state by one control period with the torques held.

    Args:
        dynamics: Equations of motion.
        x: (13 + 2 n,) state vector.
        tau: (n,) joint torques, constant over the period [N m].
        period: Control period [s].
        substeps: Runge-Kutta steps in the period.
        base_wrench: (6,) held force and torque on the base in base coordinates.
        t: Time at the start [s], for error messages.

    Raises:
        SimulationDivergedError: the new state is not finite.
    """
    dt = period / substeps
    for _ in range(substeps):
        x = rk4_step(lambda _, y: dynamics.rate(y, tau, base_wrench), t, x, dt)
        x[3:7] /= np.linalg.norm(x[3:7])
    if not np.all(np.isfinite(x)):
        raise SimulationDivergedError(
            t,
            f'non-finite state after a step of {dt:g} s; largest torque '
            f'{np.max(np.abs(tau)):g} N m',
        )
    return x


def simulate_smooth(
    dynamics: Dynamics,
    x: Array,
    torque: Torque,
    times: Array,
    rtol: float = 1e-13,
    atol: float = 1e-15,
) -> Array:
    """Follow a smooth joint torque with error-controlled DOP853.

    Args:
        dynamics: Equations of motion.
        x: (13 + 2 n,) state at `times[0]`.
        torque: Joint torques (n,) from time and state vector [N m].
        times: (m,) increasing output times [s].
        rtol: Relative tolerance a step.
        atol: Absolute tolerance a step.

    Returns:
        (m, 13 + 2 n) states at `times`, quaternions normalised.

    Raises:
        SimulationDivergedError: the integrator gave up.
    """
    solution = solve_ivp(
        lambda t, y: dynamics.rate(y, torque(t, y)),
        (times[0], times[-1]),
        x,
        method='DOP853',
        t_eval=times,
        rtol=rtol,
        atol=atol,
    )
    if not solution.success or not np.all(np.isfinite(solution.y)):
        reached = float(solution.t[-1]) if len(solution.t) else float(times[0])
        raise SimulationDivergedError(reached, str(solution.message))
    states = solution.y.T.copy()
    states[:, 3:7] /= np.linalg.norm(states[:, 3:7], axis=1, keepdims=True)
    return states
