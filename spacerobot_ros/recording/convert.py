"""A table and its column mapping to a `Record`: named columns, SI, the robot's order and frames.

Rows in which all columns of a sensor are empty were not sampled by it; a row that is empty in
part is refused, and so is a clock that does not go forward.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from ..model.robot import Robot
from ..types import Array, IntArray
from .mapping import (
    DIRECTIONS,
    QUATERNION_ORDERS,
    AttitudeColumns,
    ColumnMapping,
    Columns,
    JointColumns,
)
from .record import UNIT_TOLERANCE, AttitudeSeries, JointSeries, RateSeries, Record
from .table import FORMATS, Table, read_table
from .units import ANGLE, ANGULAR_RATE, FORCE, LENGTH, LINEAR_RATE, TIME, TORQUE, si_size

BoolArray = NDArray[np.bool_]
T = TypeVar('T')
NORM_LIMIT = 1e-3  # a quaternion further from unit norm is a fault, not rounding


def read_mapped(path: Path, robot: Robot, mapping: ColumnMapping) -> Record:
    """Read a CSV, JSON or npz file.

    Args:
        path: The file.
        robot: Gives the joints' names and order.
        mapping: Where the sensors stand in it.

    Raises:
        RecordingError: unreadable, a column that is missing or no number, an unknown unit, joints
            that are not the robot's, or a clock that goes backwards; the place is named.
    """
    kind = mapping.format or path.suffix.removeprefix('.').lower()
    if kind not in FORMATS:
        raise RecordingError(
            f'{mapping.source}: format', f'is missing, and {path.name!r} does not tell it'
        )
    table = _derived(read_table(path, kind, mapping.rows, mapping.delimiter), mapping)
    notes: list[str] = [f'columns by {mapping.source}']
    gyro, attitude = mapping.gyro, mapping.attitude
    return Record(
        joints=_joints(table, mapping, mapping.joints, notes, robot) if mapping.joints else None,
        rates=_rates(table, mapping, gyro.time, gyro.columns, notes) if gyro else None,
        attitudes=_attitudes(table, mapping, attitude, notes) if attitude else None,
        wheels=_joints(table, mapping, mapping.wheels, notes) if mapping.wheels else None,
        source=str(path),
        notes=tuple(notes),
    )


def _derived(table: Table, mapping: ColumnMapping) -> Table:
    """The table with its rows selected, its integers signed and its derived columns added."""
    for name, wanted in mapping.select.items():
        table = table.where(name, wanted)
    for name, bits in mapping.twos_complement.items():
        half = 2.0 ** (bits - 1)
        values = (table.numbers(name) + half) % (2.0 * half) - half
        table = table.with_column(name, values)
    for name, terms in mapping.derived.items():
        total: Array | float = 0.0
        for term in terms:
            factor = table.numbers(term.times) if term.times else 1.0
            total = total + term.scale * table.numbers(term.column) * factor
        table = table.with_column(name, np.asarray(total))
    return table


def _joints(
    table: Table,
    mapping: ColumnMapping,
    section: JointColumns,
    notes: list[str],
    robot: Robot | None = None,
) -> JointSeries:
    """Joints in the robot's order; wheels, without a robot, in the mapping's."""
    place = f'{mapping.source}: {"joints" if robot else "wheels"}'
    names = section.names
    order = list(range(len(names)))
    slides = np.zeros(len(names), dtype=bool)
    if robot is not None:
        arm = robot.joints[: robot.n_joints - robot.rotor_count]
        order = joint_order(names, arm, f'{place}.names')
        slides = np.array([robot.bodies[1 + arm.index(name)].is_prismatic for name in names])
    parts: dict[str, Array] = {}
    for key, turning, sliding in (
        ('position', ANGLE, LENGTH),
        ('velocity', ANGULAR_RATE, LINEAR_RATE),
        ('effort', TORQUE, FORCE),
    ):
        columns: Columns | None = getattr(section, key)
        if columns is not None:
            quantities = [sliding if s else turning for s in slides]
            parts[key] = _values(table, columns, quantities)
    stamps, arrays = _sampled(table, mapping, section.time, parts, notes, place)
    ordered = {key: values[:, order] for key, values in arrays.items()}
    zero = np.zeros((len(stamps), len(names)))  # of a wheel without an encoder
    return JointSeries(
        tuple(names[i] for i in order),
        stamps,
        ordered.get('position', zero),
        ordered.get('velocity'),
        ordered.get('effort'),
    )


def joint_order(names: tuple[str, ...], wanted: tuple[str, ...], place: str) -> list[int]:
    """Where each wanted joint stands among the given ones.

    Raises:
        RecordingError: a joint is missing, foreign or given twice.
    """
    missing = [name for name in wanted if name not in names]
    foreign = [name for name in names if name not in wanted]
    if missing or foreign or len(names) != len(wanted):
        parts = [f'lacks {", ".join(missing)}'] if missing else []
        parts += [f'has foreign {", ".join(foreign)}'] if foreign else []
        raise RecordingError(
            place,
            f'{" and ".join(parts) or "one appears twice"} (the robot has {", ".join(wanted)})',
        )
    return [names.index(name) for name in wanted]


def _rates(
    table: Table, mapping: ColumnMapping, time: Columns | None, columns: Columns, notes: list[str]
) -> RateSeries:
    values = _values(table, columns, [ANGULAR_RATE] * 3)
    stamps, arrays = _sampled(table, mapping, time, {'rate': values}, notes, columns.place)
    return RateSeries(stamps, arrays['rate'])


def _attitudes(
    table: Table, mapping: ColumnMapping, section: AttitudeColumns, notes: list[str]
) -> AttitudeSeries:
    columns = section.columns
    if section.order in QUATERNION_ORDERS:
        raw = _values(table, columns, [''] * 4)
        raw = np.roll(raw, -1, axis=1) if section.order == 'wxyz' else raw
    else:
        raw = _values(table, columns, [ANGLE] * (3 if section.order == 'rpy' else 1))
    parts = {'attitude': raw}
    stamps, arrays = _sampled(table, mapping, section.time, parts, notes, columns.place)
    q = arrays['attitude']
    if section.order in QUATERNION_ORDERS:
        q = _normalised(q, f'{table.source}: attitude', notes)
    else:
        q = _from_angles(q)
    if section.maps != DIRECTIONS[0]:
        q = q * np.array([-1.0, -1.0, -1.0, 1.0])
    return AttitudeSeries(stamps, q)


def _normalised(q: Array, place: str, notes: list[str]) -> Array:
    norms = np.linalg.norm(q, axis=1)
    excess = np.abs(norms - 1.0)
    row = int(np.argmax(excess))
    if excess[row] > NORM_LIMIT:
        raise RecordingError(
            f'{place}, sample {row}', f'not a unit quaternion: its norm is {norms[row]:.6g}'
        )
    if excess[row] > UNIT_TOLERANCE:
        notes.append(f'quaternions normalised (norms off by up to {excess[row]:.2g})')
    return np.asarray(q / norms[:, None])


def _from_angles(angles: Array) -> Array:
    """(N, 4) xyzw of fixed-axis roll, pitch, yaw (N, 3), or of yaw alone (N, 1): Rz Ry Rx."""
    half = 0.5 * (angles if angles.shape[1] == 3 else np.pad(angles, ((0, 0), (2, 0))))
    (cr, cp, cy), (sr, sp, sy) = np.cos(half).T, np.sin(half).T
    return np.column_stack(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    )


def _values(table: Table, columns: Columns, quantities: list[str]) -> Array:
    """(N, k) in SI, NaN where a cell is empty; k = number of quantities ('': a pure number)."""
    k = len(quantities)
    raw = [table.numbers(name) for name in columns.columns]
    lengths = {len(values) for values in raw}
    if len(lengths) > 1:
        raise RecordingError(columns.place, f'columns of different lengths: {sorted(lengths)}')
    values = np.hstack(raw)
    if values.shape[1] != k:
        raise RecordingError(columns.place, f'has {values.shape[1]} columns, expected {k}')
    units = _spread(columns.unit, k, f'{columns.place}.unit')
    sizes = np.array(
        [
            si_size(unit, quantity, f'{columns.place}.unit') if quantity else 1.0
            for unit, quantity in zip(units, quantities, strict=True)
        ]
    )
    sign = np.array(_spread(columns.sign, k, f'{columns.place}.sign'))
    offset = np.array(_spread(columns.offset, k, f'{columns.place}.offset'))
    return np.asarray((sign * values + offset) * sizes)


def _spread(given: tuple[T, ...], size: int, place: str) -> list[T]:
    values = list(given) * size if len(given) == 1 else list(given)
    if len(values) != size:
        raise RecordingError(place, f'has {len(given)} entries, expected 1 or {size}')
    return values


def _sampled(
    table: Table,
    mapping: ColumnMapping,
    own_time: Columns | None,
    parts: dict[str, Array],
    notes: list[str],
    place: str,
) -> tuple[IntArray, dict[str, Array]]:
    """Stamps and values of the rows that were sampled."""
    time = own_time or mapping.time
    if time is None:
        raise RecordingError(f'{mapping.source}: time', 'is missing')
    seconds = _values(table, time, [TIME])[:, 0]
    for key, values in parts.items():
        if len(values) != len(seconds):
            raise RecordingError(
                f'{place}: {key}', f'{len(values)} samples, but {len(seconds)} sample times'
            )
    everything = np.hstack(list(parts.values()))
    missing = np.isnan(everything)
    empty = np.asarray(missing.all(axis=1))
    _refuse(table, missing.any(axis=1) & ~empty, f'{place}: some of its columns are empty')
    _refuse(table, np.isnan(seconds) & ~empty, f'{time.place}: the time is empty')
    kept = np.flatnonzero(~empty)
    if not len(kept):
        raise RecordingError(table.source, f'no sample of {place}')
    if empty.any():
        notes.append(f'{place}: sampled in {len(kept)} of {len(empty)} rows')
    stamps = _nanoseconds(seconds[kept], lambda i: table.row(int(kept[i])))
    return stamps, {key: values[kept] for key, values in parts.items()}


def _refuse(table: Table, bad: BoolArray, reason: str) -> None:
    if bad.any():
        raise RecordingError(table.row(int(np.argmax(bad))), reason)


def _nanoseconds(seconds: Array, row: Callable[[int], str]) -> IntArray:
    if np.max(np.abs(seconds)) > 9e9:  # a 64-bit stamp holds 9.2e9 s
        index = int(np.argmax(np.abs(seconds)))
        raise RecordingError(row(index), f'{seconds[index]:g} s is no time: is its unit right?')
    stamps = np.round(seconds * 1e9).astype(np.int64)
    steps = np.diff(stamps)
    if np.any(steps <= 0):
        index = int(np.argmax(steps <= 0)) + 1
        back = -steps[index - 1] / 1e9
        what = f'jumps back by {back:g} s' if back else 'stands still'
        raise RecordingError(row(index), f'the clock {what} at {seconds[index]:.9g} s')
    return stamps


def in_robot_order(record: Record, robot: Robot) -> Record:
    """The record with its joints in the robot's order.

    Raises:
        RecordingError: its joints are not the robot's.
    """
    joints = record.joints
    arm = robot.joints[: robot.n_joints - robot.rotor_count]
    if joints is None or joints.names == arm:
        return record
    order = joint_order(joints.names, arm, f'{record.source}: joints')
    velocity, effort = (
        None if v is None else v[:, order] for v in (joints.velocity, joints.effort)
    )
    return replace(
        record,
        joints=JointSeries(arm, joints.stamp_ns, joints.position[:, order], velocity, effort),
    )
