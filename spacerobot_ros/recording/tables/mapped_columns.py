"""Columns of a table by their mapping: SI values, and the stamps of the rows that were sampled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordingError
from ...formats import counted
from ...types import Array, IntArray
from ..faults.gaps import continued
from ..messages import LARGEST
from ..record import shown, to_stamps
from .mapping import ColumnMapping, MappedColumns
from .sample_clock import parted, rebuilt
from .table import SampleTable
from .units import TIME, si_size

T = TypeVar('T')
_ROW = 'row'
"""Its number from 0, as the time of a log of a fixed rate that has no clock."""


class ColumnReader:
    """Reads columns of one table; collects what is worth a note.

    Args:
        table: The table.
        mapping: Where the sensors stand in it.
        is_joined: Whether its clock may begin anew, with another run.
    """

    def __init__(self, table: SampleTable, mapping: ColumnMapping, is_joined: bool) -> None:
        self.table, self.mapping, self._is_joined = table, mapping, is_joined
        self.notes = [f'columns by {mapping.place}', *table.notes]

    def values(self, columns: MappedColumns, quantities: list[str], rows: int = 0) -> Array:
        """(N, k) in SI, NaN where a cell is empty.

        Args:
            columns: Where they stand.
            quantities: k of them ('': a pure number).
            rows: How many may be counted, see `_ROW`.
        """
        k, place = len(quantities), columns.place
        raw = [
            self._counted(rows) if rows and name == _ROW else self.table.numbers(name)
            for name in columns.columns
            if name
        ]
        lengths = {len(values) for values in raw}
        if len(lengths) != 1:
            raise RecordingError(place, f'columns of different lengths: {sorted(lengths)}')
        absent = np.full((lengths.pop(), 1), np.nan)
        given = iter(raw)
        values = np.hstack([next(given) if name else absent for name in columns.columns])
        if values.shape[1] != k:
            raise RecordingError(place, f'has {values.shape[1]} columns, expected {k}')
        units = spread(columns.unit or ('',), k, f'{place}.unit')
        names = spread(columns.columns, k, place)
        sizes = [
            si_size(unit, quantity, f'{place}.unit') if quantity and name else 1.0
            for unit, quantity, name in zip(units, quantities, names, strict=True)
        ]
        sign, scale, offset = (
            np.array(spread(getattr(columns, key), k, f'{place}.{key}'))
            for key in ('sign', 'scale', 'offset')
        )
        out = np.asarray((sign * scale * values + offset) * np.array(sizes))
        for row, i in np.argwhere(np.abs(out) > LARGEST).tolist():
            if quantities[i] not in ('', TIME):  # a time has its own limit, an extra none
                why = f'{out[row, i]:g} in SI is of no machine: is its unit right?'
                raise RecordingError(self.table.row(row), f'column {names[i]!r}: {why}')
        return out

    def _counted(self, rows: int) -> Array:
        """(N, 1) numbers of the rows, unless a column is called so."""
        if _ROW in self.table.columns:
            return self.table.numbers(_ROW)
        self._note('times are those of a fixed rate, by the number of the row')
        return np.arange(float(rows))[:, None]

    def _note(self, note: str) -> None:
        if note not in self.notes:
            self.notes.append(note)

    def sampled(
        self,
        place: str,
        own_time: MappedColumns | None,
        parts: dict[str, Array],
        may_lack: Sequence[str] = (),
    ) -> tuple[IntArray, dict[str, Array]]:
        """Stamps and values of the rows that were sampled."""
        table, time = self.table, own_time or self.mapping.time
        if time is None:
            without = f'without a clock, {{columns: {_ROW}, scale: 5, unit: ms}} counts rows'
            raise RecordingError(f'{self.mapping.place}: time', f'is missing; {without}')
        seconds = self.values(time, [TIME], len(next(iter(parts.values()))))[:, 0]
        if self._is_joined:
            seconds = continued(seconds)
        for key, values in parts.items():
            if len(values) != len(seconds):
                times = counted(len(seconds), 'sample time')
                why = f'{counted(len(values), "sample")}, but {times}'
                raise RecordingError(f'{place}: {key}', why)
        missing = np.hstack([_missing(values, key in may_lack) for key, values in parts.items()])
        empty = np.asarray(missing.all(axis=1))
        _refuse(table, missing.any(axis=1) & ~empty, f'{place}: some of its columns are empty')
        _refuse(table, np.isnan(seconds) & ~empty, f'{time.place}: the time is empty')
        kept = np.flatnonzero(~empty)
        if not len(kept):
            raise RecordingError(table.source, f'no sample of {place}')
        if empty.any():
            self.notes.append(f'{place}: sampled in {len(kept)} of {len(empty)} rows')
        kept, seconds = self._in_time(kept, seconds[kept])
        stamps = _nanoseconds(seconds, lambda i: table.row(int(kept[i])))
        return stamps, {key: values[kept] for key, values in parts.items()}

    def _in_time(self, kept: IntArray, seconds: Array) -> tuple[IntArray, Array]:
        """Rows and their times, by the counter of the samples where there is one."""
        counter = self.mapping.sample_index
        if counter is None:
            apart = parted(seconds)
            if twice := int(np.count_nonzero(apart != seconds)):
                before = f'{counted(twice, "stamp")} the same as the one before'
                self._note(f'{before}: spread up to the next')
            return kept, apart
        index = self.values(counter, [''])[kept, 0]
        _refuse(self.table, np.isnan(index), f'{counter.place}: is empty', kept)
        order, mended = rebuilt(seconds, index, lambda i: self.table.row(int(kept[i])))
        change = np.abs(mended - seconds[order])
        if change.any():
            self._note(
                f'{counter.place}: {np.count_nonzero(change)} of {len(kept)} stamps rebuilt, the '
                f'largest change {shown(float(np.max(change)))}'
            )
        return kept[order], mended


def _missing(values: Array, may_lack: bool) -> NDArray[np.bool_]:
    """Empty cells; not those of a column that is empty throughout, where that may be."""
    missing = np.isnan(values)
    return np.asarray(missing[:, ~missing.all(axis=0)] if may_lack else missing)


def spread(given: tuple[T, ...], size: int, place: str) -> list[T]:
    """Entries given once for all, or one each."""
    values = list(given) * size if len(given) == 1 else list(given)
    if len(values) != size:
        raise RecordingError(
            place, f'has {counted(len(given), "entry", "entries")}, expected 1 or {size}'
        )
    return values


def _refuse(
    table: SampleTable, bad: NDArray[np.bool_], reason: str, rows: IntArray | None = None
) -> None:
    if bad.any():
        first = int(np.argmax(bad))
        raise RecordingError(table.row(first if rows is None else int(rows[first])), reason)


def _nanoseconds(seconds: Array, row: Callable[[int], str]) -> IntArray:
    if np.max(np.abs(seconds)) > 9e9:  # a 64-bit stamp holds 9.2e9 s
        index = int(np.argmax(np.abs(seconds)))
        raise RecordingError(row(index), f'{seconds[index]:g} s is no time: is its unit right?')
    stamps = to_stamps(seconds)
    steps = np.diff(stamps)
    if np.any(steps <= 0):
        index = int(np.argmax(steps <= 0)) + 1
        back = -steps[index - 1] / 1e9
        what = f'jumps back by {shown(back)}' if back else 'stands still'
        joined = '; --split-gaps takes runs that were joined as several' if back else ''
        raise RecordingError(
            row(index),
            f'the clock {what} at {shown(seconds[index])}, '
            f'{shown(seconds[index] - seconds[0])} after the first sample (a counter of the '
            f'samples, `sample_index` of the mapping, may tell the times{joined})',
        )
    return stamps
