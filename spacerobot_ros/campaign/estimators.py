"""Estimators on noisy records, the same records for every method, against the Cramer-Rao bound.

Methods: `paper` (least squares (26) with the momentum of the first sample, as printed), `ls` (the
total momentum estimated as well), `recursive` (the same, block by block), `online` (the identifier
node's recursion), `ml` (maximum likelihood of a whole record) and `physical` (the same over
masses, centres of mass and inertias: the linear set's bound is not its bound). Online, ML and
physical start from inertial parameters that are up to 50 % wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..estimation.momentum_process import MomentumModel
from ..identification.batch import identify
from ..identification.cramer_rao import bound_std, information_root
from ..identification.estimate import Estimate
from ..identification.least_squares import sampled_motion
from ..identification.online import OnlineIdentifier
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..recording.record import Record
from ..types import Array
from . import paper
from .linear_system import linear_system, relative_errors, true_solution
from .noisy_records import SCALES, levels_of, noise_of, noisy_record
from .scenario import Scenario, momentum_motion, scenario
from .tracking import track_identified

METHODS = ('paper', 'ls', 'recursive', 'online', 'ml', 'physical')
TRACKED = ('ls', 'online', 'ml')
"""Methods whose estimate of the first record is tracked with."""
_WRONG = np.array(
    [1.25, 1.5, 0.5, 1.5]
)  # factors on each body's inertial parameters before identification
_SOLVE_PERIOD = 2.0  # s of data between two solutions of the online recursion


def noisy_run(axes: str, scale: float, seed: int) -> dict[str, Any]:
    """Run every method on one noisy record; the first at full noise is tracked with, too.

    Returns:
        By method: (3 + k,) solutions [AAM; x] and chi2 per degree of freedom; the tracking runs.
    """
    case = scenario(axes)
    record = noisy_record(case.robot.joints, momentum_motion(axes), scale, seed)
    found = {
        method: estimate(record, case, scale, method) for method in METHODS if method != 'paper'
    }
    solutions = {name: np.concatenate([e.aam, e.parameters]) for name, e in found.items()}
    samples = sampled_motion(record)
    solutions['paper'] = linear_system(case.robot, case.minimal, samples).solve()
    is_tracked = (scale, seed) == (SCALES[0], 0)
    return {
        'axes': axes,
        'noise_scale': scale,
        'seed': seed,
        'solutions': solutions,
        'chi2_per_dof': {name: e.chi2_per_dof for name, e in found.items()},
        'tracking': {m: track_identified(axes, m, found[m]) for m in TRACKED if is_tracked},
    }


def estimate(record: Record, case: Scenario, scale: float, method: str) -> Estimate:
    """What one of `METHODS` finds, from what is believed before identification."""
    rows = case.believed.inertial_parameters * _WRONG[:, None]
    believed = replace(case.believed.with_inertial_parameters(rows), sensors=noise_of(scale))
    is_physical = method == 'physical'
    settings = replace(case.identifier, manifold='physical' if is_physical else 'linear')
    if method == 'online':
        return _online(record, believed, settings)
    return identify(record, believed, settings, 'ml' if is_physical else method)


def _online(record: Record, believed: Robot, settings: IdentifierSettings) -> Estimate:
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


def bound_of(axes: str, scale: float = 1.0, attitude_every: int = 1) -> Array:
    """(3 + k,) Cramer-Rao bound of [AAM; x] for records of `noisy_record`."""
    case = scenario(axes)
    exact = noisy_record(case.robot.joints, momentum_motion(axes), 0.0, 0, attitude_every)
    model = MomentumModel(case.robot, case.minimal)
    return bound_std(information_root(model, exact, levels_of(scale)))


def true_values(axes: str) -> Array:
    """(3 + k,) true [AAM; x] with the symmetry of Table I."""
    case = scenario(axes)
    return true_solution(case.robot, case.minimal)


def error_figures(values: Array, truth: Array, bound: Array) -> tuple[Array, Array, Array]:
    """Errors of runs.

    Args:
        values: (runs, 3 + k).
        truth: (3 + k,).
        bound: (3 + k,) Cramer-Rao.

    Returns:
        (3 + k,) root mean squares, the same over the bound, and mean error over root mean square:
        about 1/sqrt(runs) for an unbiased method.
    """
    errors = values - truth
    rmse = np.sqrt(np.mean(errors**2, axis=0))
    return rmse, rmse / bound, np.mean(errors, axis=0) / rmse


def score(runs: Sequence[dict[str, Any]], bound: Array) -> list[dict[str, Any]]:
    """Every method over the `noisy_run`s of one robot and noise level, against the bound (3 + k,).

    Returns:
        Of each method: root mean squares over the AAM's components and the base parameters of RMSE
        over bound, and of |mean error| over RMSE; RMSE of the AAM and median of the base
        parameters' [%]; mean chi2 per degree of freedom, None for `paper`; the reference.
    """
    axes, scale = runs[0]['axes'], runs[0]['noise_scale']
    truth, out = true_values(axes), []
    for method in METHODS:
        values = np.array([run['solutions'][method] for run in runs])
        rmse, over, bias = error_figures(values, truth, bound)
        percent = np.abs(relative_errors(truth + rmse, truth))
        chi2 = [run['chi2_per_dof'][method] for run in runs if method != 'paper']
        reference = paper.ESTIMATOR_REFERENCE.get((axes, scale, method))
        figures = rms(over[:3]), rms(over[3:]), rms(bias)
        out.append(
            {
                'axes': axes,
                'noise_scale': scale,
                'method': method,
                'runs': len(runs),
                **_named(figures),
                'aam_rmse_percent': percent[:3].tolist(),
                'base_rmse_percent': float(np.nanmedian(percent[3:])),
                'chi2_per_dof': float(np.mean(chi2)) if chi2 else None,
                'reference': reference and _named(reference),
            }
        )
    return out


def _named(figures: tuple[float, float, float]) -> dict[str, float]:
    names = ('aam_over_bound', 'base_over_bound', 'bias_over_rmse')
    return dict(zip(names, figures, strict=True))


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))
