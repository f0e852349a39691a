"""The report of a fleet: what drifts, what appeared when, what could not be read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from ..diagnosis.quality.excited import TOLD
from ..display import (
    Curve,
    Item,
    KeyFigure,
    KeyFigures,
    PageLink,
    Panel,
    Plot,
    Report,
    Section,
    Table,
    table_of,
)
from ..formats import counted, number, probability, value_with
from .fleet_table import FEWEST, SIGNIFICANT, Trend, cause_name, courses, in_order, trends
from .runner import TrialRecord as Row

_BAND = 3.0  # standard deviations
_DRAWN, _LISTED = 12, 40  # trends
_HOW = (
    f'A trend is a straight line through at least {FEWEST} values of one machine, weighted by '
    'their standard deviations, which are widened as far as the values scatter; it is a drift '
    f'where fewer than {SIGNIFICANT:.0%} of reports without a drift would have one like it.'
)
_TOLD = (
    'told: of the numbers of all causes, how many show in this recording were they of plausible '
    f'size ({TOLD:g} standard deviations). A verdict says nothing of the others: a machine that '
    'held still may be consistent and worn.'
)


def fleet_page(title: str, answers: Sequence[Row], failures: Mapping[str, str]) -> Report:
    """The page.

    Args:
        title: Of the page.
        answers: What was found of every recording.
        failures: Recordings whose diagnosis failed, and why.
    """
    lines = trends(courses(answers))
    machines = {one['machine'] for one in answers}
    count = counted(len(answers) + len(failures), 'recording')
    subtitle = f'{count} of {counted(len(machines), "machine")}'
    figures = Section('', [_figures(answers, failures, lines)])
    parts = [figures, *_parts(answers, lines), *unreadable(answers, failures)]
    return Report(title, subtitle, parts)


def summary(answers: Sequence[Row], failures: Mapping[str, str]) -> Iterator[Section]:
    """What is printed for people."""
    lines = trends(courses(answers))
    drifts = [line for line in lines if line.is_drift]
    yield Section('drifts', [_trend_table(drifts)] if drifts else ['none'])
    appeared = _appearances(answers)
    title = 'causes, and where each appears first'
    yield Section(title, [appeared] if appeared.rows else ['none'])
    yield from unreadable(answers, failures)
    counts = ', '.join(f'{n} {verdict}' for verdict, n in _verdicts(answers).items())
    yield Section(
        '', [f'{counted(len(answers) + len(failures), "recording")}: {counts or "none diagnosed"}']
    )


def unreadable(answers: Sequence[Row], failures: Mapping[str, str]) -> Iterator[Section]:
    """Recordings that could not be used, and those whose diagnosis failed."""
    bad = {one['name']: one['error'] for one in answers if one['error']}
    for what, why in (('Not read', bad), ('Not finished, tried anew by the next run', failures)):
        rows = [{'name': name, 'why': text} for name, text in sorted(why.items())]
        if rows:
            yield Section(what, [table_of(rows, 'recording | why', '{name} | {why}')])


def _verdicts(answers: Sequence[Row]) -> dict[str, int]:
    found = sorted(one['verdict'] for one in answers if not one['error'])
    return {verdict: len(list(same)) for verdict, same in groupby(found)}


def _figures(answers: Sequence[Row], failures: Mapping[str, str], lines: Sequence[Trend]) -> Item:
    bad = sum(bool(one['error']) for one in answers) + len(failures)
    found = sum(one['verdict'] != 'consistent' for one in answers if not one['error'])
    drifts = sum(line.is_drift for line in lines)
    return KeyFigures(
        [
            KeyFigure('recordings', str(len(answers) + len(failures))),
            KeyFigure('differ from the model', str(found), status='bad' if found else 'good'),
            KeyFigure('drifts', str(drifts), remark=f'of {counted(len(lines), "trend")}',
                      status='bad' if drifts else 'good'),
            KeyFigure('could not be used', str(bad), status='bad' if bad else 'good'),
        ]
    )  # fmt: skip


def _parts(answers: Sequence[Row], lines: Sequence[Trend]) -> Iterator[Section]:
    drifts = [line for line in lines if line.is_drift]
    _, _, abscissa = in_order(answers)
    yield Section('What drifts', [*_drifts(drifts, abscissa), _HOW])
    yield Section('What appeared when', [_appearances(answers)])
    yield Section('Recordings', [_recordings(answers)])
    if lines:
        caption = f'time: {abscissa}' + f'; the first {_LISTED}' * (len(lines) > _LISTED)
        yield Section('All trends', [_trend_table(lines[:_LISTED], caption)])


def _drifts(drifts: Sequence[Trend], abscissa: str) -> Iterator[Item]:
    if not drifts:
        yield 'Nothing.'
        return
    yield _trend_table(drifts)
    for line in drifts[:_DRAWN]:
        yield Plot(
            [_panel(line)], f'Values with {_BAND:g} standard deviations, and the line.', abscissa
        )


def _panel(line: Trend) -> Panel:
    h = line.course
    band = _BAND * h.std if np.all(h.std > 0.0) else None
    mean = np.mean(h.time) if band is None else np.average(h.time, weights=h.std**-2.0)
    fitted = line.level + line.slope * (h.time - mean)
    curves = [Curve('each recording', h.time, h.value, band), Curve('trend', h.time, fitted)]
    return Panel(f'{h.machine}: {h.quantity}', h.unit, curves)


def _trend_table(lines: Sequence[Trend], caption: str = '') -> Table:
    rows = []
    for line in lines:
        at, ends = line.course, (number(line.course.value[0]), number(line.course.value[-1]))
        slope = value_with(line.slope, line.std), number(line.std, 2), probability(line.p_value)
        drift = 'yes' if line.is_drift else ''
        rows.append((at.machine, at.quantity, str(len(at.time)), *ends, at.unit, *slope, drift))
    head = 'machine | quantity | recordings | first | last | unit | by a unit of time | +- std | p'
    return Table((*head.split(' | '), 'drift'), rows, caption)


def _appearances(answers: Sequence[Row]) -> Table:
    """One row a cause of a machine."""
    ordered, _, _ = in_order(answers)
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    total: dict[str, int] = {}
    for one in ordered:
        machine = one['machine']
        total[machine] = total.get(machine, 0) + 1
        for cause in one['causes']:
            new = {'first': one, 'number': total[machine], 'count': 0, 'cause': cause}
            row = rows.setdefault((machine, cause_name(cause)), new)
            row['count'] += 1
            row['last'] = cause
    cells = [
        (
            machine,
            row['cause']['title'],
            row['cause']['where'] or '',
            _link(row['first']),
            row['first']['time'] or '',
            f'{row["count"]} of {total[machine] - row["number"] + 1}',
            _values(row['cause']),
            _values(row['last']),
        )
        for (machine, _), row in sorted(rows.items())
    ]
    head = ('machine', 'cause', 'where', 'first recording', 'time', 'since then in')
    return Table((*head, 'there', 'last'), cells)


def _values(cause: Row) -> str:
    return ', '.join(
        f'{name} {value_with(p["value"], p["std"])} +- {number(p["std"], 2)} {p["unit"] or ""}'
        for name, p in cause['parameters'].items()
    )


def _recordings(answers: Sequence[Row]) -> Table:
    rows = [
        (
            one['machine'],
            _link(one),
            one['time'] or '',
            number(one['duration']),
            one['verdict'],
            '; '.join(map(cause_name, one['causes'])),
            '; '.join(one['health']) or 'good',
            '-' if one.get('told') is None else f'{one["told"]} of {one["numbers"]}',
        )
        for one in in_order(answers)[0]
    ]
    head = ('machine', 'recording', 'time', 'duration [s]', 'verdict', 'causes', 'health', 'told')
    return Table(head, rows, _TOLD)


def _link(one: Row) -> str:
    return PageLink(one['name'], one['report']) if one.get('report') else one['name']
