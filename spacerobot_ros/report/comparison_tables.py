"""A comparison in tables and sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator

from ..diagnosis.change_conclusion import Change, Comparison
from ..display import Section, Table, table
from .formats import number, value_with


def summary(comparison: Comparison) -> Iterator[Section]:
    """What is printed for people."""
    yield Section('', [f'verdict: {comparison.verdict}', comparison.sentence])
    if comparison.changes:
        yield Section('changes', [_change_table(comparison.changes)])
    yield Section('change of one parameter that would have been named', [_detectable(comparison)])
    left = ', '.join(f'{joint} {number(rms, 3)}' for joint, rms in comparison.left.items())
    yield Section('', [f'left unexplained, rms [N m]: {left}'])
    if comparison.is_repeated:
        line = 'repeats of one motion: judged by the scatter between the runs before'
        yield Section('', [line])


def _change_table(changes: tuple[Change, ...]) -> Table:
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


def _detectable(comparison: Comparison) -> Table:
    columns = {
        'effect': lambda d: d.effect,
        'where': lambda d: d.where or '',
        'parameter': lambda d: d.parameter,
        'from': lambda d: number(d.value, 2) if math.isfinite(d.value) else 'not seen',
        'unit': lambda d: d.unit or '1',
    }
    return table(comparison.detectable, columns)
