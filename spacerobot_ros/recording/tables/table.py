"""Tables of measured columns, read from CSV, JSON and npz files; numbers are made on use.

A cell that is empty (JSON: null or absent) was not sampled; whether that is allowed is for the
reader of the columns to say. Everything else that is no finite number is refused with its place.
"""

from __future__ import annotations

import csv
import gzip
import json
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import RecordingError
from ...formats import counted
from ...types import Array
from ..npz import read_arrays

FORMATS = ('csv', 'npz', 'json')
_COMPRESSED = '.gz'


@dataclass(frozen=True)
class SampleTable:
    """Columns of a file by name; each a sequence of cells, or an array with one row a sample.

    Args:
        source: The file, for messages.
        columns: Cells of each column; all of one length in CSV and JSON.
        row_name: What a row is called in messages: `line`, `entry` or `row`.
        row_numbers: The place of each row in the file; counted from zero where None.
        notes: What was left out, in words.
    """

    source: str
    columns: Mapping[str, Any]
    row_name: str = 'row'
    row_numbers: tuple[int, ...] | None = None
    notes: tuple[str, ...] = ()

    def row(self, index: int) -> str:
        """The place of a row, such as `run.csv: line 12`."""
        number = self.row_numbers[index] if self.row_numbers else index
        return f'{self.source}: {self.row_name} {number}'

    def numbers(self, name: str) -> Array:
        """A column as numbers, (N, k); NaN where a cell is empty, or all are empty or NaN.

        Raises:
            RecordingError: no such column, or a cell that is no finite number.
        """
        cells = self._cells(name)
        if isinstance(cells, np.ndarray):
            return self._array(name, cells)
        if all(_is_absent(cell) for cell in cells):
            return np.full((len(cells), 1), math.nan)
        values = np.array([[self._number(name, i, cell)] for i, cell in enumerate(cells)])
        return values.reshape(-1, 1)

    def where(self, name: str, wanted: Any) -> SampleTable:
        """Only the rows in which a column of a CSV or JSON file says what is wanted.

        Raises:
            RecordingError: no such column, or no such row.
        """
        cells = self._cells(name)
        kept = [i for i, cell in enumerate(cells) if _same(cell, wanted)]
        if not kept:
            raise RecordingError(self.source, f'no {self.row_name} has {wanted!r} in {name!r}')
        numbers = self.row_numbers or tuple(range(len(cells)))
        columns = {
            key: values[kept] if isinstance(values, np.ndarray) else [values[i] for i in kept]
            for key, values in self.columns.items()
        }
        return replace(self, columns=columns, row_numbers=tuple(numbers[i] for i in kept))

    def with_column(self, name: str, values: Array) -> SampleTable:
        """The same table with one column more, or with other numbers in it.

        Args:
            name: Of the column.
            values: (N, k); NaN for an empty cell.
        """
        cells = [None if math.isnan(v) else v for v in values[:, 0].tolist()]
        return replace(self, columns={**self.columns, name: cells})

    def _cells(self, name: str) -> Any:
        """A column, or an entry of one whose cells are lists, such as `command[2]`."""
        whole, bracket, entry = name.removesuffix(']').rpartition('[')
        if bracket and name not in self.columns and entry.isdecimal() and whole in self.columns:
            return [self._entry(whole, i, int(entry)) for i in range(len(self.columns[whole]))]
        if name not in self.columns:
            known = ', '.join(sorted(self.columns, key=_by_number)) or 'none'
            raise RecordingError(self.source, f'has no column {name!r} (it has {known})')
        return self.columns[name]

    def _entry(self, name: str, index: int, entry: int) -> Any:
        cell = self.columns[name][index]
        try:
            return (json.loads(cell) if isinstance(cell, str) else cell)[entry]
        except (ValueError, TypeError, LookupError):
            raise RecordingError(
                self.row(index), f'column {name!r}: {cell!r} is no list with an entry {entry}'
            ) from None

    def _number(self, name: str, index: int, cell: Any) -> float:
        if cell is None or cell == '':
            return math.nan
        try:
            value = float(cell)
        except (TypeError, ValueError):
            why = f'column {name!r}: {cell!r} is not a number'
            if _is_number(str(cell).replace(',', '.', 1)):
                why += ': write decimals with a point'
            raise RecordingError(self.row(index), why) from None
        if not math.isfinite(value):
            raise RecordingError(self.row(index), f'column {name!r}: {value} is not finite')
        return value

    def _array(self, name: str, cells: Array) -> Array:
        numeric = np.issubdtype(cells.dtype, np.number) and not np.iscomplexobj(cells)
        if not numeric or cells.ndim not in (1, 2):
            raise RecordingError(
                f'{self.source}: {name}',
                f'expected a number, or a row of them, a sample, got {cells.dtype} {cells.shape}',
            )
        values = cells.astype(float).reshape(len(cells), -1)
        bad = ~np.isfinite(values) & ~np.isnan(values).all(axis=0)
        if bad.any():
            index = int(np.argwhere(bad)[0, 0])
            raise RecordingError(self.row(index), f'{name!r} is not finite')
        return values


