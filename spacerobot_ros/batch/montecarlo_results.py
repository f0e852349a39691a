"""What the runs of a Monte Carlo campaign come to: percentiles, the worst, what matters."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from ..display import Curve, KeyFigure, KeyFigures, Panel, Plot, Report, Section, Table, table_of
from ..formats import counted
from .montecarlo_trial import LARGEST, RUN, Row
from .ranges import Ranges

PERCENTILES = (0, 1, 5, 25, 50, 75, 95, 99, 100)
_WORST = 10
_FEWEST = 10  # runs of a correlation


def metrics(ranges: Ranges, rows: Sequence[Row]) -> list[str]:
    """Columns that are results."""
    names = dict.fromkeys(name for row in rows for name in row)
    return [n for n in names if n not in (RUN, 'error', *ranges.draw)]


def percentiles(ranges: Ranges, rows: Sequence[Row]) -> list[dict[str, Any]]:
    """One row a result: its percentiles over the runs that ended, and their number."""
    out = []
    for name in metrics(ranges, rows):
        values = [row[name] for row in rows if row.get(name) is not None]
        if values:
            found = np.percentile(values, PERCENTILES).tolist()
            own = {f'p{p}': value for p, value in zip(PERCENTILES, found, strict=True)}
            out.append({'result': name, 'runs': len(values), **own})
    return out


def worst(rows: Sequence[Row]) -> list[Row]:
    """Runs that failed, and those with the largest errors."""

    def rank(row: Row) -> tuple[bool, float, int]:
        is_good = not row.get('error') and row.get(LARGEST) is not None
        return is_good, -row[LARGEST] if is_good else 0.0, row[RUN]

    return sorted(rows, key=rank)[:_WORST]


def correlations(ranges: Ranges, rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Spearman's rank correlation of the largest joint error with what was drawn, best first."""
    good = [row for row in rows if row.get(LARGEST) is not None]
    if len(good) < _FEWEST:
        return []
    errors, out = [row[LARGEST] for row in good], []
    for key in ranges.draw:
        values = [row[key] for row in good]
        if np.ptp(values) > 0.0 and np.ptp(errors) > 0.0:
            found = spearmanr(values, errors)
            out.append({'key': key, 'rho': float(found.statistic), 'p': float(found.pvalue)})
    return sorted(out, key=lambda one: -abs(one['rho']))


def sections(ranges: Ranges, rows: Sequence[Row], replay: Sequence[str]) -> list[Section]:
    """What is shown, in the terminal and on the page.

    Args:
        ranges: What was drawn.
        rows: Of all runs.
        replay: Words of the command that replays a run, whose number comes last.
    """
    failed = [row for row in rows if row.get('error')]
    heads = ' | '.join(['result', 'runs', *(f'{p} %' for p in PERCENTILES)])
    cells = ' | '.join(['{result}', '{runs}', *(f'{{p{p}:.4g}}' for p in PERCENTILES)])
    shares = table_of(percentiles(ranges, rows), heads, cells)
    commands = [
        {'run': row[RUN], 'error': row.get(LARGEST), 'why': row.get('error') or '',
         'command': shlex.join([*replay, str(row[RUN])])}
        for row in worst(rows)
    ]  # fmt: skip
    out = [Section('percentiles over the runs', [shares])]
    if matters := correlations(ranges, rows):
        cells = '{key} | {rho:+.2f} | {p:.2g}'
        title = 'what the largest joint error goes with (Spearman)'
        out.append(Section(title, [table_of(matters, 'drawn | rank correlation | p', cells)]))
    heads = 'run | largest joint error [rad] | why it ended | replay'
    table = table_of(commands, heads, '{run} | {error:.4g} | {why} | {command}')
    out.append(Section('worst runs', [table]))
    out.append(Section('', [f'{counted(len(rows), "run")}, {len(failed)} of them did not end']))
    return out


def montecarlo_page(ranges: Ranges, rows: Sequence[Row], replay: Sequence[str]) -> Report:
    """The report."""
    failed = sum(bool(row.get('error')) for row in rows)
    figures = [
        KeyFigure('runs', str(len(rows))),
        KeyFigure('did not end', str(failed), status='bad' if failed else 'good'),
    ]
    ordered = np.sort([row[LARGEST] for row in rows if row.get(LARGEST) is not None])
    plots = []
    if len(ordered):
        high = float(np.percentile(ordered, 95))
        figures.append(KeyFigure('largest joint error, 95 % of runs below', f'{high:.4g}', 'rad'))
        share = np.arange(1, 1 + len(ordered)) / len(ordered)
        panel = Panel('share of runs below', '1', [Curve('', ordered, share)])
        plots.append(Section('Largest joint error', [Plot([panel], '', LARGEST)]))
    title = 'Monte Carlo of the closed loop'
    subtitle = f'{ranges.robot_path}, {ranges.duration:g} s a run, seed {ranges.seed}'
    first = Section('', [KeyFigures(figures)])
    return Report(title, subtitle, [first, *plots, *sections(ranges, rows, replay)])


def run_table(row: Row) -> Table:
    """One run's values and results."""
    shown = [{'name': name, 'value': value} for name, value in row.items()]
    return table_of(shown, 'what | value', '{name} | {value}')
