"""Estimators against the Cramer-Rao bound: seeded runs with noise, the same for every method.

Methods: `paper` (least squares (26) with the momentum of the first sample, as printed), `ls` (the
total momentum estimated as well), `recursive` (the same, block by block), `online` (the identifier
node's recursion), `ml` (maximum likelihood of a whole record) and `physical` (the same over
masses, centres of mass and inertias: the linear set's bound is not its bound). Online, ML and
physical start from inertial parameters that are up to 50 % wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..estimation.reference import Kinematics
from ..identification.batch import identify
from ..identification.cramer_rao import cramer_rao_bound
from ..identification.estimate import Estimate
from ..identification.online import OnlineIdentifier
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..recording.record import Record
from ..types import Array
from .linear_system import linear_system, relative_errors, true_solution
from .noise import noise_of, noisy_record, plan_of
from .scenario import Scenario, cached_motion, scenario

METHODS = ('paper', 'ls', 'recursive', 'online', 'ml', 'physical')
_WRONG = np.array(
    [1.25, 1.5, 0.5, 1.5]
)  # factors on each body's inertial parameters before identification
_SOLVE_PERIOD = 2.0  # s of data between two solutions of the online recursion


@dataclass(frozen=True, slots=True, eq=False)
class NoisyRun:
    """All methods on one noisy record.

    Args:
        axes: Joint axes. scale: Factor on the nominal noise. seed: Of the noise.
        solutions: (3 + k,) [AAM; x] by method.
        estimates: With covariance, by method; not for `paper`.
    """

    axes: str
    scale: float
    seed: int
    solutions: dict[str, Array]
    estimates: dict[str, Estimate]


@dataclass(frozen=True, slots=True, eq=False)
class EstimatorScore:
    """One method at one noise level, over all runs.

    Args:
        axes: Joint axes. scale: Factor on the nominal noise. method: One of `METHODS`.
        runs: Number of runs.
        aam_over_bound: RMSE over Cramer-Rao bound, root mean square over the AAM's components.
        base_over_bound: The same over the base parameters.
        bias_over_rmse: |mean error| over RMSE, root mean square over all; about 1/sqrt(runs) for
            an unbiased method.
        aam_percent: (3,) RMSE of the AAM [%].
        base_percent: Median RMSE of the base parameters [%].
        chi2_per_dof: Mean over the runs; None for `paper`.
    """

    axes: str
    scale: float
    method: str
    runs: int
    aam_over_bound: float
    base_over_bound: float
    bias_over_rmse: float
    aam_percent: Array
    base_percent: float
    chi2_per_dof: float | None


def noisy_run(axes: str, scale: float, seed: int) -> NoisyRun:
    """Run every method on one noisy record."""
    case = scenario(axes)
    record = noisy_record(case.robot.joints, cached_motion(axes), scale, seed)
    believed = wrong_robot(case, scale)
    linear = replace(case.identifier, manifold='linear')
    bodies = replace(case.identifier, manifold='physical')
    estimates = {
        name: identify(record, believed, linear, name) for name in ('ls', 'recursive', 'ml')
    }
    estimates['physical'] = identify(record, believed, bodies, 'ml')
    estimates['online'] = online_estimate(record, believed, linear)
    solutions = {name: np.concatenate([e.aam, e.parameters]) for name, e in estimates.items()}
    solutions['paper'] = linear_system(case.robot, case.minimal, _samples(record)).solve()
    return NoisyRun(axes, scale, seed, solutions, estimates)


def online_estimate(record: Record, believed: Robot, settings: IdentifierSettings) -> Estimate:
    """The identifier node's result after a record; joints and gyro share their stamps."""
    joints, rates, attitudes = record.joints, record.rates, record.attitudes
    if joints is None or rates is None or attitudes is None or joints.velocity is None:
        raise ValueError('the record lacks a sensor')
    identifier = OnlineIdentifier(believed, settings)
    next_solve = _SOLVE_PERIOD
    tracked = dict(zip(attitudes.stamp_ns.tolist(), attitudes.q_xyzw, strict=True))
    for k, stamp in enumerate(joints.stamp_ns.tolist()):
        identifier.add_joints(stamp, joints.position[k], joints.velocity[k])
        identifier.add_rate(stamp, rates.omega[k])
        if stamp in tracked:
            identifier.add_attitude(stamp, tracked[stamp])
        if stamp * 1e-9 >= next_solve:
            identifier.solve()
            next_solve += _SOLVE_PERIOD
    return identifier.solve()


def bound_std(axes: str, scale: float) -> Array:
    """(3 + k,) Cramer-Rao bound of [AAM; x]."""
    case, motion = scenario(axes), cached_motion(axes)
    return cramer_rao_bound(case.robot, case.minimal, motion, plan_of(motion, scale)).std


def score(runs: Sequence[NoisyRun], bound: Array) -> list[EstimatorScore]:
    """Errors of the methods over runs of one robot and noise level, against the bound (3 + k,)."""
    case = scenario(runs[0].axes)
    truth = true_solution(case.robot, case.minimal)
    return [_score(runs, method, bound, truth) for method in METHODS]


def _score(runs: Sequence[NoisyRun], method: str, bound: Array, truth: Array) -> EstimatorScore:
    errors = np.array([run.solutions[method] for run in runs]) - truth
    rmse = np.sqrt(np.mean(errors**2, axis=0))
    percent = np.abs(relative_errors(truth + rmse, truth))
    chi2 = [run.estimates[method].chi2_per_dof for run in runs if method in run.estimates]
    return EstimatorScore(
        axes=runs[0].axes,
        scale=runs[0].scale,
        method=method,
        runs=len(runs),
        aam_over_bound=_rms((rmse / bound)[:3]),
        base_over_bound=_rms((rmse / bound)[3:]),
        bias_over_rmse=_rms(np.mean(errors, axis=0) / rmse),
        aam_percent=percent[:3],
        base_percent=float(np.nanmedian(percent[3:])),
        chi2_per_dof=float(np.mean(chi2)) if chi2 else None,
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def wrong_robot(case: Scenario, scale: float) -> Robot:
    """What is believed before identification: inertial parameters up to 50 % wrong."""
    believed = case.believed.with_inertial_parameters(
        case.believed.inertial_parameters * _WRONG[:, None]
    )
    return replace(believed, sensors=noise_of(scale))


def _samples(record: Record) -> Kinematics:
    """A record whose sensors share their stamps, as plain samples."""
    joints, rates, attitudes = record.joints, record.rates, record.attitudes
    if joints is None or rates is None or attitudes is None or joints.velocity is None:
        raise ValueError('the record lacks a sensor')
    return Kinematics(
        np.asarray(joints.stamp_ns * 1e-9, dtype=float),
        joints.position,
        joints.velocity,
        rates.omega,
        Rotation.from_quat(attitudes.q_xyzw),
    )
