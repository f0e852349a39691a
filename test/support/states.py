"""Random states, and the bridge from the product's state to the oracles' plain motion."""

from __future__ import annotations

import numpy as np

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.integrate import Holding
from spacerobot_ros.dynamics.state import State
from support.models import Motion, quaternion_matrix


def random_state(rng: np.random.Generator, n: int, rate: float = 1.0) -> State:
    """Attitude uniform, joints within 3 rad, rates and velocities N(0, rate^2)."""
    attitude = rng.standard_normal(4)
    return State(
        rng.standard_normal(3),
        attitude / np.linalg.norm(attitude),
        rng.uniform(-3.0, 3.0, n),
        rate * rng.standard_normal(3),
        rate * rng.standard_normal(3),
        rate * rng.standard_normal(n),
    )


def motion_of(state: State, joints: tuple[str, ...]) -> Motion:
    """The same state for the oracles."""
    R = quaternion_matrix(state.q_WB_xyzw)
    return Motion(
        R,
        state.p_WB,
        R @ state.omega_WB_B,
        R @ state.v_WB_B,
        dict(zip(joints, state.q, strict=True)),
        dict(zip(joints, state.qd, strict=True)),
    )


def hold_step(
    dynamics: Dynamics,
    x: np.ndarray,
    tau: np.ndarray,
    period: float,
    substeps: int = 1,
    base_wrench: np.ndarray | None = None,
    t: float = 0.0,
) -> np.ndarray:
    """The state one control period later, the torques held, by DOP853."""
    return Holding(dynamics, period, substeps).step(x, tau, base_wrench, t)
