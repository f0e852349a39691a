"""A comparison: tables and sentences for page and terminal, and the page for a review.

What changed, where that shows, what would have.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

from .. import __version__
from ..diagnosis.answer.words import at
from ..diagnosis.comparison.change_conclusion import Change, Comparison
from ..display import Item, Plot, Report, Section, Table, table_of
from ..formats import number
from . import diagnosis_plots as curves
from .diagnosis_tables import rival_gap, value_cells
from .sentences import COMPARISON, REPEATS, SAID


def summary(comparison: Comparison) -> Iterator[Section]:
    """What is printed for people."""
    yield Section('', [f'verdict: {comparison.verdict}', comparison.sentence])
    if comparison.changes:
        lines = rival_lines(comparison.changes)
        yield Section('changes', [change_table(comparison.changes), *lines])
    title = 'change of one parameter that would have been named'
    yield Section(title, [detectable_table(comparison)])
    left = ', '.join(' '.join(row) for row in _left(comparison))
    repeats = 'repeats of one motion: judged by the scatter between the runs before'
    further = [*[repeats] * comparison.is_repeated, *comparison.notes]
    yield Section('', [f'left unexplained, rms: {left}', *further])


def rival_lines(changes: tuple[Change, ...]) -> list[str]:
    """What these motions can't tell from the changes."""
    return [
        f'{change.effect}{at(change.where)} can not be told from {rival.effect}{at(rival.where)} '
        f'with these motions ({rival_gap(rival)})'
        for change in changes
        for rival in change.indistinguishable_from
    ]


def change_table(changes: tuple[Change, ...]) -> Table:
    """One row a parameter of each change."""
    rows = []
    for change in changes:
        place = change.title, change.where or '', number(change.log_odds, 3)
        for name, found in change.parameters.items():
            rows.append((*place, name, *value_cells(found)))
            place = '', '', ''
    head = ('cause', 'where', 'log odds', 'parameter', 'added', '+- std', 'unit')
    return Table(head, rows)


def detectable_table(comparison: Comparison, caption: str = '') -> Table:
    """The change of each parameter that would have been named."""
    rows = [
        {'d': d, 'value': number(d.value, 2) if math.isfinite(d.value) else 'not seen'}
        for d in comparison.detectable
    ]
    cells = '{d.effect} | {d.where:or } | {d.parameter} | {value} | {d.unit:or 1}'
    return table_of(rows, 'effect | where | parameter | from | unit', cells, caption)


def comparison_page(comparison: Comparison, command: str) -> Report:
    """The report of a comparison.

    Args:
        comparison: What it says.
        command: The command line that asked for it.
    """
    panels = partial(curves.error_panels, comparison.series, ())
    torques = Table(('joint', 'left unexplained, rms', 'unit'), list(_left(comparison)))
    changed: list[Item] = []
    if comparison.changes:
        changed = [change_table(comparison.changes), *rival_lines(comparison.changes)]
    missed = Plot(panels, SAID['missed torques'], height=180)
    how = f'{REPEATS if comparison.is_repeated else COMPARISON} See docs/diagnosis.md.'
    sections: list[tuple[str, list[Item]]] = [
        ('Verdict', [comparison.sentence, *comparison.notes]),
        ('What changed', changed),
        ('Torques that are missed afterwards', [torques, missed]),
        ('What would have been seen', [detectable_table(comparison, SAID['changes'])]),
        ('How it was done', [f'{command}   (spacerobot {__version__})', how]),
    ]
    return Report(
        title=f'Comparison: {comparison.verdict}',
        subtitle=', '.join(comparison.left),
        sections=[Section(title, items) for title, items in sections if items],
    )


def _left(comparison: Comparison) -> Iterator[tuple[str, str, str]]:
    """Each joint with what no cause explains of its torque, and the unit."""
    for joint, rms in comparison.left.items():
        yield joint, number(rms, 3), comparison.units[joint]
