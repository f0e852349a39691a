"""Samples with stamps of their own: what the series of all sensors and inputs have in common."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import ClassVar, TypeVar

import numpy as np

from ..errors import RecordingError
from ..formats import counted
from ..types import Array, BoolArray, IntArray

SeriesType = TypeVar('SeriesType', bound='SampleSeries')


class SampleSeries:
    """What the samples of all sensors have in common."""

    __slots__ = ()
    stamp_ns: IntArray
    _may_lack: ClassVar[tuple[str, ...]] = ()

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.stamp_ns)

    def seconds(self, origin_ns: int) -> Array:
        """(N,) sample times from an origin [s]."""
        return np.asarray((self.stamp_ns - origin_ns) / 1e9)

    def at(self: SeriesType, part: slice | BoolArray) -> SeriesType:
        """Some of the samples in their order; there may be none."""
        out = object.__new__(type(self))
        for field in fields(self):  # type: ignore[arg-type]  # every subclass is a dataclass
            value = getattr(self, field.name)
            value = value[part] if isinstance(value, np.ndarray) else value
            object.__setattr__(out, field.name, value)
        return out

    def _freeze(self, place: str, **columns: Sequence[str]) -> None:
        """Check and freeze the stamps and the named values, each with its columns' names."""
        stamps = _stamps(self.stamp_ns, f'{place}.stamp_ns')
        object.__setattr__(self, 'stamp_ns', stamps)
        for name, names in columns.items():
            values = getattr(self, name)
            if values is not None:
                shape, where = (len(stamps), len(names)), f'{place}.{name}'
                values = _values(values, shape, where, names, may_lack=name in self._may_lack)
                object.__setattr__(self, name, values)


@dataclass(frozen=True, slots=True, eq=False)
class InputSeries(SampleSeries):
    """Samples of something beside the robot's own sensors: commands, a wrench, a field, anything.

    Args:
        names: The k columns.
        stamp_ns: (N,) sample times, increasing [ns].
        values: (N, k) in SI.
        units: (k,) SI units; empty for a pure number.
    """

    names: tuple[str, ...]
    stamp_ns: IntArray
    values: Array
    units: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze."""
        names = tuple(self.names)
        if len(set(names)) != len(names) or not names:
            raise RecordingError(
                'inputs.names', f'must be distinct and not empty, got {list(names)}'
            )
        object.__setattr__(self, 'names', names)
        object.__setattr__(self, 'units', tuple(self.units) or ('',) * len(names))
        if len(self.units) != len(names):
            raise RecordingError(
                'inputs.units',
                f'has {counted(len(self.units), "entry", "entries")}, expected {len(names)}',
            )
        self._freeze('inputs', values=names)

    def column(self, name: str) -> Array:
        """(N,) values of one column."""
        return np.asarray(self.values[:, self.names.index(name)])


def _stamps(values: IntArray, place: str) -> IntArray:
    stamps = np.array(values)
    if stamps.ndim != 1 or not len(stamps):
        raise RecordingError(place, f'expected a list of stamps, got shape {stamps.shape}')
    if not np.issubdtype(stamps.dtype, np.integer):
        raise RecordingError(place, f'expected whole nanoseconds, got {stamps.dtype}')
    stamps = stamps.astype(np.int64)
    steps = np.diff(stamps)
    if np.any(steps <= 0):
        row = int(np.argmax(steps <= 0)) + 1
        raise RecordingError(
            f'{place}[{row}]', f'{stamps[row]} ns is not after {stamps[row - 1]} ns'
        )
    stamps.setflags(write=False)
    return stamps


def _values(
    values: Array, shape: tuple[int, ...], place: str, columns: Sequence[str], *, may_lack: bool
) -> Array:
    array = np.array(values, dtype=float)
    if array.shape != shape:
        raise RecordingError(place, f'expected shape {shape}, got {array.shape}')
    bad = ~np.isfinite(array)
    if may_lack:
        bad &= ~np.isnan(array).all(axis=0)
    if np.any(bad):
        row, column = (int(i) for i in np.argwhere(bad)[0])
        raise RecordingError(
            f'{place}[{row}] ({columns[column]})', f'{array[row, column]} is not finite'
        )
    array.setflags(write=False)
    return array
