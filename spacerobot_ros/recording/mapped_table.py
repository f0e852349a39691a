"""A table and its column mapping to a `Record`: named columns, SI, the robot's order and frames.

Rows in which all columns of a sensor are empty were not sampled by it; a row that is empty in
part is refused, and so is a clock that does not go forward.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import RecordingError
from ..model.robot import Robot
from ..types import Array, IntArray
from .effort_kinds import check_kinds
from .gaps import continued
from .mapping import (
    DIRECTIONS,
    AttitudeColumns,
    ColumnMapping,
    EffortColumns,
    JointColumns,
    MappedColumns,
)
from .messages import NORM_LIMIT
from .record import (
    UNIT_TOLERANCE,
    AttitudeSeries,
    JointSeries,
    RateSeries,
    Record,
    shown,
    to_stamps,
)
from .robot_order import order_of
from .table import FORMATS, SampleTable, kind_of, read_table
from .units import (
    ANGLE,
    ANGULAR_RATE,
    CURRENT,
    FORCE,
    LENGTH,
    LINEAR_RATE,
    TIME,
    TORQUE,
    is_current,
    si_size,
)

T = TypeVar('T')
_JOINT_UNITS = (('position', ANGLE, LENGTH), ('velocity', ANGULAR_RATE, LINEAR_RATE))
_MAY_LACK = ('velocity', 'effort')  # what a joint may have no sensor for


def read_mapped(
    path: Path, robot: Robot, mapping: ColumnMapping, *, is_joined: bool = False
) -> Record:
    """Read a CSV, JSON or npz file.

    Args:
        path: The file.
        robot: Gives the joints' names and order.
        mapping: Where the sensors stand in it.
        is_joined: Whether its clock may begin anew, with another run.

    Raises:
        RecordingError: unreadable, a column that is missing or no number, an unknown unit, joints
            that are not the robot's, or a clock that goes backwards; the place is named.
    """
    kind = mapping.format or kind_of(path)
    if kind not in FORMATS:
        raise RecordingError(
            f'{mapping.place}: format', f'is missing, and {path.name!r} does not tell it'
        )
    table = read_table(path, kind, mapping.rows, mapping.delimiter, mapping.header)
    table = _derived(table, mapping)
    reader = _Reader(table, mapping, is_joined)
    return Record(
        joints=reader.joints(mapping.joints, robot) if mapping.joints else None,
        rates=reader.rates(mapping.gyro, mapping.gyro.time) if mapping.gyro else None,
        attitudes=reader.attitudes(mapping.attitude) if mapping.attitude else None,
        wheels=reader.joints(mapping.wheels) if mapping.wheels else None,
        source=str(path),
        notes=tuple(reader.notes),
    )


def _derived(table: SampleTable, mapping: ColumnMapping) -> SampleTable:
    """The table with its rows selected, its integers signed and its derived columns added."""
    for name, wanted in mapping.select:
        table = table.where(name, wanted)
    for name, bits in mapping.twos_complement:
        half = 2.0 ** (bits - 1)
        values = (table.numbers(name) + half) % (2.0 * half) - half
        table = table.with_column(name, values)
    for name, terms in mapping.derived:
        total: Array | float = 0.0
        for term in terms:
            factor = table.numbers(term.times) if term.times else 1.0
            total = total + term.scale * table.numbers(term.column) * factor
        table = table.with_column(name, np.asarray(total))
    return table


class _Reader:
    """Reads the sections of a mapping from a table; collects what is worth a note."""

    def __init__(self, table: SampleTable, mapping: ColumnMapping, is_joined: bool) -> None:
        self._table, self._mapping, self._is_joined = table, mapping, is_joined
        self.notes = [f'columns by {mapping.place}']

    def joints(self, section: JointColumns, robot: Robot | None = None) -> JointSeries:
        """Joints in the robot's order; wheels, without a robot, in the mapping's."""
        names, slides = section.names, np.zeros(len(section.names), dtype=bool)
        order = list(range(len(names)))
        if robot is not None:
            arm = robot.arm
            order = order_of(names, arm, f'{section.place}.names')
            slides = np.array([robot.bodies[1 + arm.index(n)].is_prismatic for n in names])
        parts: dict[str, Array] = {}
        for key, turning, sliding in _JOINT_UNITS:
            columns: MappedColumns | None = getattr(section, key)
            if columns is not None:
                quantities = [sliding if s else turning for s in slides]
                parts[key] = self._values(columns, quantities)
        if section.effort is not None:
            quantities = [FORCE if s else TORQUE for s in slides]
            parts['effort'] = self._efforts(section.effort, quantities, names, robot)
        stamps, arrays = self._sampled(
            section.place, section.time, parts, may_lack=_MAY_LACK if robot else ()
        )
        ordered = {key: values[:, order] for key, values in arrays.items()}
        zero = np.zeros((len(stamps), len(names)))  # of a wheel without an encoder
        return JointSeries(
            tuple(names[i] for i in order),
            stamps,
            ordered.get('position', zero),
            ordered.get('velocity'),
            ordered.get('effort'),
        )

    def _efforts(
        self,
        columns: EffortColumns,
        quantities: list[str],
        names: Sequence[str],
        robot: Robot | None,
    ) -> Array:
        """(N, k) efforts in SI, currents times the motor constants."""
        units = _spread(columns.unit, len(names), f'{columns.place}.unit')
        currents = [is_current(unit) for unit in units]
        said = _spread(columns.kind or ('',), len(names), f'{columns.place}.kind')
        check_kinds(columns.place, robot, zip(names, said, units, strict=True))
        values = self._values(
            columns, [CURRENT if c else q for c, q in zip(currents, quantities, strict=True)]
        )
        if robot is None or not any(currents):
            return values
        constants = dict(zip(robot.arm, robot.effort_units.tolist(), strict=True))
        self.notes.append(f'{columns.place}: currents times robot.motor_constant are the efforts')
        return values * [constants[n] if c else 1.0 for n, c in zip(names, currents, strict=True)]

    def rates(self, section: MappedColumns, time: MappedColumns | None) -> RateSeries:
        """The gyro."""
        values = self._values(section, [ANGULAR_RATE] * 3)
        stamps, arrays = self._sampled(section.place, time, {'rate': values})
        return RateSeries(stamps, arrays['rate'])

    def attitudes(self, section: AttitudeColumns) -> AttitudeSeries:
        """The star tracker."""
        quantities = {'rpy': [ANGLE] * 3, 'yaw': [ANGLE]}.get(section.order, [''] * 4)
        raw = self._values(section, quantities)
        stamps, arrays = self._sampled(section.place, section.time, {'attitude': raw})
        q = arrays['attitude']
        if section.is_quaternion:
            q = self._normalized(np.roll(q, -1, axis=1) if section.order == 'wxyz' else q)
        else:
            q = Rotation.from_euler('xyz' if section.order == 'rpy' else 'z', q).as_quat()
        if section.maps != DIRECTIONS[0]:
            q = q * np.array([-1.0, -1.0, -1.0, 1.0])
        return AttitudeSeries(stamps, q)

    def _normalized(self, q: Array) -> Array:
        norms = np.linalg.norm(q, axis=1)
        excess = np.abs(norms - 1.0)
        row = int(np.argmax(excess))
        if excess[row] > NORM_LIMIT:
            raise RecordingError(
                f'{self._table.source}: attitude, sample {row}',
                f'not a unit quaternion: its norm is {norms[row]:.6g}',
            )
        if excess[row] > UNIT_TOLERANCE:
            self.notes.append(f'quaternions normalized (norms off by up to {excess[row]:.2g})')
        return np.asarray(q / norms[:, None])

    def _values(self, columns: MappedColumns, quantities: list[str]) -> Array:
        """(N, k) in SI, NaN where a cell is empty; k quantities ('': a pure number)."""
        k, place = len(quantities), columns.place
        raw = [self._table.numbers(name) for name in columns.columns if name]
        lengths = {len(values) for values in raw}
        if len(lengths) != 1:
            raise RecordingError(place, f'columns of different lengths: {sorted(lengths)}')
        absent = np.full((lengths.pop(), 1), np.nan)
        given = iter(raw)
        values = np.hstack([next(given) if name else absent for name in columns.columns])
        if values.shape[1] != k:
            raise RecordingError(place, f'has {values.shape[1]} columns, expected {k}')
        units = _spread(columns.unit or ('',), k, f'{place}.unit')
        sizes = [
            si_size(unit, quantity, f'{place}.unit') if quantity else 1.0
            for unit, quantity in zip(units, quantities, strict=True)
        ]
        sign, scale, offset = (
            np.array(_spread(getattr(columns, key), k, f'{place}.{key}'))
            for key in ('sign', 'scale', 'offset')
        )
        return np.asarray((sign * scale * values + offset) * np.array(sizes))

    def _sampled(
        self,
        place: str,
        own_time: MappedColumns | None,
        parts: dict[str, Array],
        may_lack: Sequence[str] = (),
    ) -> tuple[IntArray, dict[str, Array]]:
        """Stamps and values of the rows that were sampled."""
        table, time = self._table, own_time or self._mapping.time
        if time is None:
            raise RecordingError(f'{self._mapping.place}: time', 'is missing')
        seconds = self._values(time, [TIME])[:, 0]
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
        stamps = _nanoseconds(seconds[kept], lambda i: table.row(int(kept[i])))
        return stamps, {key: values[kept] for key, values in parts.items()}


def _missing(values: Array, may_lack: bool) -> NDArray[np.bool_]:
    """Empty cells; not those of a column that is empty throughout, where that may be."""
    missing = np.isnan(values)
    return np.asarray(missing[:, ~missing.all(axis=0)] if may_lack else missing)


def _spread(given: tuple[T, ...], size: int, place: str) -> list[T]:
    values = list(given) * size if len(given) == 1 else list(given)
    if len(values) != size:
        raise RecordingError(place, f'has {len(given)} entries, expected 1 or {size}')
    return values


def _refuse(table: SampleTable, bad: NDArray[np.bool_], reason: str) -> None:
    if bad.any():
        raise RecordingError(table.row(int(np.argmax(bad))), reason)


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
            f'{shown(seconds[index] - seconds[0])} after the first sample',
        )
    return stamps