def _is_absent(cell: Any) -> bool:
    """Whether a cell is empty or NaN: what is logged of a sensor that a joint does not have."""
    return cell is None or str(cell).lower() in ('', 'nan')


def _by_number(name: str) -> tuple[int, str]:
    return (int(name) if name.isdecimal() else -1, name)


def _same(cell: Any, wanted: Any) -> bool:
    """Whether a cell says it, whatever its case: `True`, `true` and JSON's true are one."""
    return str(cell).strip().lower() == str(wanted).lower()


def kind_of(path: Path) -> str:
    """What a file's suffix says that it is, such as `csv` for `run.csv` and `run.CSV.gz`."""
    name = path.name.lower().removesuffix(_COMPRESSED)
    return Path(name).suffix.removeprefix('.')


def read_table(
    path: Path, kind: str, rows: str = '', delimiter: str = ',', header: str = 'names'
) -> SampleTable:
    """Read a table; CSV and JSON may be compressed (`.gz`).

    Args:
        path: The file.
        kind: One of `FORMATS`.
        rows: JSON only: name of the list of samples; empty where the file is that list, or a map
            of columns.
        delimiter: CSV only: between cells; a space: any run of spaces and tabs.
        header: CSV only: `none` where no line names the columns; they are named 0, 1, ... then.

    Raises:
        RecordingError: not readable, not of that format, or without a sample.
    """
    if kind == 'csv':
        return _read_csv(path, delimiter, header)
    return _read_json(path, rows) if kind == 'json' else SampleTable(str(path), read_arrays(path))


def _read_text(path: Path) -> str:
    try:
        if path.name.lower().endswith(_COMPRESSED):
            return gzip.decompress(path.read_bytes()).decode('utf-8-sig')
        return path.read_text(encoding='utf-8-sig')
    except UnicodeDecodeError as error:
        why = f'is not UTF-8 (byte {error.start}): save it as that'
        raise RecordingError(str(path), why) from error
    except (OSError, EOFError, zlib.error) as error:
        reason = getattr(error, 'strerror', None) or str(error)
        raise RecordingError(str(path), f'can not be read: {reason}') from error


