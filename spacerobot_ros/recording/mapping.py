"""Column mappings: a YAML that says where the sensors stand in a CSV, JSON or npz file.

    value [SI] = (sign * column + offset) * size of the unit          # offset in the column's unit

Every unit is written down and nothing is guessed; docs/data.md shows one mapping a data set.
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
ANGLE_ORDERS = ('rpy', 'yaw')  # about fixed axes x, y, z, as in a URDF; or about z alone
DIRECTIONS = ('base_to_inertial', 'inertial_to_base')


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Columns of one quantity.

    Args:
        columns: Names; one name of an npz array with several columns serves for all of them.
        unit: One a column, or one for all.
        sign: 1 or -1; one a column, or one for all.
        offset: Added in the column's unit; one a column, or one for all.
        place: Where this stands, for messages.
    """

    columns: tuple[str, ...]
    unit: tuple[str, ...] = ('',)
    sign: tuple[float, ...] = (1.0,)
    offset: tuple[float, ...] = (0.0,)
    place: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class JointColumns:
    """Columns of named joints or wheels.

    Args:
        names: The joints, in the order of the columns.
        position: Positions; wheels may have none.
        velocity: Rates.
        effort: Measured motor torques.
        time: Sample times where they are not the file's.
    """

    names: tuple[str, ...]
    position: Columns | None = None
    velocity: Columns | None = None
    effort: Columns | None = None
    time: Columns | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroColumns:
    """Columns x, y, z of omega_WB_B, in base coordinates."""

    columns: Columns
    time: Columns | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeColumns:
    """Columns of the attitude.

    Args:
        columns: Four of a quaternion, three angles, or one.
        order: One of `QUATERNION_ORDERS` or `ANGLE_ORDERS`.
        maps: One of `DIRECTIONS`: what the rotation takes to what.
        time: Sample times where they are not the file's.
    """

    columns: Columns
    order: str
    maps: str = DIRECTIONS[0]
    time: Columns | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """One term of a derived column: `scale * column * times`; `times` is a column, or empty."""

    column: str
    scale: float = 1.0
    times: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnMapping:
    """Where the sensors stand in a table.

    Args:
        format: csv, npz or json; empty: by the file's suffix.
        delimiter: CSV only: between cells.
        rows: JSON only: name of the list of samples.
        select: Only rows in which these columns say this.
        twos_complement: Signed integers that were written as unsigned ones, with their bits.
        derived: New columns, each a sum of terms, that sections below may name.
        time: Sample times of every section that has none of its own.
        joints: Manipulator joints.
        gyro: Gyro.
        attitude: Star tracker.
        wheels: The servicer's own wheels.
        source: The mapping file, for messages.
    """

    format: str = ''
    delimiter: str = ','
    rows: str = ''
    select: Mapping[str, Any] = field(default_factory=dict)
    twos_complement: Mapping[str, int] = field(default_factory=dict)
    derived: Mapping[str, tuple[Term, ...]] = field(default_factory=dict)
    time: Columns | None = None
    joints: JointColumns | None = None
    gyro: GyroColumns | None = None
    attitude: AttitudeColumns | None = None
    wheels: JointColumns | None = None
    source: str = ''


def load_mapping(path: str | Path) -> ColumnMapping:
    """Read a mapping file.

    Raises:
        ConfigurationError: unreadable, or not YAML.
        RecordingError: anything wrong in it, with its place.
    """
    place = str(path)
    values = _map(read_yaml(Path(path), 'column mapping'), place)
    given = _known(ColumnMapping, values, place, hidden=('source',))
    if not any(name in given for name in ('joints', 'gyro', 'attitude')):
        raise RecordingError(place, 'maps no sensor: give joints, gyro or attitude')
    readers: dict[str, Callable[[Any, str], Any]] = {
        'format': lambda v, p: _choice(v, FORMATS, p),
        'delimiter': _delimiter,
        'rows': _text,
        'select': _map,
        'twos_complement': _bits,
        'derived': lambda v, p: {
            str(name): _terms(terms, f'{p}.{name}') for name, terms in _map(v, p).items()
        },
        'time': _columns,
        'joints': lambda v, p: _joints(v, p, ('names', 'position')),
        'wheels': lambda v, p: _joints(v, p, ('names', 'velocity')),
        'gyro': _gyro,
        'attitude': _attitude,
    }
    parsed = {name: readers[name](value, f'{place}: {name}') for name, value in given.items()}
    return ColumnMapping(**parsed, source=place)


def _joints(values: Any, place: str, needed: tuple[str, ...]) -> JointColumns:
    given = _known(JointColumns, _map(values, place), place)
    for name in needed:
        if name not in given:
            raise RecordingError(f'{place}.{name}', 'is missing')
    parts = {k: _columns(v, f'{place}.{k}') for k, v in given.items() if k != 'names'}
    return JointColumns(names=_texts(given['names'], f'{place}.names'), **parts)


