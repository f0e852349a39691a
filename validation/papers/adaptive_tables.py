"""Tables and drawings of the adaptive-control experiments, from their results as plain data."""

from __future__ import annotations

from collections.abc import ItemsView, Sequence
from typing import Any

import numpy as np

from spacerobot_ros.display import Curve, Panel, Plot, Section, Table, table_of

from ..campaigns import Results, TrialRecord, grouped
from .adaptive_judge import mean_base_errors, median, or_infinite, select, worst

_PLOTTED = (
    ('adaptive_lyapunov', 'none'),
    ('adaptive_rls_paper', 'none'),
    ('adaptive_rls', 'none'),
    ('adaptive_composite', 'project'),
)


def tables(results: Results) -> list[Table]:
    """Every experiment."""
    return [
        _orientation(results),
        _lambdas(results),
        _harmonic(results, 'iid', 'element-wise'),
        _harmonic(results, 'physical', 'physical'),
        _unmeasured(results),
        _inertia(results),
        _noise(results),
        _sampling(results),
        *_periods_and_times(results),
    ]


def _pair(values: tuple[float, float]) -> str:
    if not np.isfinite(values).all():
        return 'diverges'
    return f'{values[0]:.4f} / {values[1]:.4f}'


def _groups(results: Results, kind: str, parts: slice) -> ItemsView[Any, list[TrialRecord]]:
    """Runs of an experiment by some parts of their keys, in the order of the trials."""
    return grouped(select(results, kind), lambda run: tuple(run['key'][parts])).items()


def _orientation(results: Results) -> Table:
    rows = []
    for (kind, eta), runs in _groups(results, 'orientation', slice(1, 3)):
        settling = [or_infinite(run['settling_s']) for run in runs]
        times = f'{min(settling):.2f} to {max(settling):.2f}'
        last, gone = max(run['final_deg'] for run in runs), sum(run['diverged'] for run in runs)
        rows.append([kind, f'{100 * eta:.0f}', str(len(runs)), times, f'{last:.1e}', str(gone)])
    return Table(
        ['prior', 'error [%]', 'runs', 'below 0.1 deg [s]', 'last error [deg]', 'diverged'],
        rows,
        'wrong parameters alone do not make the loop diverge',
        'Orientation to a set-point, fixed parameters',
    )


def _lambdas(results: Results) -> Table:
    return table_of(
        select(results, 'lambda'),
        'Lambda [1/s] | below 0.1 deg [s] | rebound [deg] | peak torque [N m]',
        '{key[1]:g} | {settling_s:.2f} | {rebound_deg:.3f} | {peak_torque:.2f}',
        'contradicts the paper ("smaller Lambda: faster response and greater overshoot"): the '
        'poles -Lambda and -kappa are real, a larger Lambda is faster and never overshoots until '
        'sampling makes it',
        'Lambda sweep',
    )


def _harmonic(results: Results, kind: str, name: str) -> Table:
    etas = sorted({run['key'][2] for run in select(results, 'harmonic', kind)})
    laws = dict.fromkeys(tuple(run['key'][3:5]) for run in select(results, 'harmonic', kind))
    rows = []
    for law in laws:
        runs = [select(results, 'harmonic', kind, eta, *law) for eta in etas]
        cells = [_pair(figure(own)) for own in runs for figure in (median, worst)]
        share = max(run['indefinite'] for run in runs[-1])
        rows.append([*law, *cells, f'{100 * share:.0f}'])
    floor = _pair(worst(select(results, 'harmonic', 'true', 0.0, 'passivity')))
    figures = [f'{100 * eta:.0f} % {what}' for eta in etas for what in ('median', 'worst')]
    return Table(
        ['law', 'consistency', *figures, 'indefinite [%]'],
        rows,
        'RMS of attitude / joints over the last 20 of 60 s [deg]; true parameters: ' + floor,
        f'Harmonic tracking, {name} priors',
    )


def _unmeasured(results: Results) -> Table:
    return Table(
        ['law', 'median [deg]', 'worst [deg]'],
        [
            [law, _pair(median(runs)), _pair(worst(runs))]
            for (law,), runs in _groups(results, 'unmeasured', slice(1, 2))
        ],
        'the velocity follows from zero momentum; the translation is eliminated to first order',
        'Base velocity not measured, 40 % element-wise priors',
    )


