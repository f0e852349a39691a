"""All experiments of the wheel-momentum paper (validation/results/reproduction.md)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from spacerobot_ros.display import Curve, Panel, Plot, Section
from spacerobot_ros.types import Array

from ..campaigns import Results, TrialRecord, key, kinds, without
from . import paper
from .estimators import bound_of, noise_free, noisy_run, relative_errors, score, true_values
from .paper import SCALES, STARTS
from .tracking import soft_bandwidth, track

AXES = ('zyx', 'xyy')  # with the symmetry of Table I
PLANTS_AND_LAWS = (
    ('correct', 'corrected'),
    ('correct', 'no_aam'),
    ('correct', 'paper'),
    ('paper', 'paper'),
    ('paper', 'no_aam'),
)
_SOFT = (('xyy', 'correct'), ('xyy', 'paper'), ('zyx', 'correct'), ('zyx', 'paper'))

_CONDITION = 0.01  # relative: the reference is printed to three digits
_UNTRACKED = 0.05  # relative: the reference is printed to two or three digits
_OVER_BOUND = {'ml': 1.15, 'recursive': 1.3}  # efficient, and with the lag of a recursion


def trials(runs: int, is_quick: bool) -> list[str]:
    """Noisy records an estimator, level and robot; condition numbers; closed loops."""
    noisy = AXES[:1] if is_quick else AXES
    starts = ('moving', 'spin_up') if is_quick else STARTS
    bandwidths = (1.0,) if is_quick else (0.3, 0.5, 1.0, 2.0)
    of_noise = [(axes, scale) for axes in noisy for scale in SCALES]
    return [
        *(key('noisy', *level, seed) for level in of_noise for seed in range(runs)),
        *(key('soft', *of, paper.TRACKING_ERROR_DEG) for of in _SOFT[: 1 if is_quick else None]),
        *(
            key('noise_free', axes, start, ('symmetric', 'generic'))
            for axes in (AXES if is_quick else (*AXES, 'zyy'))
            for start in starts
        ),
        *(
            key('track', axes, *law, bandwidth)
            for axes in AXES
            for law in PLANTS_AND_LAWS
            for bandwidth in bandwidths
        ),
        *(key('bound', *level) for level in of_noise),
    ]


def run(key: str) -> TrialRecord:
    """One of the experiments."""
    kind, *arguments = json.loads(key)
    return _RUN[kind](*arguments)


_RUN: dict[str, Any] = {
    'noisy': noisy_run,
    'soft': soft_bandwidth,
    'noise_free': lambda *of: {'structures': noise_free(*of)},
    'track': track,
    'bound': lambda axes, x: {'axes': axes, 'noise_scale': x, 'std': bound_of(axes, x)},
}


def results(records: Sequence[TrialRecord]) -> Results:
    """Every figure beside the paper's or our reference."""
    of = kinds(records)
    exact = [r for record in of.get('noise_free', ()) for r in record['structures']]
    noisy, scores = of.get('noisy', []), []
    for bound in of.get('bound', ()):
        level = bound['axes'], bound['noise_scale']
        own = [r for r in noisy if (r['axes'], r['noise_scale']) == level]
        scores += score(own, bound['std'])
    axes = dict.fromkeys(bound['axes'] for bound in of.get('bound', ()))
    return {
        'noise_free': [without(r, 'unknowns') for r in exact],
        'table_iii': {name: _table_iii(name, exact, noisy) for name in axes},
        'cramer_rao': [without(bound, 'case') for bound in of.get('bound', ())],
        'estimators': scores,
        'tracking': [without(r, 'history', 'case') for r in of.get('track', ())],
        'soft_gains': [without(r, 'history', 'case') for r in of.get('soft', ())],
        'tracking_identified': [
            {'axes': r['axes'], 'method': method, **without(tracked or {}, 'history')}
            for r in noisy
            for method, tracked in r['tracking'].items()
        ],
    }


def _table_iii(
    axes: str, exact: Sequence[TrialRecord], noisy: Sequence[TrialRecord]
) -> list[TrialRecord]:
    """Rows of Table III; with noise, the first record at the paper's level."""
    wanted = (axes, 'symmetric', 'moving')
    ours = next(r for r in exact if (r['axes'], r['structure'], r['start']) == wanted)['unknowns']
    first = next(r for r in noisy if (r['axes'], r['noise_scale']) == (axes, paper.TABLE_SCALE))
    truth = true_values(axes)
    errors = {name: relative_errors(x, truth) for name, x in first['solutions'].items()}
    return [
        {
            'paper_label': paper.TABLE_III['label'][i],
            'paper_error_percent': paper.TABLE_III['exact'][i],
            'paper_error_with_noise_percent': paper.TABLE_III['noisy'][i],
            'name': ours['name'][i],
            'momentum_integrated_percent': ours['momentum_integrated'][i],
            'forward_integrated_percent': ours['forward_integrated'][i],
            'with_noise_percent': {name: float(error[i]) for name, error in errors.items()},
        }
        for i in range(paper.UNKNOWNS)
    ]


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
            {**s, **_scored(s), 'name': _METHODS[s['method']], 'aam': max(s['aam_rmse_percent'])}
            for s in results['estimators']
        ],
        'bounds': [{**b, **_bound(**b)} for b in results['cramer_rao']],
        'tracking': [{**r, **_tracked(r), 'name': _LAWS[r['law']]} for r in results['tracking']],
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
    is_moving, wrong = r['start'] == 'moving', r['wrong_model_median_error_percent']
    is_printed = is_moving and r['structure'] == 'symmetric'
    reference = r['reference'] if is_moving and r['reference'] is not None else {}
    return {
        'printed': paper.LARGEST_EXACT if is_printed else None,
        'wrong': wrong if is_moving else None,
        'known': reference.get('k'),
        **_within(reference.get('raw'), _CONDITION),
    }


def _tracked(r: TrialRecord) -> TrialRecord:
    is_corrected = r['law'] == 'corrected'
    is_asked = r['reference'] is not None and r['bandwidth'] == 1.0 and not is_corrected
    wanted = r['reference']['max_joint_error_deg'] if is_asked else None
    return {'is_corrected': is_corrected, **_within(wanted, _UNTRACKED)}


def _within(wanted: float | None, share: float) -> TrialRecord:
    if wanted is None:
        return {'low': None, 'high': None}
    return {'low': (1.0 - share) * wanted, 'high': (1.0 + share) * wanted}


def _scored(s: TrialRecord) -> TrialRecord:
    """With the scatter of a root mean square over few runs of one, common error."""
    limit = _OVER_BOUND.get(s['method'])
    return {'most': limit and limit + 2.0 / (2.0 * s['runs']) ** 0.5}


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