def _gyro(values: Any, place: str) -> GyroColumns:
    time, rest = _split_time(_map(values, place), place)
    return GyroColumns(columns=_columns(rest, place), time=time)


def _attitude(values: Any, place: str) -> AttitudeColumns:
    time, rest = _split_time(_map(values, place), place)
    orders = QUATERNION_ORDERS + ANGLE_ORDERS
    if 'order' not in rest:
        raise RecordingError(f'{place}.order', f'is missing: one of {", ".join(orders)}')
    order = _choice(rest.pop('order'), orders, f'{place}.order')
    maps = _choice(rest.pop('maps', DIRECTIONS[0]), DIRECTIONS, f'{place}.maps')
    if order in QUATERNION_ORDERS:
        if 'unit' in rest:
            raise RecordingError(f'{place}.unit', 'a quaternion has no unit')
        rest['unit'] = ''
    return AttitudeColumns(columns=_columns(rest, place), order=order, maps=maps, time=time)


def _split_time(values: Mapping[str, Any], place: str) -> tuple[Columns | None, dict[str, Any]]:
    rest = dict(values)
    time = rest.pop('time', None)
    return (None if time is None else _columns(time, f'{place}.time')), rest


def _columns(values: Any, place: str) -> Columns:
    given = _known(Columns, _map(values, place), place, hidden=('place',))
    if 'unit' not in given:
        raise RecordingError(f'{place}.unit', 'is missing: write the unit of the column')
    return Columns(
        columns=_texts(given['columns'], f'{place}.columns'),
        unit=_texts(given['unit'], f'{place}.unit'),
        sign=_signs(given.get('sign', 1), f'{place}.sign'),
        offset=_numbers(given.get('offset', 0.0), f'{place}.offset'),
        place=place,
    )


def _terms(values: Any, place: str) -> tuple[Term, ...]:
    if not isinstance(values, list) or not values:
        raise RecordingError(place, 'expected a list of terms {column, scale, times}')
    terms = []
    for i, value in enumerate(values):
        where = f'{place}[{i}]'
        given = _known(Term, _map(value, where), where)
        terms.append(
            Term(
                column=_text(given['column'], f'{where}.column'),
                scale=_numbers(given.get('scale', 1.0), f'{where}.scale')[0],
                times=_text(given.get('times', ''), f'{where}.times'),
            )
        )
    return tuple(terms)


def _known(
    cls: Any, values: Mapping[str, Any], place: str, hidden: tuple[str, ...] = ()
) -> dict[str, Any]:
    """The entries of a map, every one known to the dataclass and none that it needs missing."""
    names = [f.name for f in fields(cls) if f.name not in hidden]
    for key in values:
        if key not in names:
            close = difflib.get_close_matches(str(key), names, n=1)
            hint = f'did you mean {close[0]!r}?' if close else f'known: {", ".join(names)}'
            raise RecordingError(f'{place}: {key}', f'unknown entry ({hint})')
    for f in fields(cls):
        if f.default is MISSING and f.default_factory is MISSING and f.name not in values:
            raise RecordingError(f'{place}: {f.name}', 'is missing')
    return dict(values)


def _map(value: Any, place: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise RecordingError(place, f'expected a map, got {value!r}')
    return value


def _bits(value: Any, place: str) -> dict[str, int]:
    for name, bits in _map(value, place).items():
        if bits not in (8, 16, 32):
            raise RecordingError(f'{place}.{name}', f'expected 8, 16 or 32 bits, got {bits!r}')
    return {str(name): int(bits) for name, bits in value.items()}


def _text(value: Any, place: str) -> str:
    if not isinstance(value, str):
        raise RecordingError(place, f'expected text, got {value!r}')
    return value


def _texts(value: Any, place: str) -> tuple[str, ...]:
    texts = [_text(v, place) for v in (value if isinstance(value, list) else [value])]
    if not texts:
        raise RecordingError(place, 'is empty')
    return tuple(texts)


def _delimiter(value: Any, place: str) -> str:
    if len(_text(value, place)) != 1 or value == '"':
        raise RecordingError(place, f'expected one character, got {value!r}')
    return str(value)


def _choice(value: Any, choices: tuple[str, ...], place: str) -> str:
    if value not in choices:
        raise RecordingError(place, f'{value!r} is not one of {", ".join(choices)}')
    return str(value)


def _numbers(value: Any, place: str) -> tuple[float, ...]:
    values = value if isinstance(value, list) else [value]
    for v in values:
        if isinstance(v, bool) or not isinstance(v, (int, float)) or not math.isfinite(v):
            raise RecordingError(place, f'expected a finite number, got {v!r}')
    return tuple(float(v) for v in values)


def _signs(value: Any, place: str) -> tuple[float, ...]:
    signs = _numbers(value, place)
    for sign in signs:
        if sign not in (1.0, -1.0):
            raise RecordingError(place, f'expected 1 or -1, got {sign:g}')
    return signs
