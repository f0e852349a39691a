"""Robot, tasks and wrong priors of the adaptive-control experiments (docs/adaptive.md)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..control.adaptive.law_signals import Target
from ..control.adaptive.pseudo_inertia import parameters_of, pseudo_inertia
from ..control.adaptive.regressors import Regressors, parameter_values
from ..model.robot import Robot
from ..types import Array
from .packaged_robots import packaged

START = np.deg2rad([90.0, 45.0, 45.0, 0.0])
GOAL = np.deg2rad([90.0, 55.0, 55.0, 10.0])
ATTITUDE_STEP = np.deg2rad(10.0)
MASS = 36.9  # of the robot [kg]
AMPLITUDE, PULSE = np.deg2rad(10.0), 2.0 * np.pi / 20.0

Task = Callable[[float], Target]
"""Time [s] to the target of the motion."""


def minisat() -> Robot:
    """The mini space robot."""
    return packaged('minisat').robot


def orientation(t: float) -> Target:
    """Set-point: base 10 degrees about x, joints from `START` to `GOAL`."""
    return _about_x(ATTITUDE_STEP, 0.0, 0.0, GOAL, np.zeros(4), np.zeros(4))


def harmonic(t: float) -> Target:
    """Base about x and joints 2 to 4 swing by 10 degrees in 20 s; the robot starts at rest."""
    s, c = AMPLITUDE * np.sin(PULSE * t), AMPLITUDE * np.cos(PULSE * t)
    moves = np.array([0.0, 1.0, 1.0, 1.0])
    q, qd, qdd = START + s * moves, PULSE * c * moves, -(PULSE**2) * s * moves
    return _about_x(s, PULSE * c, -(PULSE**2) * s, q, qd, qdd)


def _about_x(
    angle: float, rate: float, acceleration: float, q: Array, qd: Array, qdd: Array
) -> Target:
    axis = np.array([1.0, 0.0, 0.0])
    attitude = np.array([np.sin(0.5 * angle), 0.0, 0.0, np.cos(0.5 * angle)])
    return Target(attitude, rate * axis, acceleration * axis, q, qd, qdd)


def wrong_prior(kind: str, eta: float, seed: int) -> Robot:
    """The robot with wrong inertial parameters.

    Args:
        kind: `true`; `iid`: every parameter times 1 + eta/3 N(0, 1), eq. (46) of the paper, not
            physical in general; `physical`: P (4, 4) of every body as (1 + E) P (1 + E)^T,
            entries of E being eta/6 N(0, 1).
        eta: Size of the errors.
        seed: Of the draw.
    """
    robot = minisat()
    rows = robot.inertial_parameters
    rng = np.random.default_rng([seed, round(1000 * eta)])
    if kind == 'true':
        return robot
    if kind == 'iid':
        wrong = rows * (1.0 + eta / 3.0 * rng.standard_normal(rows.shape))
        return robot.with_inertial_parameters(wrong)
    E = np.eye(4) + eta / 6.0 * rng.standard_normal((len(rows), 4, 4))
    P = E @ pseudo_inertia(rows) @ np.swapaxes(E, 1, 2)
    return robot.with_inertial_parameters(parameters_of(P))


def torque_error(parameters: Array, seed: int = 5) -> float:
    """Relative error of the torques that parameters (p,) predict on motions of their own.

    Fifty random states within 10 degrees of the start, moving as the harmonic task does (base
    about x, joints 2 to 4), translation free.
    """
    regressors, truth = Regressors(minisat()), parameter_values(minisat())
    rng = np.random.default_rng(seed)
    moves = np.array([3, 7, 8, 9])
    wrong, size = 0.0, 0.0
    for _ in range(50):
        q = START.copy()
        q[1:] += AMPLITUDE * rng.uniform(-1.0, 1.0, 3)
        V, A = np.zeros((2, 10))
        V[moves], A[moves] = PULSE * AMPLITUDE * rng.standard_normal((2, 4))
        V[:3] = -(regressors.momentum(q, V)[0] @ truth)[:3] / MASS
        A[:3] = -(regressors.slotine_li(q, V, V, A) @ truth)[:3] / MASS
        Y = regressors.slotine_li(q, V, V, A)[3:]
        wrong += float(np.sum((Y @ (parameters - truth)) ** 2))
        size += float(np.sum((Y @ truth) ** 2))
    return float(np.sqrt(wrong / size))
