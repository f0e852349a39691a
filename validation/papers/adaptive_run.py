"""One closed loop of the adaptive-control experiments (docs/adaptive.md), and its time.

Robot, tasks and wrong priors; law, plant and sensors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from time import perf_counter_ns
from typing import Any

import numpy as np

from spacerobot_ros.control.adaptive.controller import AdaptiveController
from spacerobot_ros.control.adaptive.law_signals import AdaptiveSettings, Measured, Target
from spacerobot_ros.control.adaptive.regressors import Regressors, parameter_values
from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.integrate import Holding
from spacerobot_ros.dynamics.pseudo_inertia import parameters_of, pseudo_inertia
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.errors import SimulationDivergedError
from spacerobot_ros.model.robot import Robot
from spacerobot_ros.model.robot_settings import SensorSettings
from spacerobot_ros.types import Array

from ..campaigns import TrialRecord
from ..hidden.diagnosis_scenario import packaged

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


TASKS = {'orientation': orientation, 'harmonic': harmonic}
_SUBSTEP = 0.05  # longest Runge-Kutta step [s]
_SETTLED, _LAST = 0.1, 20.0  # deg, s
_BASE = [4, 6, 9, 0]  # Ixx, Iyy, Izz and mass of the base among all parameters
_DIVERGED = np.deg2rad(170.0)  # an error from which on a run counts as diverged [rad]
TIMED = (
    ('passivity', 'none'),
    ('adaptive_lyapunov', 'none'),
    ('adaptive_lyapunov', 'natural'),
    ('adaptive_rls', 'none'),
    ('adaptive_composite', 'project'),
    ('adaptive_lyapunov_paper', 'none'),
    ('adaptive_rls_paper', 'none'),
)
_PERIOD, _CYCLES, _BLOCKS = 0.05, 1000, 5  # of a measurement of the time of a cycle
_NOISY = ('joint_velocity_std', 'gyro_std', 'joint_effort_std')


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopCase:
    """What to run.

    Args:
        task: `orientation` or `harmonic`.
        settings: The law's.
        prior: `true`, `iid` or `physical`.
        eta: Size of its errors.
        seed: Of its draw.
        period: Control period [s].
        duration: [s].
        noise: Factor on the noise of `config/minisat.yaml`.
        noise_seed: Of the noise.
        measures_velocity: Whether the base's velocity is measured.
    """

    task: str
    settings: AdaptiveSettings
    prior: str = 'true'
    eta: float = 0.0
    seed: int = 0
    period: float = 0.05
    duration: float = 60.0
    noise: float = 0.0
    noise_seed: int = 0
    measures_velocity: bool = True


def run_case(case: LoopCase, is_drawn: bool = False) -> TrialRecord:
    """Simulate a case.

    Returns:
        attitude_rms_deg, joint_rms_deg: Root mean squares of the attitude error and of the joint
            errors' norm over the last 20 s.
        settling_s: Time from which on the attitude error stays below 0.1 deg; infinite if it does
            not. rebound_deg: Largest error after it first fell below: overshoot.
        last_deg: Largest attitude error of the last 10 s. final_deg: The last one.
        peak_torque: Largest torque on the base about x [N m].
        indefinite: Part of the steps with parameters of no physical body.
        torque_error: Relative error of the torques that the final parameters predict;
            prior_torque_error: the same of the prior's.
        base_errors: (2, 4) relative errors of the base's Ixx, Iyy, Izz (about its origin) and
            mass, of the prior and at the end.
        diverged: Whether the errors left all bounds.
        history: Where it is drawn, time [s], errors of attitude and joints [deg], of Ixx and mass
            [%].
    """
    prior = wrong_prior(case.prior, case.eta, case.seed)
    noise = {name: case.noise * _std(name) for name in _NOISY} if case.noise else {}
    believed = replace(prior, sensors=SensorSettings(**noise))
    controller = AdaptiveController(believed, case.settings, case.period)
    samples: list[tuple[Any, ...]] = []
    diverged = False
    try:
        for sample in _samples(case, controller):
            samples.append(sample)
            diverged = max(np.max(np.abs(x)) for x in sample[:2]) > _DIVERGED
            if diverged:
                break
    except SimulationDivergedError:
        diverged = True
    attitude, joints, torque, parameters, indefinite = map(np.array, zip(*samples, strict=True))
    time = case.period * np.arange(len(samples), dtype=float)
    error, last = np.rad2deg(attitude), time > time[-1] - _LAST
    base = np.abs(parameters[:, _BASE] / parameter_values(minisat())[_BASE] - 1.0)
    square = np.sum(joints[last] ** 2, axis=1)
    out = {
        'attitude_rms_deg': float(np.rad2deg(np.sqrt(np.mean(attitude[last] ** 2)))),
        'joint_rms_deg': float(np.rad2deg(np.sqrt(np.mean(square)))),
        'settling_s': np.inf if diverged else _settling_time(time, error),
        'rebound_deg': _rebound(error),
        'last_deg': float(np.max(error[time > time[-1] - 0.5 * _LAST])),
        'final_deg': float(error[-1]),
        'peak_torque': float(np.max(np.abs(torque))),
        'indefinite': float(np.mean(indefinite)),
        'torque_error': torque_error(controller.parameters.values),
        'prior_torque_error': torque_error(parameter_values(prior)),
        'base_errors': base[[0, -1]],
        'diverged': bool(diverged),
    }
    if is_drawn:
        drawn = {'attitude': error, 'joints': np.rad2deg(np.linalg.norm(joints, axis=1))}
        shown = {'Ixx': 100.0 * base[:, 0], 'mass': 100.0 * base[:, 3]}
        out['history'] = {'time': time, **drawn, **shown}
    return out


def _settling_time(time: Array, error: Array) -> float:
    outside = np.flatnonzero(error >= _SETTLED)
    if len(outside) and outside[-1] == len(time) - 1:
        return np.inf
    return float(time[outside[-1] + 1]) if len(outside) else 0.0


def _rebound(error: Array) -> float:
    inside = np.flatnonzero(error < _SETTLED)
    return float(np.max(error[inside[0] :])) if len(inside) else float(error[-1])


def _std(name: str) -> float:
    return getattr(minisat().sensors, name) or 0.0


def _samples(case: LoopCase, controller: AdaptiveController) -> Iterator[tuple[Any, ...]]:
    """Attitude and joint errors, torque about x, parameters, whether indefinite, a sample.

    Without the ledger of a `Plant`, whose forces on the base make it six times slower.
    """
    zeros, rng = np.zeros(3), np.random.default_rng(case.noise_seed)
    still = State(zeros, np.array([0.0, 0.0, 0.0, 1.0]), START, zeros, zeros, np.zeros(4))
    substeps = max(1, round(case.period / _SUBSTEP))
    dynamics, x, period = Dynamics(minisat()), still.to_vector(), case.period
    for k in range(round(case.duration / case.period) + 1):
        measured = _measured(case, State.from_vector(x), rng)
        u = controller.step(measured, TASKS[case.task](k * period))
        yield (
            np.linalg.norm(u.attitude_error),
            u.joint_error,
            u.base[0],
            controller.parameters.values[:10].copy(),
            not controller.health.physical,
        )
        x = Holding(dynamics, period, substeps).step(
            x, u.joints, np.concatenate([zeros, u.base]), 0.0
        )


def _measured(case: LoopCase, state: State, rng: np.random.Generator) -> Measured:
    omega, qd = state.omega_WB_B, state.qd
    if case.noise:
        omega = omega + case.noise * _std('gyro_std') * rng.standard_normal(3)
        qd = qd + case.noise * _std('joint_velocity_std') * rng.standard_normal(4)
    v = state.v_WB_B if case.measures_velocity else None
    return Measured(state.q_WB_xyzw, omega, state.q, qd, v)


def cycle_time(law: str, consistency: str) -> float:
    """Time of a cycle [us]: of blocks of a thousand, the quickest block's median."""
    settings = AdaptiveSettings(law=law, physical_consistency=consistency)
    controller = AdaptiveController(minisat(), settings, _PERIOD)
    targets = [harmonic(k * _PERIOD) for k in range(_CYCLES)]
    states = [_on_target(k * _PERIOD) for k in range(_CYCLES)]
    medians = []
    for _ in range(1 + _BLOCKS):  # the first block compiles
        spans = []
        for state, target in zip(states, targets, strict=True):
            started = perf_counter_ns()
            controller.step(state, target)
            spans.append(perf_counter_ns() - started)
        medians.append(float(np.median(spans)))
    return min(medians[1:]) * 1e-3


def _on_target(t: float) -> Measured:
    """A state that lags the harmonic task by a hundredth of a second."""
    late = harmonic(t - 0.01)
    return Measured(late.q_WD_xyzw, late.omega_WD_D, late.q, late.qd, np.zeros(3))
