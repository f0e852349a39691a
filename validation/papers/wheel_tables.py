"""Tables and figures of the wheel-momentum experiments, from their results as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from spacerobot_ros.display import Curve, Panel, Plot, Section
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


def shown(results: Results) -> Results:
    """With what the tables have beside the results."""
    runs = results['estimators'][0]['runs'] if results['estimators'] else 0
    without = {
        run['axes']: run['max_joint_error_deg']
        for run in results['tracking']
        if (run['plant'], run['law'], run['bandwidth']) == ('correct', 'no_aam', 1.0)
    }
    return {
        **results,
        **{'runs': runs, 'chance': 1.0 / max(runs, 1) ** 0.5},
        'noise_free': [{**r, **_exact(r)} for r in results['noise_free']],
        'estimators': [
            {**s, 'name': _METHODS[s['method']], 'aam': max(s['aam_rmse_percent'])}
            for s in results['estimators']
        ],
        'bounds': [{**b, **_bound(**b)} for b in results['cramer_rao']],
        'tracking': [{**run, 'name': _LAWS[run['law']]} for run in results['tracking']],
        'soft_gains': [
            {**r, 'Kp': r['bandwidth'] ** 2, 'Kd': 2.0 * r['bandwidth']}
            for r in results['soft_gains']
        ],
        'tracking_identified': [
            {
                **dict.fromkeys(paper.TRACKING_ERRORS),
                **r,
                **{'name': _METHODS[r['method']], 'without': without[r['axes']]},
            }
            for r in results['tracking_identified']
        ],
    }


def _exact(r: TrialRecord) -> TrialRecord:
    """The paper's largest error where it has one; ours without the wheels where all move."""
    is_printed = (r['structure'], r['start']) == ('symmetric', 'moving')
    is_wrong, wrong = r['start'] == 'moving', r['wrong_model_median_error_percent']
    return {
        'printed': paper.LARGEST_EXACT if is_printed else None,
        'wrong': wrong if is_wrong else None,
    }


def _bound(axes: str, noise_scale: float, std: Sequence[float]) -> TrialRecord:
    aam, base = paper.BOUND_REFERENCE[axes].values()
    percent = 100.0 * np.array(std) / np.abs(true_values(axes))
    wanted = ' '.join(f'{noise_scale * x:.3g}' for x in aam)
    median = float(np.median(percent[3:]))
    return {'h': percent, 'median': median, 'aam': wanted, 'base': noise_scale * base}


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
