"""Efforts and measured inputs of a table by their mapping.

Efforts are torques, currents, of motors that are off or are none; what the mapping says of them
must not contradict what the robot file says (docs/data.md). Inputs are commands to thrusters, a
base wrench, a magnetic field, positions.

Each becomes an `InputSeries` of the record under its own name. What can not be one is refused
here: columns that never change, thrusters that the robot does not have, commands beyond 0 to 1.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...errors import RecordingError
from ...model.robot import Robot
from ...types import Array, BoolArray
from ..robot_inputs import EXTRA
from ..series import InputSeries
from .mapped_columns import ColumnReader, spread
from .mapping import ColumnMapping, EffortColumns, MappedColumns
from .units import CURRENT, INPUTS, SI_UNITS, is_current


def check_kinds(place: str, robot: Robot | None, columns: Iterable[tuple[str, str, str]]) -> None:
    """Refuse efforts of another kind than the robot file says.

    Args:
        place: Where the mapping says it.
        robot: Its `effort_kinds` count; without one nothing is contradicted.
        columns: Joint, its kind ('' where the mapping says none) and the unit of each.

    Raises:
        RecordingError: another kind, a current of a joint whose effort is none, or none of one
            whose effort is.
    """
    if robot is None:
        return
    believed = dict(zip(robot.arm, robot.effort_kinds, strict=True))
    for name, stated_kind, unit in columns:
        kind = believed.get(name, 'motor')
        if stated_kind not in ('', kind):
            raise RecordingError(
                f'{place}.kind',
                f'{name}: {stated_kind}, but robot.effort_kind of the robot file says {kind}',
            )
        if is_current(unit) and kind != 'current':
            raise RecordingError(
                f'{place}.unit',
                f'{name}: {unit!r} is a current, but robot.effort_kind of the robot file says '
                f'{kind}: state current there, and robot.motor_constant',
            )
        if kind == 'current' and not is_current(unit):
            raise RecordingError(
                f'{place}.unit',
                f'{name}: {unit!r} is no current, but robot.effort_kind of the robot file says '
                'current: give the column in A, or state motor there',
            )


class MappedEfforts(NamedTuple):
    """Efforts of k joints in the order of a mapping.

    Args:
        parts: Columns to be sampled with the joints: `effort` [N m, N; A of `in_amperes`] and
            `enabled`, each (N, k) and NaN throughout where the mapping has none.
        passive: (k,) joints without a motor.
        in_amperes: (k,) joints whose currents nobody makes torques.
    """

    parts: dict[str, Array]
    passive: BoolArray
    in_amperes: BoolArray


def read_efforts(
    reader: ColumnReader,
    columns: EffortColumns,
    quantities: Sequence[str],
    names: Sequence[str],
    robot: Robot | None,
) -> MappedEfforts:
    """Read the columns; currents become torques where the robot file states how.

    Args:
        reader: Of the table.
        columns: Where the efforts stand.
        quantities: (k,) torque or force.
        names: (k,) the joints.
        robot: Whose joints they are; None: wheels.

    Raises:
        RecordingError: an effort of a joint that has no motor, or what contradicts the robot file.
    """
    k, place = len(names), columns.place
    given = spread(columns.columns, k, place)
    units = spread(columns.unit, k, f'{place}.unit')
    stated_kind = spread(columns.kind or ('',), k, f'{place}.kind')
    currents = np.array([is_current(unit) for unit in units])
    passive = np.array([not column for column in given])
    for name in robot.passive_joints if robot else ():
        if not passive[names.index(name)]:
            raise RecordingError(
                f'{place}.columns',
                f'{name} has an effort, but is one of robot.passive_joints: give null',
            )
    stated = zip(names, stated_kind, units, passive, strict=True)
    check_kinds(place, robot, [(name, kind, unit) for name, kind, unit, off in stated if not off])
    parts = {}
    if not passive.all():
        kinds = zip(currents, quantities, strict=True)
        parts['effort'] = reader.values(columns, [CURRENT if c else q for c, q in kinds])
    if any(columns.enabled):
        enabled = [reader.table.numbers(c) if c else np.nan for c in columns.enabled]
        rows = max(map(np.size, enabled))
        spaced = [np.broadcast_to(np.ravel(e), rows) for e in enabled]
        parts['enabled'] = np.column_stack(spread(tuple(spaced), k, f'{place}.enabled'))
    unknown = currents
    if robot is not None and currents.any():
        arm = [robot.arm.index(name) for name in names]
        unknown = currents & np.isin(names, robot.without_constant)
        scale = np.where(currents, robot.known_effort_units[arm], 1.0)
        parts['effort'] = parts['effort'] * scale
        if (currents & ~unknown).any():
            reader.notes.append(f'{place}: currents times robot.motor_constant are the efforts')
    for what, which in (('no motor', passive), ('efforts are currents in A', unknown)):
        if which.any():
            reader.notes.append(f'{", ".join(np.array(names)[which])}: {what}')
    return MappedEfforts(parts, passive, unknown)


def read_inputs(
    reader: ColumnReader, mapping: ColumnMapping, robot: Robot | None
) -> dict[str, InputSeries]:
    """Every input of a mapping.

    Raises:
        RecordingError: one that can not be read, or says nothing.
    """
    out = {}
    for key, (names, quantities) in INPUTS.items():
        section = getattr(mapping, key)
        if section is not None:
            out[key] = series_of(reader, section, section.time, names, quantities)
    for name, section in mapping.extra:
        found = series_of(reader, section, section.time, (name,), ('',))
        units = (str(spread(section.unit or ('',), 1, f'{section.place}.unit')[0]),)
        out[f'{EXTRA}{name}'] = replace(found, units=units)
    if mapping.thrusters is not None:
        section, names = mapping.thrusters, mapping.thrusters.names
        shares = ('',) * len(names)
        out['thrusters'] = series_of(reader, section.command, section.time, names, shares)
    return out


def series_of(
    reader: ColumnReader,
    columns: MappedColumns,
    time: MappedColumns | None,
    names: Sequence[str],
    quantities: Sequence[str],
) -> InputSeries:
    """Columns of one input; those that are null, or empty throughout, are left out.

    Raises:
        RecordingError: unreadable, without a unit, or all of them never change.
    """
    if any(quantities) and not columns.unit:
        raise RecordingError(f'{columns.place}.unit', 'is missing: write the unit of the column')
    values = reader.values(columns, list(quantities))
    stamps, arrays = reader.sampled(columns.place, time, {'values': values}, may_lack=['values'])
    present = np.flatnonzero(~np.all(np.isnan(arrays['values']), axis=0)).tolist()
    kept: Array = arrays['values'][:, present]
    if not np.ptp(kept, axis=0).any():
        raise RecordingError(columns.place, 'never changes: leave out an input that says nothing')
    return InputSeries(
        tuple(names[i] for i in present),
        stamps,
        kept,
        tuple(SI_UNITS[quantities[i]] for i in present),
    )
