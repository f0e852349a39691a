"""A record as its robot takes it: joints in the robot's order, and the known inputs.

Inputs are what acts on the robot's base, and what was measured beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import MessageRejectedError, RecordingError
from ..model.inputs import HeldSignal, Inputs, MeasuredSignal
from ..model.robot import Robot
from ..types import Array
from .messages import joint_order
from .record import JointSeries, Record


def in_robot_order(record: Record, robot: Robot) -> Record:
    """The record with its joints in the robot's order.

    Raises:
        RecordingError: its joints are not the robot's, or a gyro lacks axes.
    """
    joints, arm, rates = record.joints, robot.arm, record.rates
    if rates is not None and len(rates.axes) < len('xyz') and arm and robot.is_free:
        why = f'measures {", ".join("xyz"[i] for i in rates.axes)} alone: a free base with joints'
        raise RecordingError(f'{record.source}: gyro', f'{why} needs all three axes')
    if not arm and (joints is None or not joints.names):
        return _without_joints(record)
    if joints is None or joints.names == arm:
        return record
    order = order_of(joints.names, arm, f'{record.source}: joints')
    columns: dict[str, Any] = {
        name: None if values is None else values[:, order]
        for name, values in (
            ('position', joints.position), ('velocity', joints.velocity),
            ('effort', joints.effort), ('unpowered', joints.unpowered),
        )
    }  # fmt: skip
    return replace(record, joints=replace(joints, names=arm, **columns))


def _without_joints(record: Record) -> Record:
    """The record of a robot without joints, their samples of width zero at its base's."""
    base = [s for s in (record.rates, record.attitudes) if s is not None]
    if not base:
        return record
    stamps = max(base, key=len).stamp_ns
    return replace(record, joints=JointSeries((), stamps, np.zeros((len(stamps), 0))))


def order_of(names: Sequence[str], wanted: tuple[str, ...], place: str) -> list[int]:
    """Where each wanted joint stands among names.

    Raises:
        RecordingError: the names are not the wanted ones.
    """
    try:
        return joint_order(names, wanted)
    except MessageRejectedError as error:
        reason = str(error).removeprefix('joint names: ')
        hold = (
            '; a joint that nobody logs is held by robot.held' if 'foreign' not in reason else ''
        )
        raise RecordingError(
            place, f'{reason} (the robot has {", ".join(wanted) or "none"}{hold})'
        ) from error


LACKS_WHEELS = 'robot.servicer_wheels.joints of the robot file names no wheels'


def own_wheels(robot: Robot) -> list[str]:
    """Joints of the servicer's rotors."""
    return [rotor.joint for rotor in robot.rotors if not rotor.is_target]


def ignored_wheels(robot: Robot, record: Record) -> tuple[str, ...]:
    """A note on wheels that turn in a record and not in its robot, or not all of whose it has."""
    wheels, own = record.wheels, own_wheels(robot)
    if wheels is None or wheels.velocity is None or not np.any(wheels.velocity):
        return ()
    if not own:
        return (f'rates of {", ".join(wheels.names)} are left out: {LACKS_WHEELS}',)
    lacking = ', '.join(name for name in own if name not in wheels.names)
    note = f'rates of wheels are left out: they lack {lacking} of robot.servicer_wheels.joints'
    return (note,) if lacking else ()


EXTRA = 'extra/'
"""Beginning of the names of a record's inputs that a mapping's `extra` made."""
_FEWEST = 2  # samples of wheels
_ROUNDING = 1e-9  # of shares that were divided


def with_inputs(robot: Robot, record: Record) -> Robot:
    """The robot under a record's commands and base wrench, and with what else was measured.

    Raises:
        RecordingError: commands that are not shares, or not those of the robot's thrusters.
    """
    commands, wrench = (record.inputs.get(key) for key in ('thrusters', 'base_wrench'))
    given: dict[str, Any] = {}
    if commands is not None:
        place = f'{record.source}: thrusters'
        order = order_of(commands.names, tuple(t.name for t in robot.thrusters), place)
        values = commands.values[:, order]
        bad = (values < -_ROUNDING) | (values > 1.0 + _ROUNDING)
        if bad.any():
            row, column = np.argwhere(bad)[0].tolist()
            raise RecordingError(
                f'{place}: {robot.thrusters[column].name}',
                f'commands are shares from 0 to 1, got {values[row, column]:.9g} at sample {row}: '
                'give `scale` in the mapping',
            )
        given['commands'] = HeldSignal(commands.seconds(record.origin_ns), values)
    if wrench is not None:
        given['wrench'] = HeldSignal(wrench.seconds(record.origin_ns), wrench.values)
    if (wheels := _own_wheels(robot, record)) is not None:
        given['wheels'] = wheels
    if extra := _extra(record):
        given['extra'] = extra
    is_located = 'base_position' in record.inputs
    if not given and not is_located:
        return robot
    return replace(robot, inputs=Inputs(**given, is_located=is_located))


def _own_wheels(robot: Robot, record: Record) -> MeasuredSignal | None:
    """Momentum of the servicer's rotors by their rates; None where not all are measured."""
    if (rates := wheel_rates(robot, record)) is None or record.wheels is None:
        return None
    time = record.wheels.seconds(record.origin_ns)
    return MeasuredSignal(time, rates @ wheel_axes(robot), 'N m s')


def wheel_rates(robot: Robot, record: Record) -> Array | None:
    """(N, W) rates of the servicer's rotors [rad/s]; None where not all are measured."""
    wheels, names = record.wheels, own_wheels(robot)
    if not names or wheels is None or wheels.velocity is None or len(wheels) < _FEWEST:
        return None
    if set(names) - set(wheels.names):
        return None
    return np.asarray(wheels.velocity[:, [wheels.names.index(name) for name in names]])


def wheel_axes(robot: Robot) -> Array:
    """(W, 3) momentum of the servicer's rotors by their rates, in the base [kg m^2]."""
    rotors = [rotor for rotor in robot.rotors if not rotor.is_target]
    axes = [r.axial_inertia * (r.body.rotation @ r.body.axis) for r in rotors]
    return np.reshape(axes, (-1, 3))


def _extra(record: Record) -> dict[str, MeasuredSignal]:
    """What a mapping's `extra` made of a record."""
    return {
        name.removeprefix(EXTRA): MeasuredSignal(
            series.seconds(record.origin_ns), series.values, series.units[0]
        )
        for name, series in record.inputs.items()
        if name.startswith(EXTRA) and len(series)
    }
