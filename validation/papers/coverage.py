"""Coverage campaign: do the stated standard deviations hold, over many seeded runs?

Every run identifies one noisy record of the motion of Table II (joints and gyro at all samples,
star tracker at every fifth) from inertial parameters that are up to 50 % wrong, online and by
maximum likelihood.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from spacerobot_ros.types import Array

from ..campaigns import Results, TrialRecord, key
from ..shares import QUANTILE
from .estimators import bound_of, error_figures, estimate, rms, true_values
from .paper import momentum_motion, noisy_record, scenario

METHODS = ('recursive', 'ml')
AXES = ('zyx', 'xyy')  # in turn
_ATTITUDE_EVERY = 5
_PARTS = {'AAM': slice(0, 3), 'parameters': slice(3, None)}

# figures to reach
_FULL = 100  # runs from which on the limits hold as they stand; below, they leave room for chance
_COVERED = (0.95, 0.02, 0.03)  # of 95 % intervals; spread: truth's few, correlated numbers, chance
_OVER_BOUND = {'recursive': 1.3, 'ml': 1.15}  # efficient; the lag of a recursion
_BIAS = 0.3  # over RMSE: 1/sqrt(100) by chance, and what linearization leaves
_CHANCE = 0.2  # of both ratios, at a quarter of the full number of runs


def trials(runs: int, is_quick: bool) -> list[str]:
    """One noisy record each."""
    return [key('coverage', AXES[seed % len(AXES)], seed) for seed in range(runs)]


def run(key: str) -> TrialRecord:
    """Identify one noisy record by every method."""
    _, axes, seed = json.loads(key)
    case = scenario(axes)
    joints, motion = case.robot.joints, momentum_motion(axes)
    record = noisy_record(joints, motion, 1.0, seed, _ATTITUDE_EVERY)
    found = {name: estimate(record, case, 1.0, name) for name in METHODS}
    methods = {
        method: {
            'value': [*e.aam.tolist(), *e.parameters.tolist()],
            **{name: getattr(e, name) for name in ('std', 'chi2_per_dof', 'valid')},
        }
        for method, e in found.items()
    }
    return {'seed': seed, 'axes': axes, 'methods': methods}


def results(records: Sequence[TrialRecord]) -> Results:
    """Every method on every robot.

    Returns:
        As `coverage`, with the number of runs: (3 + k,) `covered`, the share of runs whose 95 %
        interval holds the truth, `over_bound`, RMSE over the Cramer-Rao bound of the linear set,
        and `bias`, |mean error| over RMSE, of [AAM; x]; mean chi2 and share of valid estimates.
    """
    out = []
    for axes in AXES:
        own = [record['methods'] for record in records if record['axes'] == axes]
        if len(own) > 1:
            truth, bound = true_values(axes), bound_of(axes, 1.0, _ATTITUDE_EVERY)
            out += [
                {'axes': axes, 'method': name, **_score([run[name] for run in own], truth, bound)}
                for name in METHODS
            ]
    return {'coverage': out}


def _score(runs: Sequence[TrialRecord], truth: Array, bound: Array) -> TrialRecord:
    values, std = (np.array([run[name] for run in runs]) for name in ('value', 'std'))
    _, over_bound, bias = error_figures(values, truth, bound)
    return {
        'runs': len(runs),
        'covered': np.mean(np.abs(values - truth) <= QUANTILE * std, axis=0),
        'over_bound': over_bound,
        'bias': np.abs(bias),
        'chi2_per_dof': float(np.mean([run['chi2_per_dof'] for run in runs])),
        'valid': float(np.mean([run['valid'] for run in runs])),
    }


def shown(results: Results) -> Results:
    """With means of all components, their least and most."""
    rows = [
        {
            **s,
            'mean': {name: float(np.mean(s['covered'][p])) for name, p in _PARTS.items()},
            'rms': {name: rms(s['over_bound'][p]) for name, p in _PARTS.items()},
            'least': np.min(s['covered']),
            'most': np.max(s['covered']),
            'bias': rms(s['bias']),
            **_limits(s['method'], s['runs']),
        }
        for s in results['coverage']
    ]
    return {'coverage': rows}


def _limits(method: str, runs: int) -> TrialRecord:
    few = max(_FULL**0.5 / runs**0.5 - 1.0, 0.0)
    middle, spread, chance = _COVERED
    spread += chance * few
    return {
        'covered_from': middle - spread,
        'covered_to': min(middle + spread, 1.0),
        'ratio_to': _OVER_BOUND[method] + _CHANCE * few,
        'bias_to': _BIAS + _CHANCE * few,
    }
