"""Integration that keeps momentum.

`hold_step` advances one control period under held torques by Runge-Kutta steps of order 8,
`simulate_smooth` follows a smooth torque with the same method and error control; both run compiled
stages (`integrate_kernel`). `rk8_step` and `rk4_step` advance any differential equation, for what
is integrated beside the state. The attitude quaternion is integrated by its own rate stage by
stage (one exponential of an averaged rate would be second order, whatever the rest is).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..errors import SimulationDivergedError
from ..types import Array, Vector6
from .equations import Dynamics
from .error_control import SmoothMotion, Torque
from .integrate_kernel import NODES, STAGES, WEIGHTS, held_steps


def rk4_step(rate: Callable[[float, Array], Array], t: float, x: Array, dt: float) -> Array:
    """One classical fourth-order Runge-Kutta step; local error O(dt^5)."""
    k1 = rate(t, x)
    k2 = rate(t + 0.5 * dt, x + 0.5 * dt * k1)
    k3 = rate(t + 0.5 * dt, x + 0.5 * dt * k2)
    k4 = rate(t + dt, x + dt * k3)
    return x + dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)


def rk8_step(rate: Callable[[float, Array], Array], t: float, x: Array, dt: float) -> Array:
    """One step of order 8 (twelve stages, those of `hold_step`); local error O(dt^9)."""
    slopes = np.zeros((STAGES, len(x)))
    for s in range(STAGES):
        slopes[s] = rate(t + NODES[s] * dt, x + dt * (WEIGHTS[s] @ slopes))
    return x + dt * (WEIGHTS[STAGES] @ slopes)


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
    inputs = dynamics.inputs(x, tau, base_wrench)
    dt = period / substeps
    after, is_finite = held_steps(dynamics.machine, *inputs, dt, substeps)
    if not is_finite:
        raise SimulationDivergedError(
            t,
            f'non-finite state after a step of {dt:g} s; largest torque '
            f'{np.max(np.abs(tau)):g} N m',
        )
    return np.asarray(after)


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
    motion = SmoothMotion(dynamics, torque, float(times[0]), x, rtol, atol)
    states = np.empty((len(times), len(x)))
    states[0], done = x, 1
    while done < len(times):
        motion.advance(float(times[-1]))
        reached = int(np.searchsorted(times, motion.t, side='right'))
        if reached > done:
            states[done:reached] = motion.states(times[done:reached])
            done = reached
    states[:, 3:7] /= np.linalg.norm(states[:, 3:7], axis=1, keepdims=True)
    return states


__all__ = ['Torque', 'hold_step', 'rk4_step', 'rk8_step', 'simulate_smooth']
