"""The report of a fleet: what drifts, what appeared when, what could not be read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

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
    machines = counted(len({one['machine'] for one in answers}), 'machine')
    subtitle = f'{counted(len(answers) + len(failures), "recording")} of {machines}'
    figures = Section('', [_figures(answers, failures, lines)])
    return Report(
        title, subtitle, [figures, *_parts(answers, lines), *unreadable(answers, failures)]
    )


def summary(answers: Sequence[Row], failures: Mapping[str, str]) -> Iterator[Section]:
    """What is printed for people."""
    lines = trends(courses(answers))
    drifts = [line for line in lines if line.is_drift]
    yield Section('drifts', [_trend_table(drifts)] if drifts else ['none'])
    appeared = _appearances(answers)
    title = 'causes, and where each appears first'
    yield Section(title, [appeared] if appeared.rows else ['none'])
    yield from unreadable(answers, failures)
    verdicts = Counter(sorted(one['verdict'] for one in answers if not one['error']))
    counts = ', '.join(f'{n} {verdict}' for verdict, n in verdicts.items()) or 'none diagnosed'
    yield Section('', [f'{counted(len(answers) + len(failures), "recording")}: {counts}'])


def unreadable(answers: Sequence[Row], failures: Mapping[str, str]) -> Iterator[Section]:
    """Recordings that could not be used, and those whose diagnosis failed."""
    bad = {one['name']: one['error'] for one in answers if one['error']}
    for what, why in (('Not read', bad), ('Not finished, tried anew by the next run', failures)):
        rows = [{'name': name, 'why': text} for name, text in sorted(why.items())]
        if rows:
            yield Section(what, [table_of(rows, 'recording | why', '{name} | {why}')])


def _figures(answers: Sequence[Row], failures: Mapping[str, str], lines: Sequence[Trend]) -> Item:
    bad = sum(bool(one['error']) for one in answers) + len(failures)
    found = sum(one['verdict'] != 'consistent' for one in answers if not one['error'])
    drifts = sum(line.is_drift for line in lines)
    remark = f'of {counted(len(lines), "trend")}'
    return KeyFigures(
        [
            KeyFigure('recordings', str(len(answers) + len(failures))),
            _best_none('differ from the model', found),
            _best_none('drifts', drifts, remark),
            _best_none('could not be used', bad),
        ]
    )


def _best_none(label: str, count: int, remark: str = '') -> KeyFigure:
    return KeyFigure(label, str(count), '', remark, 'bad' if count else 'good')


def _parts(answers: Sequence[Row], lines: Sequence[Trend]) -> Iterator[Section]:
    drifts = [line for line in lines if line.is_drift]
    _, _, abscissa = in_order(answers)
    caption = f'Values with {_BAND:g} standard deviations, and the line.'
    plots = [Plot([_panel(line)], caption, abscissa) for line in drifts[:_DRAWN]]
    found = [_trend_table(drifts), *plots] if drifts else ['Nothing.']
    yield Section('What drifts', [*found, _HOW])
    yield Section('What appeared when', [_appearances(answers)])
    yield Section('Recordings', [_recordings(answers)])
    if lines:
        caption = f'time: {abscissa}' + f'; the first {_LISTED}' * (len(lines) > _LISTED)
        yield Section('All trends', [_trend_table(lines[:_LISTED], caption)])


def _panel(line: Trend) -> Panel:
    at = line.course
    band = _BAND * at.std if np.all(at.std > 0.0) else None
    curves = [
        Curve('each recording', at.time, at.value, band),
        Curve('trend', at.time, line.fitted),
    ]
    return Panel(f'{at.machine}: {at.quantity}', at.unit, curves)


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
    rows: dict[tuple[str, str], list[tuple[int, Row, Row]]] = {}
    total: Counter[str] = Counter()
    for one in ordered:
        total[one['machine']] += 1
        for cause in one['causes']:
            own = rows.setdefault((one['machine'], cause_name(cause)), [])
            own.append((total[one['machine']], one, cause))
    cells = []
    for (machine, _), seen in sorted(rows.items()):
        (number, first, cause), (_, _, last) = seen[0], seen[-1]
        since = f'{len(seen)} of {total[machine] - number + 1}'
        named = cause['title'], cause['where'] or '', _link(first), first['time'] or ''
        cells.append((machine, *named, since, _values(cause), _values(last)))
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