def _read_csv(path: Path, delimiter: str, header: str) -> SampleTable:
    text = _read_text(path)
    lines = text.splitlines()
    if delimiter == ' ':
        lines = [' '.join(line.split()) for line in lines]
    reader = csv.reader(lines, delimiter=delimiter, strict=True)
    rows: list[tuple[int, list[str]]] = []
    try:
        for cells in reader:
            stripped = [cell.strip() for cell in cells]
            if any(stripped):
                rows.append((reader.line_num, stripped))
    except csv.Error as error:
        raise RecordingError(f'{path}: line {reader.line_num}', str(error)) from error
    rows = _without_comments(rows, has_names=header != 'none')
    if header == 'none' and rows:
        rows.insert(0, (0, [str(number) for number in range(len(rows[0][1]))]))
    if len(rows) < 2:
        expected = 'numbers' if header == 'none' else 'a line of names, then numbers'
        raise RecordingError(str(path), f'has no sample: expected {expected}')
    (_, names), *samples = rows
    if why := _unlike_names(names):
        raise RecordingError(f'{path}: line {rows[0][0]}', why)
    notes: tuple[str, ...] = ()
    if len(samples) > 1 and len(samples[-1][1]) < len(names) and not text.endswith('\n'):
        line, _ = samples.pop()
        notes = (f'{path.name} ends in the middle of line {line}, which is left out',)
    _check_lengths(path, len(names), samples)
    columns = {name: [cells[i] for _, cells in samples] for i, name in enumerate(names) if name}
    numbers = tuple(line for line, _ in samples)
    return SampleTable(str(path), columns, 'line', numbers, notes)


def _without_comments(
    rows: list[tuple[int, list[str]]], *, has_names: bool
) -> list[tuple[int, list[str]]]:
    """Rows without the first ones that begin with `#`; the last of these may name the columns."""
    first = next((i for i, (_, cells) in enumerate(rows) if not cells[0].startswith('#')), 0)
    if not first:
        return rows
    line, cells = rows[first - 1]
    names = [cells[0].removeprefix('#').strip(), *cells[1:]]
    if names[0] == '':
        names = names[1:]  # as after `# ` where spaces part cells
    is_like = len(names) == len(rows[first][1])
    if has_names and is_like and all(map(_is_number, filter(None, rows[first][1]))):
        return [(line, names), *rows[first:]]
    return rows[first:]


def _check_lengths(path: Path, count: int, samples: list[tuple[int, list[str]]]) -> None:
    for line, cells in samples:
        if len(cells) != count:
            why = f'has {counted(len(cells), "cell")}, expected {count}'
            raise RecordingError(f'{path}: line {line}', why)


def _unlike_names(names: list[str]) -> str:
    """Why cells are no names of columns; empty where they may be."""
    other = next((char for char in ';\t| ' if char in names[0]), '')
    if len(names) == 1 and other:
        return f'is one column: write `delimiter: {other!r}` into the mapping'
    if all(map(_is_number, names)) and not all(name.isdecimal() for name in names):
        return 'holds numbers, no names: write `header: none` into the mapping'
    twice = next((name for name in names if name and names.count(name) > 1), '')
    return twice and f'names column {twice!r} twice'


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _read_json(path: Path, rows: str) -> SampleTable:
    try:
        content = json.loads(_read_text(path))
    except ValueError as error:
        raise RecordingError(str(path), f'not valid JSON: {error}') from error
    if rows:
        if not isinstance(content, Mapping) or rows not in content:
            raise RecordingError(str(path), f'has no entry {rows!r} (`rows` of the mapping)')
        content = content[rows]
    if isinstance(content, Mapping):
        return _json_table(path, content)
    if not isinstance(content, Sequence) or isinstance(content, str) or not content:
        raise RecordingError(f'{path}: {rows}'.rstrip(': '), 'expected a list of samples')
    for i, entry in enumerate(content):
        if not isinstance(entry, Mapping):
            raise RecordingError(f'{path}: entry {i}', f'expected a map of values, got {entry!r}')
    names = dict.fromkeys(name for entry in content for name in entry)
    return _json_table(path, {name: [entry.get(name) for entry in content] for name in names})


def _json_table(path: Path, content: Mapping[str, Any]) -> SampleTable:
    """A map of lists, one a column; rows of numbers become an array, what is no list is left."""
    columns = {
        name: np.array(values, dtype=float) if _is_matrix(values) else values
        for name, values in content.items()
        if isinstance(values, list)
    }
    return SampleTable(str(path), columns, 'entry')


def _is_matrix(values: list[Any]) -> bool:
    if not all(isinstance(row, list) for row in values) or len({len(row) for row in values}) != 1:
        return False
    return all(isinstance(cell, int | float) for row in values for cell in row)