def _inertia(results: Results) -> Table:
    rows = []
    for law in _PLOTTED:
        errors = mean_base_errors(select(results, 'harmonic', 'iid', 0.4, *law))
        rows.append([law[0], *(f'{a:.1f} -> {b:.1f}' for a, b in errors.values())])
    return Table(
        ['law', *errors],
        rows,
        'mean relative error, prior -> after 60 s [%]; the motion is about x alone, so only Ixx '
        "and, with the force rows, the mass can be learnt: the paper's seven rows never see it",
        "Base's inertia, 40 % element-wise priors",
    )


def _noise(results: Results) -> Table:
    rows = []
    for (scale, *law), runs in _groups(results, 'noise', slice(1, 4)):
        error = 100.0 * np.mean([run['torque_error'] for run in runs])
        prior = 100.0 * runs[0]['prior_torque_error']
        rows.append([f'{scale:g}', *law, f'{error:.2f}', f'{prior:.2f}', _pair(median(runs))])
    return Table(
        ['noise x', 'law', 'consistency', 'torque error [%]', 'of the prior', 'RMS [deg]'],
        rows,
        'torque error on motions of their own; x1: gyro 1e-4, joint rates 3.5e-4 rad/s',
        'Noise',
    )


def _sampling(results: Results) -> Table:
    rows = []
    for of, _ in _groups(results, 'sampling', slice(1, 3)):
        cells = {kind: _last(select(results, 'sampling', *of, kind)) for kind in ('true', 'iid')}
        rows.append({'of': of, 'pole': (1.0 + of[1]) * of[0], **cells})
    return table_of(
        rows,
        'period [s] | Lambda [1/s] | (kappa + Lambda) T | true | 40 % priors',
        '{of[0]:g} | {of[1]:g} | {pole:.2f} | {true} | {iid}',
        'largest attitude error of the last 10 s [deg], kappa = 1/s: oscillation and divergence '
        'come from sampling, not from wrong parameters',
        'Sampling limit',
    )


def _last(runs: Sequence[TrialRecord]) -> str:
    last = [run['last_deg'] for run in runs if not run['diverged']]
    text, gone = f'{max(last):.2g}' if last else '-', len(runs) - len(last)
    return f'{text}, {gone} of {len(runs)} diverged' if gone else text


def _periods_and_times(results: Results) -> list[Table]:
    periods = table_of(
        select(results, 'period'),
        'period [s] | attitude RMS [deg] | joints RMS [deg]',
        '{key[1]:g} | {attitude_rms_deg:.5f} | {joint_rms_deg:.5f}',
        title='Floor against the control period, true parameters',
    )
    times = table_of(
        results['cycle_us'],
        'law | consistency | cycle [us]',
        '{law} | {physical_consistency} | {median:.1f}',
        'measurement in, torques out, from Python on one core; the paper: about 100 us in Matlab',
        'Time of a control cycle',
    )
    return [periods, times]


def drawings(records: Sequence[TrialRecord], results: Results) -> list[Section]:
    """Figures 10 to 13 and the base's inertia over time, first prior at the largest error."""
    kept = {tuple(r['key']): r['history'] for r in records if 'history' in r}
    first = {key[3:5]: history for key, history in kept.items() if key[0] == 'harmonic'}
    shown = {
        'fixed': first['passivity', 'none'],
        **{' '.join(law): first[law] for law in _PLOTTED},
    }
    sweep = {f'{key[1]:g}/s': history for key, history in kept.items() if key[0] == 'lambda'}
    eta = next(key[2] for key in kept if key[0] == 'harmonic')
    name = f'{100 * eta:.0f} % element-wise prior, first draw'

    def panel(title: str, unit: str, what: str, of: dict[str, TrialRecord]) -> Panel:
        curves = [Curve(n, np.array(h['time']), np.array(h[what])) for n, h in of.items()]
        return Panel(title, unit, curves, log=unit == 'deg')

    attitude, swept = (panel('attitude error', 'deg', 'attitude', of) for of in (shown, sweep))
    joints = panel('joints', 'deg', 'joints', shown)
    base = [panel(f'base {name}', '%', name, shown) for name in ('Ixx', 'mass')]
    captions = {
        f'Harmonic tracking (Figs 11 and 13), {name}.': [attitude, joints],
        f"Relative error of the base's parameters (Fig. 12), {name}.": base,
        'Set-point with true parameters and different Lambda (Fig. 10).': [swept],
    }
    plots = [Plot(panels, caption) for caption, panels in captions.items()]
    return [Section('Figures', plots)]
