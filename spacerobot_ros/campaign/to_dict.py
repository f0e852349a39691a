"""The results as plain data, for JSON: each figure beside the paper's or our reference."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..json_values import json_value
from . import paper
from .checks import Check
from .identification import NoiseFreeResult
from .monte_carlo import EstimatorScore
from .tracking import TrackingRun
from .wheel_momentum import Reproduction


def to_dict(results: Reproduction, checks: list[Check]) -> dict[str, Any]:
    """Plain data; what is not finite becomes null."""
    out = {
        'schema': 1,
        'experiment': 'wheel-momentum',
        'checks': [{**check._asdict(), 'is_met': check.is_met} for check in checks],
        'noise_free': [_noise_free(result) for result in results.noise_free],
        'table_iii': {axes: _table_iii(results, axes) for axes in results.noisy_axes},
        'cramer_rao': [
            {'axes': axes, 'noise_scale': scale, 'std': std.tolist()}
            for (axes, scale), std in results.bounds.items()
        ],
        'estimators': [_score(s) for s in results.scores],
        'tracking': [_tracking(run) for run in results.tracking],
        'soft_gains': [_tracking(run) for run in results.soft],
        'tracking_identified': [
            {'axes': axes, 'method': method, **({} if run is None else _tracking(run))}
            for (axes, method), run in results.identified.items()
        ],
    }
    return dict(json_value(out))


def _noise_free(result: NoiseFreeResult) -> dict[str, Any]:
    reference = paper.CONDITION_REFERENCE.get((result.axes, result.structure))
    exact, forward = result.worst
    return {
        'axes': result.axes,
        'structure': result.structure,
        'start': result.start,
        'k': result.k,
        'rank_gap': result.rank_gap,
        'condition': {'raw': result.condition[0], 'unit_columns': result.condition[1]},
        'reference': None
        if reference is None
        else {
            'k': reference.k,
            'raw': getattr(reference, result.start)[0],
            'unit_columns': getattr(reference, result.start)[1],
        },
        'max_error_percent': {'momentum_integrated': exact, 'forward_integrated': forward},
        'paper_max_error_percent': max(abs(row.exact) for row in paper.TABLE_III),
        'wrong_model_median_error_percent': float(np.nanmedian(np.abs(result.wrong_model_error))),
    }


def _table_iii(results: Reproduction, axes: str) -> list[dict[str, Any]]:
    exact = results.noise_free_of(axes, 'symmetric', 'moving')
    noisy = results.table_iii(axes)
    return [
        {
            'paper_label': row.label,
            'paper_error_percent': row.exact,
            'paper_error_with_noise_percent': row.noisy,
            'name': exact.names[i],
            'momentum_integrated_percent': float(exact.momentum_error[i]),
            'forward_integrated_percent': float(exact.forward_error[i]),
            'with_noise_percent': {name: float(errors[i]) for name, errors in noisy.items()},
        }
        for i, row in enumerate(paper.TABLE_III)
    ]


def _score(s: EstimatorScore) -> dict[str, Any]:
    reference = paper.ESTIMATOR_REFERENCE.get((s.axes, s.scale, s.method))
    names = ('aam_over_bound', 'base_over_bound', 'bias_over_rmse')
    return {
        'axes': s.axes,
        'noise_scale': s.scale,
        'method': s.method,
        'runs': s.runs,
        **{name: getattr(s, name) for name in names},
        'aam_rmse_percent': s.aam_percent.tolist(),
        'base_rmse_percent': s.base_percent,
        'chi2_per_dof': s.chi2_per_dof,
        'reference': None if reference is None else dict(zip(names, reference, strict=True)),
    }


def _tracking(run: TrackingRun) -> dict[str, Any]:
    key = (run.axes, run.plant, run.law, run.bandwidth)
    reference = paper.TRACKING_REFERENCE.get(key)
    return {
        'axes': run.axes,
        'plant': run.plant,
        'law': run.law,
        'bandwidth': run.bandwidth,
        'max_joint_error_deg': run.max_joint_error_deg,
        'max_end_effector_error_m': run.max_end_effector_error,
        'reference': None
        if reference is None
        else {'max_joint_error_deg': reference[0], 'max_end_effector_error_m': reference[1]},
    }
