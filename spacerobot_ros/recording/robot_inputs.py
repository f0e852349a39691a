"""The known inputs of a record as what acts on the robot's base."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import RecordingError
from ..model.inputs import HeldSignal, Inputs
from ..model.robot import Robot
from .record import Record
from .robot_order import order_of

_ROUNDING = 1e-9  # of shares that were divided


def with_inputs(robot: Robot, record: Record) -> Robot:
    """The robot under a record's commands and base wrench.

    Raises:
        RecordingError: commands that are not shares, or not those of the robot's thrusters.
    """
    commands, wrench = (record.inputs.get(key) for key in ('thrusters', 'base_wrench'))
    given = {}
    if commands is not None:
        place = f'{record.source}: thrusters'
        order = order_of(commands.names, tuple(t.name for t in robot.thrusters), place)
        values = commands.values[:, order]
        bad = (values < -_ROUNDING) | (values > 1.0 + _ROUNDING)
        if bad.any():
            row, column = np.argwhere(bad)[0].tolist()
            raise RecordingError(
                f'{place}: {robot.thrusters[column].name}',
                f'commands are shares from 0 to 1, got {values[row, column]:g} at sample {row}: '
                'give `scale` in the mapping',
            )
        given['commands'] = HeldSignal(commands.seconds(record.origin_ns), values)
    if wrench is not None:
        given['wrench'] = HeldSignal(wrench.seconds(record.origin_ns), wrench.values)
    is_located = 'base_position' in record.inputs
    if not given and not is_located:
        return robot
    return replace(robot, inputs=Inputs(**given, is_located=is_located))
