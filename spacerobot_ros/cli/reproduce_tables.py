"""Tables of `spacerobot reproduce`, the same for the terminal and for the report."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..campaign import paper
from ..campaign.identification import NoiseFreeResult
from ..campaign.monte_carlo import EstimatorScore
from ..campaign.tracking import TrackingRun
from ..campaign.wheel_momentum import TABLE_SCALE, Reproduction
from ..display import Table

_METHODS = {
    'paper': 'least squares (26), as printed',
    'ls': 'least squares, total momentum estimated',
    'recursive': 'the same, recursively',
    'online': 'online (identifier node)',
    'ml': 'maximum likelihood',
    'physical': 'maximum likelihood over bodies',
}
_LAWS = {'corrected': 'corrected', 'no_aam': 'no AAM (37)', 'paper': "paper's (35)"}


def tables(results: Reproduction) -> list[tuple[str, Table]]:
    """Title and table of every experiment."""
    out = [
        ('Minimal sets and condition numbers', _conditions(results.noise_free)),
        ('Identification without noise', _noise_free(results.noise_free)),
    ]
    out += [(f'Table III, axes {axes}', _table_iii(results, axes)) for axes in results.noisy_axes]
    out += [
        ('Estimators against the Cramer-Rao bound', _estimators(results.scores)),
        ('Cramer-Rao bound', _bounds(results)),
        ('Tracking: largest errors over 20 s', _tracking(results.tracking)),
        ('Gains so soft that the error is 8 degrees', _soft(results.soft)),
        ('Tracking with identified parameters', _identified(results)),
    ]
    return out


def _conditions(results: list[NoiseFreeResult]) -> Table:
    rows = []
    for r in results:
        reference = paper.CONDITION_REFERENCE.get((r.axes, r.structure))
        raw, unit = ('-', '-') if reference is None else _texts(getattr(reference, r.start), 4)
        k = '-' if reference is None else str(reference.k)
        own = _texts(r.condition, 4)
        rows.append([r.axes, r.structure, r.start, str(r.k), k, own[0], raw, own[1], unit])
    return Table(
        ['axes', 'set', 'start', 'k', 'ref.', 'cond(A)', 'ref.', 'unit columns', 'ref.'],
        rows,
        f'the paper prints {paper.UNKNOWNS} unknowns (k = {paper.UNKNOWNS - 3}), neither axes nor '
        'condition numbers; ref.: our notes',
    )


def _noise_free(results: list[NoiseFreeResult]) -> Table:
    printed = f'{max(abs(row.exact) for row in paper.TABLE_III):.0e}'
    rows = []
    for r in results:
        wrong = f'{np.nanmedian(np.abs(r.wrong_model_error)):.0f}' if r.start == 'moving' else '-'
        is_printed = r.structure == 'symmetric' and r.start == 'moving'
        worst = [f'{value:.1e}' for value in r.worst]
        rows.append([r.axes, r.structure, r.start, *worst, printed if is_printed else '-', wrong])
    return Table(
        ['axes', 'set', 'start', 'momentum-int.', 'forward-int.', 'paper', 'AAM left out'],
        rows,
        'largest relative error [%]; AAM left out: median error of the base parameters [%]',
    )


def _table_iii(results: Reproduction, axes: str) -> Table:
    exact = results.noise_free_of(axes, 'symmetric', 'moving')
    noisy = results.table_iii(axes)
    methods = ('paper', 'ls', 'online', 'ml')
    rows = []
    for i, row in enumerate(paper.TABLE_III):
        errors = [f'{exact.momentum_error[i]:.0e}', f'{exact.forward_error[i]:.0e}']
        errors += [f'{row.noisy:.2f}', *(f'{noisy[m][i]:.3f}' for m in methods)]
        rows.append([exact.names[i], row.label, f'{row.exact:.0e}', *errors])
    return Table(
        [
            'ours',
            'paper',
            'no noise',
            'mom.-int.',
            'fwd-int.',
            'noise',
            'LS (26)',
            'LS',
            'online',
            'ML',
        ],
        rows,
        'relative errors [%]: the paper\'s "no noise" and "noise", ours beside; noise '
        f"x {TABLE_SCALE:g}, seed 0; from the 4th row on the paper's order is unknown",
    )


def _estimators(scores: list[EstimatorScore]) -> Table:
    rows = []
    for s in scores:
        reference = paper.ESTIMATOR_REFERENCE.get((s.axes, s.scale, s.method))
        wanted = ['-', '-', '-'] if reference is None else _texts(reference, 3)
        chi2 = '-' if s.chi2_per_dof is None else f'{s.chi2_per_dof:.3f}'
        rows.append(
            [
                s.axes,
                f'{s.scale:g}',
                _METHODS[s.method],
                f'{s.aam_over_bound:.3g}',
                wanted[0],
                f'{s.base_over_bound:.3g}',
                wanted[1],
                f'{s.bias_over_rmse:.2f}',
                wanted[2],
                f'{max(s.aam_percent):.2g}',
                chi2,
            ]
        )
    head = ['axes', 'noise', 'method', 'AAM', 'ref.', 'base', 'ref.', '|bias|', 'ref.']
    runs = scores[0].runs if scores else 0
    return Table(
        [*head, 'AAM [%]', 'chi2'],
        rows,
        f'RMSE over the bound (AAM, base parameters), |bias| over RMSE, worst RMSE of the AAM; '
        f'{runs} runs each (1/sqrt(runs) = {1.0 / np.sqrt(max(runs, 1)):.2f}); ref.: 30-50 runs',
    )


def _bounds(results: Reproduction) -> Table:
    rows = []
    for (axes, scale), std in results.bounds.items():
        truth = np.concatenate([paper.TARGET_MOMENTUM, results.base_parameters(axes)])
        percent = 100.0 * std / np.abs(truth)
        aam, base = paper.BOUND_REFERENCE[axes]
        rows.append(
            [
                axes,
                f'{scale:g}',
                *_texts(percent[:3], 3),
                f'{np.median(percent[3:]):.3g}',
                ' '.join(_texts([scale * x for x in aam], 3)),
                f'{scale * base:.3g}',
            ]
        )
    head = ['axes', 'noise', 'h_x', 'h_y', 'h_z', 'base median', 'AAM ref.', 'base ref.']
    return Table(head, rows, 'smallest standard deviation of any unbiased estimate [%]')


def _tracking(runs: list[TrackingRun]) -> Table:
    rows = []
    for r in runs:
        wanted = paper.TRACKING_REFERENCE.get((r.axes, r.plant, r.law, r.bandwidth))
        degrees, metres = ('-', '-') if wanted is None else _texts(wanted, 3)
        rows.append(
            [
                r.axes,
                r.plant,
                _LAWS[r.law],
                f'{r.bandwidth:g}',
                f'{r.max_joint_error_deg:.3g}',
                degrees,
                f'{r.max_end_effector_error:.3g}',
                metres,
            ]
        )
    return Table(
        ['axes', 'plant', 'law', 'rad/s', 'joint [deg]', 'ref.', 'end effector [m]', 'ref.'],
        rows,
        'law evaluated in continuous time; the paper: "almost 8 degrees" and 0.9 m, no gains',
    )


def _soft(runs: list[TrackingRun]) -> Table:
    rows = []
    for r in runs:
        w = r.bandwidth
        gains = [f'{w:.2f}', f'{w**2:.2f}', f'{2 * w:.2f}']
        errors = [f'{r.max_joint_error_deg:.2f}', f'{r.max_end_effector_error:.2f}']
        rows.append([r.axes, r.plant, *gains, *errors])
    return Table(
        ['axes', 'plant', 'rad/s', 'Kp', 'Kd', 'joint [deg]', 'end effector [m]'],
        rows,
        f'law without AAM; the paper: {paper.TRACKING_ERROR_DEG:g} deg and '
        f'{paper.TRACKING_ERROR_M:g} m',
    )


def _identified(results: Reproduction) -> Table:
    rows = []
    for (axes, method), run in results.identified.items():
        unknowing = results.run_of(axes, 'correct', 'no_aam', 1.0)
        found = '-' if run is None else f'{run.max_joint_error_deg:.3g}'
        distance = '-' if run is None else f'{run.max_end_effector_error:.2g}'
        without = f'{unknowing.max_joint_error_deg:.3g}'
        rows.append([axes, _METHODS[method], found, distance, without])
    return Table(
        ['axes', 'identified by', 'joint [deg]', 'end effector [m]', 'no AAM [deg]'],
        rows,
        'corrected law at 1 rad/s, parameters from one record at noise x 1',
    )


def _texts(values: Iterable[float], digits: int) -> list[str]:
    return [f'{float(v):.{digits}g}' for v in values]
