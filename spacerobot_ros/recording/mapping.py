"""Column mappings: a YAML that says where the sensors stand in a CSV, JSON or npz file.

    value [SI] = (sign * column + offset) * size of the unit          # offset in the column's unit

Every unit is written down and nothing is guessed; docs/data.md shows one mapping a data set. Each
field below says itself how its entry is read.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any

from ..errors import RecordingError
from ..model.files import read_yaml
from .table import FORMATS

QUATERNION_ORDERS = ('xyzw', 'wxyz')
ORDERS = (*QUATERNION_ORDERS, 'rpy', 'yaw')  # angles about fixed axes x, y, z, or about z alone
DIRECTIONS = ('base_to_inertial', 'inertial_to_base')
Parser = Callable[[Any, str], Any]
"""Reads an entry at a place, which it names in a RecordingError."""


def _join(place: str, name: str) -> str:
    """The place of an entry; a file's own entries stand behind a colon."""
    return f'{place}.{name}' if ': ' in place else f'{place}: {name}'


def _map(value: Any, place: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise RecordingError(place, f'expected a map, got {value!r}')
    return {str(key): entry for key, entry in value.items()}


def _text(value: Any, place: str) -> str:
    if not isinstance(value, str):
        raise RecordingError(place, f'expected text, got {value!r}')
    return value


def _number(value: Any, place: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise RecordingError(place, f'expected a finite number, got {value!r}')
    return float(value)


def _sign(value: Any, place: str) -> float:
    sign = _number(value, place)
    if sign not in (1.0, -1.0):
        raise RecordingError(place, f'expected 1 or -1, got {sign:g}')
    return sign


def _bits(value: Any, place: str) -> int:
    if value not in (8, 16, 32):
        raise RecordingError(place, f'expected 8, 16 or 32 bits, got {value!r}')
    return int(value)


def _delimiter(value: Any, place: str) -> str:
    if len(_text(value, place)) != 1 or value == '"':
        raise RecordingError(place, f'expected one character, got {value!r}')
    return str(value)


def _any(value: Any, _: str) -> Any:
    return value


def _choice(choices: tuple[str, ...]) -> Parser:
    def parse(value: Any, place: str) -> str:
        if value not in choices:
            raise RecordingError(place, f'{value!r} is not one of {", ".join(choices)}')
        return str(value)

    return parse


def _some(one: Parser) -> Parser:
    """One or a list of them, not empty."""

    def parse(value: Any, place: str) -> tuple[Any, ...]:
        entries = tuple(one(v, place) for v in (value if isinstance(value, list) else [value]))
        if not entries:
            raise RecordingError(place, 'is empty')
        return entries

    return parse


def _named(one: Parser) -> Parser:
    """A map of them under free names."""
    return lambda value, place: {
        name: one(entry, f'{place}.{name}') for name, entry in _map(value, place).items()
    }


def _section(cls: Any, needed: tuple[str, ...] = ()) -> Parser:
    """A map with a dataclass' entries: every one known, and none that it needs missing."""

    def parse(value: Any, place: str) -> Any:
        given = _map(value, place)
        known = {f.name: f for f in fields(cls) if f.metadata}
        for key in given:
            if key not in known:
                close = difflib.get_close_matches(key, known, n=1)
                hint = f'did you mean {close[0]!r}?' if close else f'known: {", ".join(known)}'
                raise RecordingError(_join(place, key), f'unknown entry ({hint})')
        for name, f in known.items():
            has_default = f.default is not MISSING or f.default_factory is not MISSING
            if name not in given and (name in needed or not has_default):
                raise RecordingError(_join(place, name), f'is missing{f.metadata["hint"]}')
        parsed = {
            name: known[name].metadata['parse'](entry, _join(place, name))
            for name, entry in given.items()
        }
        return cls(**parsed, place=place)

    return parse


def _terms(value: Any, place: str) -> tuple[Term, ...]:
    if not isinstance(value, list) or not value:
        raise RecordingError(place, 'expected a list of terms {column, scale, times}')
    return tuple(_section(Term)(term, f'{place}[{i}]') for i, term in enumerate(value))


def _entry(parse: Parser, default: Any = MISSING, hint: str = '') -> Any:
    return field(default=default, metadata={'parse': parse, 'hint': hint})


@dataclass(frozen=True, slots=True, kw_only=True)
class MappedColumns:
    """Columns of one quantity.

    Args:
        columns: Names; one name of an npz array with several columns serves for all of them.
        unit: One a column, or one for all.
        sign: 1 or -1; one a column, or one for all.
        offset: Added in the column's unit; one a column, or one for all.
        place: Where this stands, for messages.
    """

    columns: tuple[str, ...] = _entry(_some(_text))
    unit: tuple[str, ...] = _entry(_some(_text), hint=': write the unit of the column')
    sign: tuple[float, ...] = _entry(_some(_sign), (1.0,))
    offset: tuple[float, ...] = _entry(_some(_number), (0.0,))
    place: str = ''


_COLUMNS = _section(MappedColumns)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointColumns:
    """Columns of named joints or wheels.

    Args:
        names: The joints, in the order of the columns.
        position: Positions; wheels may have none.
        velocity: Rates.
        effort: Measured motor torques.
        time: Sample times where they are not the file's.
        place: Where this stands, for messages.
    """

    names: tuple[str, ...] = _entry(_some(_text))
    position: MappedColumns | None = _entry(_COLUMNS, None)
    velocity: MappedColumns | None = _entry(_COLUMNS, None)
    effort: MappedColumns | None = _entry(_COLUMNS, None)
    time: MappedColumns | None = _entry(_COLUMNS, None)
    place: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroColumns(MappedColumns):
    """Columns x, y, z of omega_WB_B, in base coordinates; own sample times, if any."""

    time: MappedColumns | None = _entry(_COLUMNS, None)


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeColumns(GyroColumns):
    """Columns of the attitude: four of a quaternion, three angles, or one.

    Args:
        unit: Of angles; a quaternion has none.
        order: One of `ORDERS`.
        maps: One of `DIRECTIONS`: what the rotation takes to what.
    """

    unit: tuple[str, ...] = _entry(_some(_text), ())
    order: str = _entry(_choice(ORDERS), hint=f': one of {", ".join(ORDERS)}')
    maps: str = _entry(_choice(DIRECTIONS), DIRECTIONS[0])

    def __post_init__(self) -> None:
        """Check what depends on the order."""
        if self.unit and self.is_quaternion:
            raise RecordingError(f'{self.place}.unit', 'a quaternion has no unit')
        if not self.unit and not self.is_quaternion:
            raise RecordingError(f'{self.place}.unit', 'is missing: write the unit of the column')

    @property
    def is_quaternion(self) -> bool:
        """Whether it is no angles."""
        return self.order in QUATERNION_ORDERS


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """One term of a derived column: `scale * column * times`; `times` is a column, or empty."""

    column: str = _entry(_text)
    scale: float = _entry(_number, 1.0)
    times: str = _entry(_text, '')
    place: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnMapping:
    """Where the sensors stand in a table.

    Args:
        format: csv, npz or json; empty: by the file's suffix.
        delimiter: CSV only: between cells.
        rows: JSON only: name of the list of samples.
        select: Only rows in which these columns have this content.
        twos_complement: Signed integers that were written as unsigned ones, with their bits.
        derived: New columns, each a sum of terms, that sections below may name.
        time: Sample times of every section that has none of its own.
        joints: Manipulator joints.
        gyro: Gyro.
        attitude: Star tracker.
        wheels: The servicer's own wheels.
        place: The mapping file, for messages.
    """

    format: str = _entry(_choice(FORMATS), '')
    delimiter: str = _entry(_delimiter, ',')
    rows: str = _entry(_text, '')
    select: Mapping[str, Any] = field(
        default_factory=dict, metadata={'parse': _named(_any), 'hint': ''}
    )
    twos_complement: Mapping[str, int] = field(
        default_factory=dict, metadata={'parse': _named(_bits), 'hint': ''}
    )
    derived: Mapping[str, tuple[Term, ...]] = field(
        default_factory=dict, metadata={'parse': _named(_terms), 'hint': ''}
    )
    time: MappedColumns | None = _entry(_COLUMNS, None)
    joints: JointColumns | None = _entry(_section(JointColumns, ('position',)), None)
    gyro: GyroColumns | None = _entry(_section(GyroColumns), None)
    attitude: AttitudeColumns | None = _entry(_section(AttitudeColumns), None)
    wheels: JointColumns | None = _entry(_section(JointColumns, ('velocity',)), None)
    place: str = ''


def load_mapping(path: str | Path) -> ColumnMapping:
    """Read a mapping file.

    Raises:
        ConfigurationError: unreadable, or not YAML.
        RecordingError: anything wrong in it, with its place.
    """
    place = str(path)
    mapping: ColumnMapping = _section(ColumnMapping)(
        read_yaml(Path(path), 'column mapping'), place
    )
    if mapping.joints is None and mapping.gyro is None and mapping.attitude is None:
        raise RecordingError(place, 'maps no sensor: give joints, gyro or attitude')
    return mapping
