"""A table and its column mapping to a `Record`: named columns, SI, the robot's order and frames.

Rows in which all columns of a sensor are empty were not sampled by it; a row that is empty in
part is refused, and so is a clock that does not go forward.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ...errors import RecordingError
from ...model.robot import Robot
from ...types import Array
from ..messages import NORM_LIMIT
from ..record import UNIT_TOLERANCE, AttitudeSeries, JointSeries, RateSeries, Record
from ..robot_inputs import LACKS_WHEELS, order_of, own_wheels
from .mapped_columns import ColumnReader, spread
from .mapped_inputs import read_efforts, read_inputs
from .mapping import DIRECTIONS, AttitudeColumns, ColumnMapping, JointColumns, MappedColumns
from .table import FORMATS, SampleTable, kind_of, read_table
from .units import ANGLE, ANGULAR_RATE, FORCE, LENGTH, LINEAR_RATE, TORQUE

_JOINT_UNITS = (('position', ANGLE, LENGTH), ('velocity', ANGULAR_RATE, LINEAR_RATE))
_MAY_LACK = ('position', 'velocity', 'effort', 'enabled')  # what a joint may have no sensor for


def read_mapped(
    path: Path, robot: Robot | None, mapping: ColumnMapping, *, is_joined: bool = False
) -> Record:
    """Read a CSV, JSON or npz file.

    Args:
        path: The file.
        robot: Gives the joints' names and order; None: those of the mapping.
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
    if robot is not None and mapping.wheels:
        _check_wheels(mapping.wheels, robot)
    table = read_table(path, kind, mapping.rows, mapping.delimiter, mapping.header)
    table = _derived(table, mapping)
    reader = _Reader(table, mapping, is_joined)
    joints = reader.joints(mapping.joints, robot, _MAY_LACK) if mapping.joints else None
    rates = reader.rates(mapping.gyro, mapping.gyro.time) if mapping.gyro else None
    attitudes = reader.attitudes(mapping.attitude) if mapping.attitude else None
    return Record(
        joints=joints,
        rates=rates if rates is None or attitudes is None else rates.completed(attitudes),
        attitudes=attitudes,
        wheels=reader.joints(mapping.wheels) if mapping.wheels else None,
        inputs=read_inputs(reader, mapping, robot),
        source=str(path),
        notes=tuple(reader.notes),
    )


def _check_wheels(section: JointColumns, robot: Robot) -> None:
    """Refuse rates that lack some of the robot's own wheels: all would be ignored."""
    own = own_wheels(robot)
    if not own:
        raise RecordingError(section.place, f'{LACKS_WHEELS}: name them there, or leave this out')
    if set(own) - set(section.names):
        raise RecordingError(
            f'{section.place}.names',
            f'must have all of robot.servicer_wheels.joints ({", ".join(own)}), '
            f'got {", ".join(section.names)}',
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


class _Reader(ColumnReader):
    """Reads the sections of a mapping from a table."""

    def joints(
        self, section: JointColumns, robot: Robot | None = None, may_lack: Sequence[str] = ()
    ) -> JointSeries:
        """Joints in the robot's order; without a robot, as wheels, in the mapping's."""
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
                parts[key] = self.values(columns, quantities)
        passive = in_amperes = np.zeros(len(names), dtype=bool)
        if section.effort is not None:
            quantities = [FORCE if s else TORQUE for s in slides]
            efforts, passive, in_amperes = read_efforts(
                self, section.effort, quantities, names, robot
            )
            parts |= efforts
        stamps, arrays = self.sampled(section.place, section.time, parts, may_lack)
        samples: dict[str, Any] = {key: values[:, order] for key, values in arrays.items()}
        off = np.tile(passive[order], (len(stamps), 1))
        off |= samples.pop('enabled', np.ones_like(off)) == 0.0
        samples.setdefault('position', np.zeros(off.shape))  # of a wheel without an encoder
        return JointSeries(
            tuple(names[i] for i in order),
            stamps,
            **samples,
            unpowered=off if off.any() else None,
            in_amperes=tuple(names[i] for i in order if in_amperes[i]),
        )

    def rates(self, section: MappedColumns, time: MappedColumns | None) -> RateSeries:
        """The gyro, of all axes or some."""
        values = self.values(section, [ANGULAR_RATE] * 3)
        given = [i for i, name in enumerate(spread(section.columns, 3, section.place)) if name]
        stamps, arrays = self.sampled(section.place, time, {'rate': values[:, given]})
        omega = np.full((len(stamps), 3), np.nan)
        omega[:, given] = arrays['rate']
        if len(given) < len('xyz'):
            self.notes.append(f'the gyro measures {", ".join("xyz"[i] for i in given)} alone')
        return RateSeries(stamps, omega)

    def attitudes(self, section: AttitudeColumns) -> AttitudeSeries:
        """The star tracker."""
        quantities = {'rpy': [ANGLE] * 3, 'yaw': [ANGLE]}.get(section.order, [''] * 4)
        raw = self.values(section, quantities)
        stamps, arrays = self.sampled(section.place, section.time, {'attitude': raw})
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
                f'{self.table.source}: attitude, sample {row}',
                f'not a unit quaternion: its norm is {norms[row]:.6g}',
            )
        if excess[row] > UNIT_TOLERANCE:
            self.notes.append(f'quaternions normalized (norms off by up to {excess[row]:.2g})')
        return np.asarray(q / norms[:, None])
