"""Coverage campaign: do the stated standard deviations hold, over many seeded runs?

One line of JSON a run in `coverage.jsonl`, written every forty runs: a campaign that was
interrupted goes on from there, and more runs add to those there are. Every run identifies one
noisy record of the motion of Table II (joints and gyro at all samples, star tracker at every
fifth) from inertial parameters that are up to 50 % wrong, online and by maximum likelihood.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import RecordingError
from ..identification.batch import identify
from ..identification.cramer_rao import SensorPlan, cramer_rao_bound
from ..recording.record import AttitudeSeries
from ..types import Array
from .checks import Check
from .linear_system import true_solution
from .monte_carlo import online_estimate, wrong_robot
from .noise import noise_of, noisy_record
from .scenario import cached_motion, scenario
from .tasks import Task, run_tasks

METHODS = ('online', 'ml', 'physical')
AXES = ('zyx', 'xyy')  # in turn
FILE = 'coverage.jsonl'
_ATTITUDE_EVERY = 5
_OVER_BOUND = {'online': 1.3, 'ml': 1.15, 'physical': 1.15}  # largest good values
_CHUNK = 40  # runs between two writes
_QUANTILE = 1.959964  # of 95 % intervals


@dataclass(frozen=True, slots=True, eq=False)
class Coverage:
    """One method on one robot.

    Args:
        axes: Joint axes. method: One of `METHODS`. runs: Number of runs.
        covered: (3 + k,) share of runs whose 95 % interval holds the truth, of [AAM; x].
        over_bound: (3 + k,) RMSE over the Cramer-Rao bound of the linear set.
        bias: (3 + k,) |mean error| over RMSE; about 1/sqrt(runs) without bias.
        chi2_per_dof: Mean. valid: Share of valid estimates.
    """

    axes: str
    method: str
    runs: int
    covered: Array
    over_bound: Array
    bias: Array
    chi2_per_dof: float
    valid: float


def run_campaign(
    folder: Path, runs: int, workers: int, done: Callable[[], None]
) -> list[dict[str, Any]]:
    """Make the runs that are missing in a folder.

    Returns:
        The first `runs` of the campaign.

    Raises:
        RecordingError: the folder's file is not a campaign's.
    """
    path = folder / FILE
    there = read_campaign(path)
    seeds = {run['seed'] for run in there}
    missing = [seed for seed in range(runs) if seed not in seeds]
    for first in range(0, len(missing), _CHUNK):
        chunk = missing[first : first + _CHUNK]
        tasks = [Task(seed, coverage_run, (AXES[seed % len(AXES)], seed)) for seed in chunk]
        there += run_tasks(tasks, workers, done).values()
        partial = path.with_suffix('.partial')
        partial.write_text(''.join(json.dumps(run) + '\n' for run in there), encoding='utf-8')
        partial.replace(path)
    return [run for run in there if run['seed'] < runs]


def read_campaign(path: Path) -> list[dict[str, Any]]:
    """Runs of a campaign, none where it has not begun.

    Raises:
        RecordingError: a line that is no run.
    """
    if not path.exists():
        return []
    lines = path.read_text(encoding='utf-8').splitlines()
    runs = [_run_of(line) for line in lines]
    if None in runs:
        raise RecordingError(f'{path}:{runs.index(None) + 1}', 'is no run of a campaign')
    return [run for run in runs if run is not None]


def _run_of(line: str) -> dict[str, Any] | None:
    """The run that a line holds, None where it holds none."""
    try:
        run = json.loads(line)
        return {name: run[name] for name in ('seed', 'axes', 'methods')}
    except (ValueError, TypeError, KeyError):
        return None


def coverage_run(axes: str, seed: int) -> dict[str, Any]:
    """Identify one noisy record by every method; plain data."""
    case = scenario(axes)
    record = noisy_record(case.robot.joints, cached_motion(axes), 1.0, seed)
    tracker = record.attitudes
    if tracker is not None:
        part = slice(None, None, _ATTITUDE_EVERY)
        tracker = AttitudeSeries(tracker.stamp_ns[part], tracker.q_xyzw[part])
        record = replace(record, attitudes=tracker)
    believed = wrong_robot(case, 1.0)
    linear = replace(case.identifier, manifold='linear')
    bodies = replace(case.identifier, manifold='physical')
    found = {
        'online': online_estimate(record, believed, linear),
        'ml': identify(record, believed, linear),
        'physical': identify(record, believed, bodies),
    }
    methods = {
        name: {
            'value': [*e.aam.tolist(), *e.parameters.tolist()],
            'std': e.std.tolist(),
            'chi2_per_dof': e.chi2_per_dof,
            'valid': e.valid,
        }
        for name, e in found.items()
    }
    return {'seed': seed, 'axes': axes, 'methods': methods}


def score_campaign(runs: Sequence[dict[str, Any]]) -> list[Coverage]:
    """Every method on every robot of the campaign."""
    out = []
    for axes in AXES:
        own = [run['methods'] for run in runs if run['axes'] == axes]
        if len(own) > 1:
            case, bound = scenario(axes), _bound(axes)
            truth = true_solution(case.robot, case.minimal)
            out += [
                _score(axes, name, [run[name] for run in own], truth, bound) for name in METHODS
            ]
    return out


def campaign_checks(scores: Sequence[Coverage]) -> list[Check]:
    """The figures to reach; below a hundred runs each, limits leave room for chance."""
    out = []
    for s in scores:
        what, few = f'{s.axes}, {s.method}', max(10.0 / float(np.sqrt(s.runs)) - 1.0, 0.0)
        spread = 0.02 + 0.03 * few
        for part, name in ((slice(0, 3), 'AAM'), (slice(3, None), 'parameters')):
            covered, ratio = float(np.mean(s.covered[part])), _rms(s.over_bound[part])
            low, high = 0.95 - spread, min(0.95 + spread, 1.0)
            out.append(Check(f'{what}: covered by 95 % intervals, {name}', covered, low, high))
            limit = _OVER_BOUND[s.method] + 0.2 * few
            out.append(Check(f'{what}: RMSE over bound, {name}', ratio, 0.0, limit))
        out.append(Check(f'{what}: chi2 per dof', s.chi2_per_dof, 0.95, 1.05))
        out.append(Check(f'{what}: bias over RMSE', _rms(s.bias), 0.0, 0.3 + 0.2 * few))
        out.append(Check(f'{what}: valid', s.valid, 1.0, 1.0))
    return out


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _score(
    axes: str, method: str, runs: list[dict[str, Any]], truth: Array, bound: Array
) -> Coverage:
    errors = np.array([run['value'] for run in runs]) - truth
    std = np.array([run['std'] for run in runs])
    rmse = np.sqrt(np.mean(errors**2, axis=0))
    return Coverage(
        axes=axes,
        method=method,
        runs=len(runs),
        covered=np.mean(np.abs(errors) <= _QUANTILE * std, axis=0),
        over_bound=rmse / bound,
        bias=np.abs(np.mean(errors, axis=0)) / rmse,
        chi2_per_dof=float(np.mean([run['chi2_per_dof'] for run in runs])),
        valid=float(np.mean([run['valid'] for run in runs])),
    )


def _bound(axes: str) -> Array:
    case, motion, noise = scenario(axes), cached_motion(axes), noise_of(1.0)
    plan = SensorPlan(
        motion.time,
        motion.time,
        motion.time[::_ATTITUDE_EVERY],
        noise.joint_position_std,
        noise.joint_velocity_std,
        noise.gyro_std,
        noise.attitude_std,
    )
    return cramer_rao_bound(case.robot, case.minimal, motion, plan).std
