"""Tables and drawings of the adaptive-control experiments, from their results as plain data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from spacerobot_ros.display import Curve, Panel, Plot, Section

from ..campaigns import Results, TrialRecord, grouped
from .adaptive_judge import mean_base_errors, median, or_infinite, select, worst

_PLOTTED = (
    ('adaptive_lyapunov', 'none'),
    ('adaptive_rls_paper', 'none'),
    ('adaptive_rls', 'none'),
    ('adaptive_composite', 'project'),
)


def shown(results: Results) -> Results:
    """With rows of the tables, one a group of runs."""
    true = worst(select(results, 'harmonic', 'true', 0.0, 'passivity'))
    kinds = {'element-wise': 'iid', 'physical': 'physical'}
    harmonic = {name: _harmonic(results, kind) for name, kind in kinds.items()}
    return {
        **results,
        **{kind: select(results, kind) for kind in ('lambda', 'period')},
        'orientation': _rows(results, 'orientation', slice(1, 3), _orientation),
        'harmonic': {n: {'floor': _pair(true), 'rows': rows} for n, rows in harmonic.items()},
        'unmeasured': _rows(results, 'unmeasured', slice(1, 2), _spread),
        'inertia': {law[0]: {'cells': _inertia(results, law)} for law in _PLOTTED},
        'noise': _rows(results, 'noise', slice(1, 4), _noise),
        'sampling': [
            {'of': of, 'pole': (1.0 + of[1]) * of[0]}
            | {k: _last(select(results, 'sampling', *of, k)) for k in ('true', 'iid')}
            for of in _groups(results, 'sampling', slice(1, 3))
        ],
    }


def _groups(results: Results, kind: str, parts: slice) -> dict[Any, list[TrialRecord]]:
    """Runs of an experiment by some parts of their keys, in the order of the trials."""
    return grouped(select(results, kind), lambda run: tuple(run['key'][parts]))


def _rows(
    results: Results, kind: str, parts: slice, row: Callable[[list[TrialRecord]], TrialRecord]
) -> list[TrialRecord]:
    return [{'of': of, **row(runs)} for of, runs in _groups(results, kind, parts).items()]


def _pair(values: tuple[float, float]) -> str:
    if not np.isfinite(values).all():
        return 'diverges'
    return f'{values[0]:.4f} / {values[1]:.4f}'


def _spread(runs: list[TrialRecord]) -> TrialRecord:
    return {'median': _pair(median(runs)), 'worst': _pair(worst(runs))}


def _orientation(runs: list[TrialRecord]) -> TrialRecord:
    settling = [or_infinite(run['settling_s']) for run in runs]
    return {
        'runs': len(runs),
        **{'least': f'{min(settling):.2f}', 'most': f'{max(settling):.2f}'},
        'last': max(run['final_deg'] for run in runs),
        'diverged': sum(run['diverged'] for run in runs),
    }


def _harmonic(results: Results, kind: str) -> list[TrialRecord]:
    etas = sorted({run['key'][2] for run in select(results, 'harmonic', kind)})
    rows = []
    for law in _groups({'runs': select(results, 'harmonic', kind)}, 'harmonic', slice(3, 5)):
        of = {eta: select(results, 'harmonic', kind, eta, *law) for eta in etas}
        cells = {
            f'{100 * eta:.0f} % {what}': pair
            for eta, runs in of.items()
            for what, pair in _spread(runs).items()
        }
        share = max(run['indefinite'] for run in of[etas[-1]])
        rows.append({'of': law, 'cells': {**cells, 'indefinite [%]': f'{100 * share:.0f}'}})
    return rows


def _inertia(results: Results, law: tuple[str, str]) -> TrialRecord:
    errors = mean_base_errors(select(results, 'harmonic', 'iid', 0.4, *law))
    return {name: f'{a:.1f} -> {b:.1f}' for name, (a, b) in errors.items()}


def _noise(runs: list[TrialRecord]) -> TrialRecord:
    error = float(np.mean([run['torque_error'] for run in runs]))
    return {'error': error, 'prior': runs[0]['prior_torque_error'], **_spread(runs)}


def _last(runs: Sequence[TrialRecord]) -> str:
    last = [run['last_deg'] for run in runs if not run['diverged']]
    text, gone = f'{max(last):.2g}' if last else '-', len(runs) - len(last)
    return f'{text}, {gone} of {len(runs)} diverged' if gone else text


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
