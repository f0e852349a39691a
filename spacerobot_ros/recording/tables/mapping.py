"""Column mappings: a YAML that says where the sensors stand in a CSV, JSON or npz file.

    value [SI] = (sign * scale * column + offset) * size of the unit  # offset in this unit

Every unit is written down and nothing is guessed; docs/data.md shows one mapping a data set. Each
field below says itself how its entry is read.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import ConfigurationError
from ...model.files import read_yaml
from ...model.robot_settings import EFFORT_KINDS
from ...model.schema import Parser, entry, param, parse_number, parse_section, parse_text
from .table import FORMATS

QUATERNION_ORDERS = ('xyzw', 'wxyz')
HEADERS = ('names', 'none')
ORDERS = (*QUATERNION_ORDERS, 'rpy', 'yaw')  # angles about fixed axes x, y, z, or about z alone
DIRECTIONS = ('base_to_inertial', 'inertial_to_base')
ByName = tuple[tuple[str, Any], ...]


def _map(value: Any, place: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise ConfigurationError(place, f'expected a map, got {value!r}')
    return {str(key): content for key, content in value.items()}


def _one_of(*allowed: float | str) -> Parser:
    def parse(value: Any, place: str) -> Any:
        if value not in allowed:
            words = ' or '.join(str(one).removesuffix('.0') for one in allowed)
            raise ConfigurationError(place, f'expected {words}, got {value!r}')
        return value

    return parse


def _column(value: Any, place: str) -> str:
    """A column's name, its number where a file names none, or '' where there is none."""
    if value is None:
        return ''
    if isinstance(value, int) and not isinstance(value, bool) and value >= 0:
        return str(value)
    return str(parse_text(value, place))


def _unit(value: Any, place: str) -> str:
    """A unit, or '' of a column that there is not."""
    return '' if value is None else str(parse_text(value, place))


def _delimiter(value: Any, place: str) -> str:
    if len(parse_text(value, place)) != 1 or value == '"':
        raise ConfigurationError(place, f'expected one character, got {value!r}')
    return str(value)


def _some(one: Parser) -> Parser:
    """One or a list of them, not empty."""

    def parse(value: Any, place: str) -> tuple[Any, ...]:
        entries = tuple(one(v, place) for v in (value if isinstance(value, list) else [value]))
        if not entries:
            raise ConfigurationError(place, 'is empty')
        return entries

    return parse


def _names(value: Any, place: str) -> tuple[str, ...]:
    """One name or a list of them, each once."""
    names = _some(parse_text)(value, place)
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ConfigurationError(place, f'{", ".join(twice)} stands there twice')
    return names


def _named(one: Parser) -> Parser:
    """A map of them under free names."""
    return lambda value, place: tuple(
        (name, one(content, f'{place}.{name}')) for name, content in _map(value, place).items()
    )


def _section(cls: Any, needed: str = '') -> Parser:
    """A map with a dataclass' entries, and one of them that must be there."""

    def parse(value: Any, place: str) -> Any:
        given = _map(value, place)
        if needed and needed not in given:
            raise ConfigurationError(f'{place}.{needed}', 'is missing')
        return parse_section(cls, {**given, 'place': place}, place)

    return parse


def _terms(value: Any, place: str) -> tuple[Term, ...]:
    if not isinstance(value, list) or not value:
        raise ConfigurationError(place, 'expected a list of terms {column, scale, times}')
    return tuple(_section(Term)(term, f'{place}[{i}]') for i, term in enumerate(value))


@dataclass(frozen=True, slots=True, kw_only=True)
class MappedColumns:
    """Columns of one quantity.

    Args:
        columns: Names, or numbers from 0 in a file without names; one name of an npz array with
            several columns serves for all of them. Null for a joint without such a column.
        unit: To be written down, such as `deg/s`; one a column, or one for all.
        sign: 1 or -1; one a column, or one for all.
        scale: Factor that makes the column's numbers ones of that unit; likewise.
        offset: Added in that unit; likewise.
        place: Where this stands, for messages.
    """

    columns: tuple[str, ...] = entry(_some(_column))
    unit: tuple[str, ...] = entry(_some(_unit))
    scale: tuple[float, ...] = entry(_some(parse_number), (1.0,))
    sign: tuple[float, ...] = entry(_some(_one_of(1.0, -1.0)), (1.0,))
    offset: tuple[float, ...] = entry(_some(parse_number), (0.0,))
    place: str = param('')


_COLUMNS = _section(MappedColumns)


@dataclass(frozen=True, slots=True, kw_only=True)
class EffortColumns(MappedColumns):
    """Columns of efforts; null for a joint without a motor.

    Args:
        kind: What they are, as `robot.effort_kind`, which they must not contradict; one a column,
            or one for all.
        enabled: Columns that are 0 or false where a motor is off, so that it gives no torque; one
            a joint (null: always on), or one for all.
    """

    kind: tuple[str, ...] = entry(_some(_one_of(*EFFORT_KINDS)), ())
    enabled: tuple[str, ...] = entry(_some(_column), ())


@dataclass(frozen=True, slots=True, kw_only=True)
class JointColumns:
    """Columns of named joints or wheels.

    Args:
        names: The joints, in the order of the columns.
        position: Positions; wheels may have none, and are null where joints are wheels.
        velocity: Rates.
        effort: Measured torques, or currents.
        time: Sample times where they are not the file's.
        place: Where this stands, for messages.
    """

    names: tuple[str, ...] = entry(_names)
    position: MappedColumns | None = entry(_COLUMNS, None)
    velocity: MappedColumns | None = entry(_COLUMNS, None)
    effort: EffortColumns | None = entry(_section(EffortColumns), None)
    time: MappedColumns | None = entry(_COLUMNS, None)
    place: str = param('')


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroColumns(MappedColumns):
    """Columns x, y, z of omega_WB_B, in base coordinates; null for an axis without a gyro.

    Args:
        time: Own sample times, if any.
    """

    time: MappedColumns | None = entry(_COLUMNS, None)


