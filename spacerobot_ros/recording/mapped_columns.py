"""Columns of a table by their mapping: units, SI values, stamps of the rows that were sampled.

Stamps of a log may stand still or jump back: a logger that is late writes a block of samples with
one stamp, or mixes up two blocks. A counter that goes up by one a sample knows better: in a run of
consecutive numbers k the times are

    t = t_0 + T k,    T: median step of stamps whose numbers are consecutive,

with t_0 the median of what the run's stamps say. Stamps that are good stay as they are.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..types import Array, IntArray
from .gaps import continued
from .mapping import ColumnMapping, MappedColumns
from .record import shown, to_stamps
from .table import SampleTable

TIME, ANGLE, LENGTH = 'time', 'angle', 'length'
ANGULAR_RATE, LINEAR_RATE = 'angular rate', 'linear rate'
TORQUE, FORCE, CURRENT, FIELD = 'torque', 'force', 'current', 'magnetic field'

_DEG = math.pi / 180.0
_TURN = 2.0 * math.pi

# Torques and forces of the pound and the ounce: exact by definition (1 lbf = 4.4482216152605 N).
_SIZES: dict[str, dict[str, float]] = {
    TIME: {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9, 'min': 60.0, 'h': 3600.0},
    ANGLE: {'rad': 1.0, 'mrad': 1e-3, 'deg': _DEG, 'arcsec': _DEG / 3600.0, 'turn': _TURN},
    LENGTH: {'m': 1.0, 'mm': 1e-3, 'cm': 1e-2, 'um': 1e-6},
    ANGULAR_RATE: {
        'rad/s': 1.0,
        'mrad/s': 1e-3,
        'deg/s': _DEG,
        'deg/h': _DEG / 3600.0,
        'arcsec/s': _DEG / 3600.0,
        'rpm': _TURN / 60.0,
        'turn/s': _TURN,
    },
    LINEAR_RATE: {'m/s': 1.0, 'mm/s': 1e-3, 'cm/s': 1e-2},
    TORQUE: {
        'N m': 1.0,
        'mN m': 1e-3,
        'uN m': 1e-6,
        'kN m': 1e3,
        'N cm': 1e-2,
        'N mm': 1e-3,
        'kgf cm': 0.0980665,
        'lbf ft': 1.3558179483314004,
        'lbf in': 0.1129848290276167,
        'ozf in': 0.007061551814226043,
    },
    FORCE: {'N': 1.0, 'mN': 1e-3, 'kN': 1e3, 'lbf': 4.4482216152605},
    CURRENT: {'A': 1.0, 'mA': 1e-3},
    FIELD: {'T': 1.0, 'mT': 1e-3, 'uT': 1e-6, 'nT': 1e-9, 'G': 1e-4, 'mG': 1e-7},
}
SI_UNITS = {quantity: next(iter(sizes)) for quantity, sizes in _SIZES.items()} | {'': ''}
"""By quantity: the first one of each is of size 1."""
_ALIASES = {'Nm': 'N m', 'mNm': 'mN m', 'kNm': 'kN m', 'Ncm': 'N cm', 'Nmm': 'N mm'}


def is_current(unit: str) -> bool:
    """Whether it is a unit of current."""
    return unit in _SIZES[CURRENT]


def si_size(unit: str, quantity: str, place: str) -> float:
    """Size of a unit in SI.

    Args:
        unit: Such as `deg/s`; `Nm` for `N m` is understood.
        quantity: What the column measures, one of this module's constants.
        place: Where the unit is written, for the error.

    Raises:
        RecordingError: an unknown unit, or one of another quantity.
    """
    name = _ALIASES.get(unit, unit)
    known = _SIZES[quantity]
    if name in known:
        return known[name]
    other = next((q for q, sizes in _SIZES.items() if name in sizes), None)
    if other is not None:
        raise RecordingError(place, f'{unit!r} is a unit of {other}, expected one of {quantity}')
    close = difflib.get_close_matches(name, known, n=1)
    hint = f'did you mean {close[0]!r}?' if close else f'known: {", ".join(known)}'
    raise RecordingError(place, f'unknown unit {unit!r} of {quantity} ({hint})')


def rebuilt(seconds: Array, index: Array, row: Callable[[int], str]) -> tuple[IntArray, Array]:
    """Rows in the order of the counter, and their times.

    Args:
        seconds: (N,) stamps [s].
        index: (N,) the counter.
        row: Name of a row, for messages.

    Returns:
        (N,) row of every sample, and (N,) its time [s]. Runs whose stamps go forward are left as
        they are; so is all where every stamp does.

    Raises:
        RecordingError: a number that comes twice, or stamps that the counter can not mend: the
            steps of it are not 1 there.
    """
    if np.all(np.diff(seconds) > 0.0):
        return np.arange(len(seconds)), seconds
    order = np.argsort(index, kind='stable')
    index, given = index[order], seconds[order]
    steps = np.diff(index)
    if np.any(steps == 0.0):
        twice = int(np.argmax(steps == 0.0)) + 1
        raise RecordingError(row(int(order[twice])), f'sample_index {index[twice]:g} comes twice')
    period = float(np.median(np.diff(given)[steps == 1.0])) if np.any(steps == 1.0) else 0.0
    out = given.copy()
    for run in np.split(
        np.arange(len(index)), np.flatnonzero(~_goes_on(given, steps, period)) + 1
    ):
        if len(run) > 1 and period > 0.0 and np.any(np.diff(given[run]) <= 0.0):
            out[run] = period * index[run] + np.median(given[run] - period * index[run])
    if np.any(np.diff(out) <= 0.0):
        bad = int(np.argmax(np.diff(out) <= 0.0)) + 1
        raise RecordingError(
            row(int(order[bad])),
            f'the clock does not go on at {shown(given[bad])}, '
            f'{shown(given[bad] - given[0])} after the first sample, and the counter does not '
            f'tell the time: it goes from {index[bad - 1]:g} to {index[bad]:g}',
        )
    return order, out


def _goes_on(given: Array, steps: Array, period: float) -> NDArray[np.bool_]:
    """(N-1,) whether the next sample belongs to the same run of the counter.

    A block that was written late is off by its own length at most: a stamp further off than all
    samples last belongs to another run, whatever the counter says.
    """
    off = np.abs(np.diff(given) - period * steps)
    return np.asarray((steps == 1.0) & (off < period * len(given)))


T = TypeVar('T')


class ColumnReader:
    """Reads columns of one table; collects what is worth a note.

    Args:
        table: The table.
        mapping: Where the sensors stand in it.
        is_joined: Whether its clock may begin anew, with another run.
    """

    def __init__(self, table: SampleTable, mapping: ColumnMapping, is_joined: bool) -> None:
        self.table, self.mapping, self._is_joined = table, mapping, is_joined
        self.notes = [f'columns by {mapping.place}']

    def values(self, columns: MappedColumns, quantities: list[str]) -> Array:
        """(N, k) in SI, NaN where a cell is empty; k quantities ('': a pure number)."""
        k, place = len(quantities), columns.place
        raw = [self.table.numbers(name) for name in columns.columns if name]
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
        return np.asarray((sign * scale * values + offset) * np.array(sizes))

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
            raise RecordingError(f'{self.mapping.place}: time', 'is missing')
        seconds = self.values(time, [TIME])[:, 0]
        if self._is_joined:
            seconds = continued(seconds)
        for key, values in parts.items():
            if len(values) != len(seconds):
                raise RecordingError(
                    f'{place}: {key}', f'{len(values)} samples, but {len(seconds)} sample times'
                )
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
            return kept, seconds
        index = self.values(counter, [''])[kept, 0]
        _refuse(self.table, np.isnan(index), f'{counter.place}: is empty', kept)
        order, mended = rebuilt(seconds, index, lambda i: self.table.row(int(kept[i])))
        change = np.abs(mended - seconds[order])
        note = (
            f'{counter.place}: {np.count_nonzero(change)} of {len(kept)} stamps rebuilt, the '
            f'largest change {shown(float(np.max(change)))}'
        )
        if change.any() and note not in self.notes:
            self.notes.append(note)
        return kept[order], mended


def _missing(values: Array, may_lack: bool) -> NDArray[np.bool_]:
    """Empty cells; not those of a column that is empty throughout, where that may be."""
    missing = np.isnan(values)
    return np.asarray(missing[:, ~missing.all(axis=0)] if may_lack else missing)


def spread(given: tuple[T, ...], size: int, place: str) -> list[T]:
    """Entries given once for all, or one each."""
    values = list(given) * size if len(given) == 1 else list(given)
    if len(values) != size:
        raise RecordingError(place, f'has {len(given)} entries, expected 1 or {size}')
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
        raise RecordingError(
            row(index),
            f'the clock {what} at {shown(seconds[index])}, '
            f'{shown(seconds[index] - seconds[0])} after the first sample (a counter of the '
            'samples, `sample_index` of the mapping, may tell the times)',
        )
    return stamps
