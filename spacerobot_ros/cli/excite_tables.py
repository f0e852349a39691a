"""Rows that `spacerobot excite` prints and reports."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..excitation.limits import Use
    from ..excitation.prediction import Prediction
    from ..excitation.summary import Summary

LIMIT_HEAD = ('limit', 'where', 'reached', 'allowed', 'unit', 'margin')
WHEEL_HEAD = ('own wheels', '|h0| [N m s]', 'common scale', 'worst AAM', 'median x', 'limits')

Rows = list[tuple[str, ...]]


def print_summary(summary: Summary) -> None:
    """Print the tables."""
    from rich.console import Console

    console = Console(highlight=False, width=None if sys.stdout.isatty() else 100)
    omega = ', '.join(f'{w:.4g}' for w in summary.omega)
    tried = ', '.join(f'{a.cost:.4g}' for a in summary.attempts)
    lines = (
        f'{summary.robot}: {summary.criterion}, {summary.structure} structure, '
        f'{summary.manifold} manifold; start {summary.start}, base rate [{omega}] rad/s',
        f'cost of each start: {tried}',
    )
    for line in lines:
        console.print(line, markup=False)
    for title, head, rows in (
        ('limits, the largest use of each', LIMIT_HEAD, limit_rows(summary.uses)),
        ('predicted by the Cramer-Rao bound', *figure_table(summary)),
        ('standard deviations', *std_table(summary)),
        ("servicer's own wheels, the same joint motion", WHEEL_HEAD, wheel_rows(summary)),
    ):
        console.print(title)
        console.print(_table(head, rows))
    console.print(f'advice: {summary.advice}', markup=False)
    for note in summary.notes:
        console.print(f'note: {note}', markup=False)


def limit_rows(uses: Sequence[Use]) -> Rows:
    """One row a limited quantity; `none` where nothing limits it."""
    return [
        (
            use.name.replace('_', ' '),
            use.where,
            f'{use.value:.4g}',
            f'{use.limit:.4g}' if math.isfinite(use.limit) else 'none',
            use.unit,
            f'{100.0 * (1.0 - use.fraction):.2g} %' if math.isfinite(use.limit) else '',
        )
        for use in uses
    ]


def figure_table(summary: Summary) -> tuple[tuple[str, ...], Rows]:
    """Key figures of every prediction: head and rows."""
    columns = _columns(summary)
    head = ('figure', *(name for name, _ in columns))
    rows = [
        ('information [bit]', *(f'{p.bits:.1f}' for _, p in columns)),
        ('directions told', *(f'{p.told} of {p.tellable}' for _, p in columns)),
        ('condition of A', *(f'{p.condition:.4g}' for _, p in columns)),
        ('condition, unit columns', *(f'{p.unit_condition:.4g}' for _, p in columns)),
        ('worst AAM / |h|', *(percent(p.worst_aam) for _, p in columns)),
        ('median parameter', *(percent(p.median_parameter) for _, p in columns)),
        ('worst parameter', *(percent(p.worst_parameter) for _, p in columns)),
        ('common scale', *(percent(p.scale_std) for _, p in columns)),
    ]
    return head, rows


def std_table(summary: Summary) -> tuple[tuple[str, ...], Rows]:
    """Every wheel-momentum component, and the best and worst parameter told: head and rows."""
    columns = _columns(summary)
    design = summary.design
    head = ('unknown', 'value', 'unit', *(f'+- {name}' for name, _ in columns))
    rows = []
    for i, name in enumerate(design.names):
        unit = 'N m s' if i < design.n_aam else 'kg m^2'
        stds = (f'{p.std[i]:.3g}' for _, p in columns)
        rows.append((name, f'{design.values[i]:.5g}', unit, *stds))
    return head, rows


def wheel_rows(summary: Summary) -> Rows:
    """One row a multiple of the own wheels' momentum."""
    rows = []
    for option in summary.wheels:
        p = option.prediction
        size = math.sqrt(float(option.momentum @ option.momentum))
        figures = (percent(v) for v in (p.scale_std, p.worst_aam, p.median_parameter))
        rows.append(
            (
                f'x{option.factor:g}',
                f'{size:.4g}',
                *figures,
                'kept' if option.allowed else 'broken',
            )
        )
    return rows


def percent(value: float) -> str:
    """A relative number in percent; a dash where there is none."""
    return f'{100.0 * value:.3g} %' if math.isfinite(value) else '-'


def _columns(summary: Summary) -> list[tuple[str, Prediction]]:
    named = (
        ('design', summary.design),
        ('with rest', summary.with_rest),
        ("file's own motion", summary.reference),
    )
    return [(name, p) for name, p in named if p is not None]


def _table(head: Sequence[str], rows: Rows) -> object:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for index, title in enumerate(head):
        table.add_column(Text(title), justify='left' if index == 0 else 'right')
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    return table