@dataclass(frozen=True, slots=True, kw_only=True)
class AttitudeColumns(GyroColumns):
    """Columns of the attitude: four of a quaternion, three angles, or one.

    Args:
        unit: Of angles; a quaternion has none.
        order: One of xyzw, wxyz, rpy, yaw.
        maps: One of `DIRECTIONS`: what the rotation takes to what.
    """

    unit: tuple[str, ...] = entry(_some(parse_text), ())
    order: str = param(choices=ORDERS)
    maps: str = param(DIRECTIONS[0], choices=DIRECTIONS)

    def __post_init__(self) -> None:
        """Check what depends on the order."""
        if self.unit and self.is_quaternion:
            raise ConfigurationError(f'{self.place}.unit', 'a quaternion has no unit')
        if not self.unit and not self.is_quaternion:
            raise ConfigurationError(
                f'{self.place}.unit', 'is missing: write the unit of the column'
            )

    @property
    def is_quaternion(self) -> bool:
        """Whether it is no angles."""
        return self.order in QUATERNION_ORDERS


@dataclass(frozen=True, slots=True, kw_only=True)
class InputColumns(GyroColumns):
    """Columns of a measured input.

    Args:
        unit: Of the columns; shares and counters have none.
    """

    unit: tuple[str, ...] = entry(_some(parse_text), ())


@dataclass(frozen=True, slots=True, kw_only=True)
class ThrusterColumns:
    """Columns of commands to named thrusters.

    Args:
        names: The thrusters, in the order of the columns.
        command: Shares of the full force, 0 to 1, each held until the next sample.
        time: Sample times where they are not the file's.
        place: Where this stands, for messages.
    """

    names: tuple[str, ...] = entry(_names)
    command: InputColumns = entry(_section(InputColumns))
    time: MappedColumns | None = entry(_COLUMNS, None)
    place: str = param('')


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """One term of a derived column: `scale * column * times`; `times` is a column, or empty."""

    column: str = entry(_column)
    scale: float = param(1.0)
    times: str = entry(_column, '')
    place: str = param('')


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnMapping:
    """Where the sensors stand in a table.

    Args:
        format: csv, npz or json; empty: by the file's suffix.
        delimiter: CSV only: between cells; a space: any run of spaces and tabs.
        header: CSV only: `names`, or `none` where no line names the columns.
        rows: JSON only: name of the list of samples.
        select: Only rows in which these columns have this content.
        twos_complement: Signed integers that were written as unsigned ones, with their bits.
        derived: New columns, each a sum of terms, that sections below may name.
        time: Sample times of every section that has none of its own.
        joints: Manipulator joints.
        gyro: Gyro.
        attitude: Star tracker.
        wheels: The servicer's own wheels.
        thrusters: Commands to the robot's thrusters.
        base_wrench: Force and torque on the base at its origin, in base coordinates.
        magnetic_field: Magnetometer, in base coordinates.
        base_position: Of the base's origin in the inertial frame, x, y, z; null for an axis that
            is not measured.
        extra: Anything else by a free name, in the unit that is written there: temperatures,
            currents, voltages, an orbit's phase.
        sample_index: A counter of the samples, from which stamps that stand still or jump back
            are rebuilt.
        place: The mapping file, for messages.
    """

    format: str = param('', choices=FORMATS)
    delimiter: str = entry(_delimiter, ',')
    header: str = param('names', choices=HEADERS)
    rows: str = param('')
    select: ByName = entry(_named(lambda value, _: value), ())
    twos_complement: ByName = entry(_named(_one_of(8, 16, 32)), ())
    derived: ByName = entry(_named(_terms), ())
    time: MappedColumns | None = entry(_COLUMNS, None)
    joints: JointColumns | None = entry(_section(JointColumns, 'position'), None)
    gyro: GyroColumns | None = entry(_section(GyroColumns), None)
    attitude: AttitudeColumns | None = entry(_section(AttitudeColumns), None)
    wheels: JointColumns | None = entry(_section(JointColumns, 'velocity'), None)
    thrusters: ThrusterColumns | None = entry(_section(ThrusterColumns, 'command'), None)
    base_wrench: InputColumns | None = entry(_section(InputColumns), None)
    magnetic_field: InputColumns | None = entry(_section(InputColumns), None)
    base_position: InputColumns | None = entry(_section(InputColumns), None)
    extra: ByName = entry(_named(_section(InputColumns)), ())
    sample_index: InputColumns | None = entry(_section(InputColumns), None)
    place: str = param('')


def load_mapping(path: str | Path) -> ColumnMapping:
    """Read a mapping file.

    Raises:
        ConfigurationError: unreadable, no YAML, or anything wrong in it, with its place.
    """
    place = str(path)
    given = _map(read_yaml(Path(path), 'column mapping'), place)
    mapping: ColumnMapping = parse_section(ColumnMapping, {**given, 'place': place}, f'{place}: ')
    if mapping.joints is None and mapping.gyro is None and mapping.attitude is None:
        wanted = 'give joints, gyro or attitude (a magnetometer alone tells no motion)'
        raise ConfigurationError(place, f'maps no sensor of a motion: {wanted}')
    return mapping
