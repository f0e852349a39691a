"""A comparison in tables and sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator

from ..diagnosis.answer.words import at
from ..diagnosis.change_conclusion import Change, Comparison
from ..display import Section, Table, table
from .formats import number, value_with


def summary(comparison: Comparison) -> Iterator[Section]:
    """What is printed for people."""
    yield Section('', [f'verdict: {comparison.verdict}', comparison.sentence])
    if comparison.changes:
        lines = rival_lines(comparison.changes)
        yield Section('changes', [change_table(comparison.changes), *lines])
    yield Section(
        'change of one parameter that would have been named', [detectable_table(comparison)]
    )
    left = ', '.join(f'{joint} {number(rms, 3)}' for joint, rms in comparison.left.items())
    yield Section('', [f'left unexplained, rms [N m]: {left}'])
    if comparison.is_repeated:
        line = 'repeats of one motion: judged by the scatter between the runs before'
        yield Section('', [line])


def rival_lines(changes: tuple[Change, ...]) -> list[str]:
    """What these motions can't tell from the changes."""
    return [
        f'{change.effect}{at(change.where)} can not be told from {rival.effect}{at(rival.where)} '
        f'with these motions (BIC gap {number(rival.bic_gap, 2)})'
        for change in changes
        for rival in change.indistinguishable_from
    ]


def change_table(changes: tuple[Change, ...]) -> Table:
    """One row a parameter of each change."""
    rows: list[tuple[str, ...]] = []
    for change in changes:
        place = change.title, change.where or '', number(change.log_evidence, 3)
        for name, found in change.parameters.items():
            spread = number(found.std, 2)
            value = value_with(found.value, found.std)
            rows.append((*place, name, value, spread, found.unit or '1'))
            place = '', '', ''
    head = ('cause', 'where', 'log evidence', 'parameter', 'added', '+- std', 'unit')
    return Table(head, rows)


def detectable_table(comparison: Comparison, caption: str = '') -> Table:
    """The change of each parameter that would have been named."""
    columns = {
        'effect': lambda d: d.effect,
        'where': lambda d: d.where or '',
        'parameter': lambda d: d.parameter,
        'from': lambda d: number(d.value, 2) if math.isfinite(d.value) else 'not seen',
        'unit': lambda d: d.unit or '1',
    }
    return table(comparison.detectable, columns, caption)
