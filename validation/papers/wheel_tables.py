"""Tables and figures of the wheel-momentum experiments, from their results as plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from spacerobot_ros.display import Curve, Panel, Plot, Section, Table, table_of
from spacerobot_ros.types import Array

from ..campaigns import Results, TrialRecord, kinds
from . import paper
from .estimators import true_values

_METHODS = {
    'paper': 'least squares (26), as printed',
    'ls': 'least squares, total momentum estimated',
    'recursive': 'recursive (identifier node)',
    'ml': 'maximum likelihood',
}
_LAWS = {'corrected': 'corrected', 'no_aam': 'no AAM (37)', 'paper': "paper's (35)"}
_JOINTS = ('joint 1', 'joint 2', 'joint 3')


def tables(results: Results) -> list[Table]:
    """Every experiment."""
    return [
        *_without_noise(results['noise_free']),
        *(_table_iii(axes, rows) for axes, rows in results['table_iii'].items()),
        _estimators(results['estimators']),
        _bounds(results['cramer_rao']),
        *_tracking(results),
    ]


def _without_noise(rows: Sequence[TrialRecord]) -> list[Table]:
    conditions = table_of(
        rows,
        'axes | set | start | k | ref. | cond(A) | ref. | unit columns | ref.',
        '{axes} | {structure} | {start} | {k} | {reference[k]} | {condition[raw]:.4g} | '
        '{reference[raw]:.4g} | {condition[unit_columns]:.4g} | {reference[unit_columns]:.4g}',
        f'the paper prints {paper.UNKNOWNS} unknowns (k = {paper.UNKNOWNS - 3}), neither axes nor '
        'condition numbers; ref.: our notes',
        'Minimal sets and condition numbers',
    )
    paper_has = ('symmetric', 'moving')
    errors = table_of(
        [
            {
                **r,
                'printed': paper.LARGEST_EXACT
                * ((r['structure'], r['start']) == paper_has or math.nan),
                'wrong': r['wrong_model_median_error_percent']
                * (r['start'] == 'moving' or math.nan),
            }
            for r in rows
        ],
        'axes | set | start | momentum-int. | forward-int. | paper | AAM left out',
        '{axes} | {structure} | {start} | {max_error_percent[momentum_integrated]:.1e} | '
        '{max_error_percent[forward_integrated]:.1e} | {printed:.0e} | {wrong:.0f}',
        'largest relative error [%]; AAM left out: median error of the base parameters [%]',
        'Identification without noise',
    )
    return [conditions, errors]


def _table_iii(axes: str, rows: Sequence[TrialRecord]) -> Table:
    return table_of(
        rows,
        'ours | paper | no noise | mom.-int. | fwd-int. | noise | LS (26) | LS | recursive | ML',
        '{name} | {paper_label} | {paper_error_percent:.0e} | '
        '{momentum_integrated_percent:.0e} | {forward_integrated_percent:.0e} | '
        '{paper_error_with_noise_percent:.2f} | {with_noise_percent[paper]:.3f} | '
        '{with_noise_percent[ls]:.3f} | {with_noise_percent[recursive]:.3f} | '
        '{with_noise_percent[ml]:.3f}',
        'relative errors [%]: the paper\'s "no noise" and "noise", ours beside; noise '
        f"x {paper.TABLE_SCALE:g}, seed 0; from the 4th row on the paper's order is unknown",
        f'Table III, axes {axes}',
    )


def _estimators(scores: Sequence[TrialRecord]) -> Table:
    runs = scores[0]['runs'] if scores else 0
    return table_of(
        [{**s, 'name': _METHODS[s['method']], 'aam': max(s['aam_rmse_percent'])} for s in scores],
        'axes | noise | method | AAM | base | AAM, linear | ref. | |bias| | ref. | AAM [%] | chi2',
        '{axes} | {noise_scale:g} | {name} | {aam_over_bound:.3g} | {base_over_bound:.3g} | '
        '{aam_over_linear_bound:.3g} | {reference[aam_over_linear_bound]:.3g} | '
        '{bias_over_rmse:.2f} | {reference[bias_over_rmse]:.3g} | {aam:.2g} | {chi2_per_dof:.3f}',
        'RMSE over the bound (AAM, base parameters), of the AAM over the bound of the linear set, '
        f'|bias| over RMSE, worst RMSE of the AAM; {runs} runs each '
        f'(1/sqrt(runs) = {1.0 / np.sqrt(max(runs, 1)):.2f}); ref.: 30-50 runs',
        'Estimators against the Cramer-Rao bound',
    )


def _bounds(bounds: Sequence[TrialRecord]) -> Table:
    rows = []
    for bound in bounds:
        axes, scale = bound['axes'], bound['noise_scale']
        aam, base = paper.BOUND_REFERENCE[axes]
        percent = 100.0 * np.array(bound['std']) / np.abs(true_values(axes))
        wanted = ' '.join(f'{scale * x:.3g}' for x in aam)
        median = float(np.median(percent[3:]))
        rows.append({**bound, 'h': percent, 'median': median, 'aam': wanted, 'base': scale * base})
    return table_of(
        rows,
        'axes | noise | h_x | h_y | h_z | base median | AAM, linear set | base, linear set',
        '{axes} | {noise_scale:g} | {h[0]:.3g} | {h[1]:.3g} | {h[2]:.3g} | {median:.3g} | '
        '{aam} | {base:.3g}',
        'smallest standard deviation of any unbiased estimate of bodies [%]; linear set: our '
        'notes, for numbers that are freer than bodies',
        'Cramer-Rao bound',
    )


def _tracking(results: Results) -> list[Table]:
    known = table_of(
        [{**run, 'name': _LAWS[run['law']]} for run in results['tracking']],
        'axes | plant | law | rad/s | joint [deg] | ref. | end effector [m] | ref.',
        '{axes} | {plant} | {name} | {bandwidth:g} | {max_joint_error_deg:.3g} | '
        '{reference[max_joint_error_deg]:.3g} | {max_end_effector_error_m:.3g} | '
        '{reference[max_end_effector_error_m]:.3g}',
        'law evaluated in continuous time; the paper: "almost 8 degrees" and 0.9 m, no gains',
        'Tracking: largest errors over 20 s',
    )
    soft = table_of(
        [
            {**r, 'Kp': r['bandwidth'] ** 2, 'Kd': 2.0 * r['bandwidth']}
            for r in results['soft_gains']
        ],
        'axes | plant | rad/s | Kp | Kd | joint [deg] | end effector [m]',
        '{axes} | {plant} | {bandwidth:.2f} | {Kp:.2f} | {Kd:.2f} | {max_joint_error_deg:.2f} | '
        '{max_end_effector_error_m:.2f}',
        f'law without AAM; the paper: {paper.TRACKING_ERROR_DEG:g} deg and '
        f'{paper.TRACKING_ERROR_M:g} m',
        f'Gains so soft that the error is {paper.TRACKING_ERROR_DEG:g} degrees',
    )
    without = {
        run['axes']: run['max_joint_error_deg']
        for run in results['tracking']
        if (run['plant'], run['law'], run['bandwidth']) == ('correct', 'no_aam', 1.0)
    }
    nothing = {'max_joint_error_deg': None, 'max_end_effector_error_m': None}
    identified = table_of(
        [
            {**nothing, **r, 'name': _METHODS[r['method']], 'without': without[r['axes']]}
            for r in results['tracking_identified']
        ],
        'axes | identified by | joint [deg] | end effector [m] | no AAM [deg]',
        '{axes} | {name} | {max_joint_error_deg:.3g} | {max_end_effector_error_m:.2g} | '
        '{without:.3g}',
        'corrected law at 1 rad/s, parameters from one record at noise x 1',
        'Tracking with identified parameters',
    )
    return [known, soft, identified]


def drawings(records: Sequence[TrialRecord], results: Results) -> list[Section]:
    """Figures 4 to 7 of the robots of the experiments with noise."""
    out, of = [], kinds(records)
    for axes in results['table_iii']:
        runs = {
            r['law']: {name: np.array(values) for name, values in r['history'].items()}
            for r in of['track']
            if (r['axes'], r['plant'], r['bandwidth']) == (axes, 'correct', 1.0)
        }
        soft = [r for r in of.get('soft', ()) if (r['axes'], r['plant']) == (axes, 'correct')]
        known, unknown = runs['corrected'], runs['no_aam']
        errors = [_errors(known, 'wheels known'), _errors(unknown, 'wheels unknown')]
        captions = {
            'Fig. 4: joint torques and body rate, wheels known (1 rad/s, correct plant).': (
                _motion(known)
            ),
            'Fig. 5: the same, wheels unknown to the law.': _motion(unknown),
            'Fig. 6: joint errors; what is left with the wheels known is the integrator.': errors,
            'Fig. 7: end-effector error, base frame.': [_end_effector(runs, soft)],
        }
        plots = [Plot(panels, caption) for caption, panels in captions.items()]
        out.append(Section(f'Figures 4 to 7, axes {axes}', plots))
    return out


def _motion(run: Mapping[str, Array]) -> list[Panel]:
    return [
        Panel('joint torques', 'N m', _curves(run['time'], run['torque'], _JOINTS)),
        Panel('body rate', 'rad/s', _curves(run['time'], run['omega_WB_B'], ('x', 'y', 'z'))),
    ]


def _errors(run: Mapping[str, Array], what: str) -> Panel:
    degrees = np.abs(np.rad2deg(run['joint_error']))
    return Panel(f'joint errors, {what}', 'deg', _curves(run['time'], degrees, _JOINTS), log=True)


def _end_effector(runs: Mapping[str, Mapping[str, Array]], soft: Sequence[TrialRecord]) -> Panel:
    laws = {'no_aam': 'wheels unknown (37)', 'paper': "paper's law (35)", 'corrected': 'corrected'}
    named = {label: runs[law] for law, label in laws.items()}
    named |= {f'wheels unknown, {r["bandwidth"]:.2f} rad/s': r['history'] for r in soft}
    curves = [
        Curve(label, np.array(h['time']), np.array(h['end_effector_error']))
        for label, h in named.items()
    ]
    return Panel('end-effector error', 'm', curves, log=True)


def _curves(time: Array, values: Array, labels: tuple[str, ...]) -> list[Curve]:
    return [Curve(label, time, values[:, i]) for i, label in enumerate(labels)]
