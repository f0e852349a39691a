"""Tables and figures to reach of a campaign, as `tables/NAME.yaml` describes them.

A table has a title, a caption, the path of its `rows` in the results and a line for each column:
head, ` | `, format of the cells (`display.table_of`). Rows are a list or a mapping, of which keys
are `of`, and values that are no mappings are `value`; without `rows` the results are one row. A
column `* | {cells}` is all entries of the mapping of that name. With `each`, the path of a
mapping, there is a table for each of its values, which is all that the table sees, its key as
`of`. Titles and captions are formats, too. Texts have `.words` (without underscores), numbers
have `.percent`; a list reads as its items, a mapping as names and counts.

Figures to reach are of rows, too: what it is, path of the value, least and largest good one (or
their paths), unit, and the path of what must be true for it to be asked; a share without trials
and what is no number are not.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spacerobot_ros.display import Section, Table, table_of
from spacerobot_ros.model.files import read_yaml

from .shares import Share


@dataclass(frozen=True, slots=True)
class Check:
    """A figure to reach.

    Args:
        what: The figure.
        value: Reached.
        low: Smallest good value. high: Largest good value.
        unit: Of them.
    """

    what: str
    value: float
    low: float
    high: float
    unit: str = ''

    @property
    def is_met(self) -> bool:
        """Whether the value is within its limits."""
        return self.low <= self.value <= self.high

    def __str__(self) -> str:
        """The figure beside its limits."""
        return f'{self.what}: {self.value:.4g} (wanted: {self.low:g} to {self.high:g} {self.unit})'

    def to_json(self) -> dict[str, Any]:
        """As in the command's JSON."""
        return {**asdict(self), 'is_met': self.is_met}


class _Text(str):
    @property
    def words(self) -> str:
        return self.replace('_', ' ')


class _Number(float):
    @property
    def percent(self) -> float:
        return 100.0 * self


class _Items(list[Any]):
    def __str__(self) -> str:
        return ', '.join(map(str, self)) or '-'


class _Entries(dict[Any, Any]):
    def __str__(self) -> str:
        return ', '.join(f'{str(k).replace("_", " ")} {v}' for k, v in self.items()) or '-'


def _readable(value: Any) -> Any:
    if isinstance(value, Mapping):
        return _Entries({k: _readable(v) for k, v in value.items()})
    if isinstance(value, list | tuple):
        return _Items(map(_readable, value))
    kind = {str: _Text, float: _Number}.get(type(value))
    return kind(value) if kind else value


def tables_of(name: str, results: Mapping[str, Any]) -> list[Table]:
    """All tables of a campaign's results, in the order of its file."""
    path = Path(__file__).parent / 'tables' / f'{name}.yaml'
    seen = _readable(results)
    return [t for entry in read_yaml(path, 'tables')['tables'] for t in _tables(entry, seen)]


def checks_of(name: str, results: Mapping[str, Any]) -> Iterator[Check]:
    """The figures to reach that could be computed, in the order of a campaign's file."""
    path, seen = Path(__file__).parent / 'tables' / f'{name}.yaml', _readable(results)
    for entry in read_yaml(path, 'tables')['checks']:
        listed = (line.split(' | ') for line in entry['figures'].splitlines())
        wanted = [[*own, '', ''][:6] for own in listed]
        for row in _rows(_at(seen, entry['rows']) if 'rows' in entry else [seen]):
            for what, where, low, high, unit, given in wanted:
                value = _at(row, where)
                value = value.value if isinstance(value, Share) else value
                if value is not None and not np.isnan(value) and (not given or _at(row, given)):
                    limits = (_limit(row, text) for text in (low, high))
                    yield Check(_filled(what, row), value, *limits, unit)


def _limit(row: Mapping[str, Any], text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float(_at(row, text))


def _tables(entry: Mapping[str, Any], seen: _Entries) -> Iterator[Table]:
    if 'each' not in entry:
        yield _table(entry, seen)
        return
    for of, own in _at(seen, entry['each']).items():
        own = own if isinstance(own, Mapping) else {'rows': own}
        yield _table(entry, _Entries({'of': of, **own}))


def _table(entry: Mapping[str, Any], seen: _Entries) -> Table:
    rows = list(_rows(_at(seen, entry['rows']) if 'rows' in entry else [seen]))
    columns = [line.split(' | ') for line in entry['columns'].splitlines()]
    if columns[-1][0] == '*':
        name = columns.pop()[1].strip('{}')
        heads = list(rows[0][name]) if rows else []
        columns += [[head, f'{{{name}[{n}]}}'] for n, head in enumerate(heads)]
        rows = [{**row, name: list(row[name].values())} for row in rows]
    heads, cells = (' | '.join(own) for own in zip(*columns, strict=True))
    title, caption = (_filled(entry.get(name, ''), seen) for name in ('title', 'caption'))
    return table_of(rows, heads, cells, caption, title)


def _rows(found: Any) -> Iterator[Mapping[str, Any]]:
    if not isinstance(found, Mapping):
        yield from found
        return
    for of, own in found.items():
        yield {'of': _readable(of), **(own if isinstance(own, Mapping) else {'value': own})}


def _at(seen: Any, path: str) -> Any:
    for name in path.split('.'):
        seen = seen[name]
    return seen


def _filled(text: str, seen: Mapping[str, Any]) -> str:
    return table_of([seen], '', text).rows[0][0]


def markdown(title: str, sections: Iterable[Section]) -> str:
    """A titled page of tables and texts; plots and key figures are left to HTML."""
    return '\n'.join([f'# {title}\n', *(_section(section) for section in sections)])


def _section(section: Section) -> str:
    parts = [f'## {section.title}\n\n']
    for item in section.items:
        if isinstance(item, Table):
            parts += [f'{line}\n\n' for line in (item.title, item.caption) if line]
            parts.append(markdown_table(item))
        elif isinstance(item, str):
            parts.append(f'{item}\n\n')
    return ''.join(parts)


def markdown_table(table: Table) -> str:
    """A table; what would end a cell is escaped."""
    rows = [table.head, ['---'] * len(table.head), *table.rows]
    return ''.join(f'| {" | ".join(_escaped(c) for c in row)} |\n' for row in rows)


def _escaped(text: str) -> str:
    return ' '.join(text.split()).replace('|', '\\|')
