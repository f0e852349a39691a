"""One closed loop of the adaptive-control experiments (law, plant, sensors), and its time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from time import perf_counter_ns
from typing import Any

import numpy as np

from ..control.adaptive.adaptive_settings import AdaptiveSettings
from ..control.adaptive.controller import AdaptiveController
from ..control.adaptive.law_signals import Measured
from ..control.adaptive.regressors import parameter_values
from ..dynamics.equations import Dynamics
from ..dynamics.integrate import hold_step
from ..dynamics.state import State
from ..errors import SimulationDivergedError
from ..model.robot_settings import SensorSettings
from ..types import Array
from .adaptive_scenario import START, harmonic, minisat, orientation, torque_error, wrong_prior
from .description import Record

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


def run_case(case: LoopCase, is_drawn: bool = False) -> Record:
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
        x = hold_step(dynamics, x, u.joints, period, substeps, np.concatenate([zeros, u.base]))


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
