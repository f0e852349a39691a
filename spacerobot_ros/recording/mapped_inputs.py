"""Measured inputs of a table: commands to thrusters, a base wrench, a magnetic field, positions.

Each becomes an `InputSeries` of the record under its own name. What can not be one is refused
here: columns that never change, thrusters that the robot does not have, commands beyond 0 to 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import RecordingError
from ..model.robot import Robot
from ..types import Array
from .mapped_columns import ColumnReader, spread
from .mapping import ColumnMapping, MappedColumns
from .robot_inputs import EXTRA
from .series import InputSeries
from .units import FIELD, FORCE, LENGTH, SI_UNITS, TORQUE

_XYZ = ('x', 'y', 'z')
INPUTS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    'base_wrench': (
        tuple(f'{what}_{axis}' for what in ('force', 'torque') for axis in _XYZ),
        (FORCE,) * 3 + (TORQUE,) * 3,
    ),
    'magnetic_field': (_XYZ, (FIELD,) * 3),
    'base_position': (_XYZ, (LENGTH,) * 3),
}
"""Columns and quantities of inputs whose meaning is known, beside the thrusters' commands."""


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
        section = mapping.thrusters
        commands = series_of(
            reader, section.command, section.time, section.names, ('',) * len(section.names)
        )
        out['thrusters'] = commands
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
