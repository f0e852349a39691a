"""What each channel reads: range, steps, saturation, and its noise against what is stated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...estimation.noise_levels import fourth_difference_std, unseen_turns
from ...model.body import joint_unit
from ...model.robot import Robot
from ...model.robot_settings import SensorSettings
from ...recording.faults.held_readings import runs
from ...recording.record import Record
from ...types import Array, BoolArray

ROUNDING = float(np.sqrt(12.0))
"""Step of a scale by the standard deviation of its rounding."""
_RUN = 3  # equal readings in a row at an extreme
_BEFORE = 6  # samples before them that say how they would have gone on
_BEYOND = 25.0  # noise or steps: five times what the parabola makes of them
_AT_LIMIT = 0.999  # of the URDF's effort limit
_SAME = 1e-9  # of the range
_REPEATED = 0.5  # share of distinct readings below which steps are the scale's and not chance


@dataclass(frozen=True, slots=True)
class Reading:
    """One column of a sensor.

    Args:
        channel: Such as `joint_velocity/joint_2`.
        unit: SI.
        lowest: Smallest reading. highest: Largest one.
        step: Of its scale; 0 where it is finer than the noise.
        saturated: Share of the samples at an end of its range, or at the URDF's effort limit.
        noise: White noise of one sample that the readings show, that of rounding at the least.
        stated: The same as the robot file states it; None where it does not, or without one.
    """

    channel: str
    unit: str
    lowest: float
    highest: float
    step: float
    saturated: float
    noise: float
    stated: float | None


def readings(record: Record, robot: Robot | None) -> tuple[Reading, ...]:
    """Of every column of every sensor."""
    return tuple(_readings(record, robot))


def _readings(record: Record, robot: Robot | None) -> Iterator[Reading]:
    sensors = None if robot is None else robot.sensors
    limits = None if robot is None else robot.effort_limits
    joints = () if record.joints is None else record.joints.names
    for name, unit, values, names in (
        ('joint_position', 'rad', record.q, joints),
        ('joint_velocity', 'rad/s', record.qd, joints),
        ('joint_effort', 'N m', record.effort, joints),
        ('gyro', 'rad/s', record.omega, 'xyz'),
        ('attitude', 'rad', unseen_turns(record), 'xyz'),
    ):
        if values is None or not len(values):
            continue
        for i, axis in enumerate(names):
            if name == 'gyro' and i not in record.gyro_axes:
                continue
            column = values[:, i]
            if np.isfinite(column).all():
                most = np.inf if limits is None or name != 'joint_effort' else limits[i]
                stated = None if sensors is None else _stated(sensors, name, i)
                is_raw = name != 'attitude'  # turns are made of quaternions
                own = _unit_of(unit, robot, axis) if names is joints else unit
                yield _reading(f'{name}/{axis}', own, column, stated, most, is_raw)


def _unit_of(unit: str, robot: Robot | None, joint: str) -> str:
    """Of a joint's readings; without a robot file nobody knows whether it slides."""
    return joint_unit(unit) if robot is None else robot.unit_of(unit, joint)


def _reading(
    channel: str, unit: str, values: Array, stated: float | None, most: float, is_raw: bool
) -> Reading:
    step = _step(values) if is_raw else 0.0
    noise = max(fourth_difference_std(values[:, None]), step / ROUNDING)
    saturated = 0.0
    if is_raw and not channel.startswith('joint_position'):  # an angle has no end of its scale
        at_end = _cut_off(values, max(noise, step)) | (np.abs(values) >= _AT_LIMIT * most)
        saturated = float(np.mean(at_end))
    low, high = float(values.min()), float(values.max())
    return Reading(channel, unit, low, high, step, saturated, noise, stated)


def _stated(sensors: SensorSettings, channel: str, i: int) -> float | None:
    std = getattr(sensors, f'{channel}_std')
    return std[i] if isinstance(std, tuple) else std


def _step(values: Array) -> float:
    """Smallest step between readings where they repeat themselves, as those of a scale do."""
    distinct = np.unique(values)
    if not 1 < len(distinct) < _REPEATED * len(values):
        return 0.0
    steps = np.diff(distinct)
    return float(steps[steps > _SAME * float(np.ptp(values))].min(initial=np.inf))


def _cut_off(values: Array, blur: float) -> BoolArray:
    """(N,) whether a reading stands at an end of the range that it would have gone beyond.

    A run of equal readings at an extreme is one where the parabola through the samples before it,
    or after it, goes on beyond. What turns back by itself, or comes to rest there, does not.
    """
    out = np.zeros(len(values), dtype=bool)
    for sign in (1.0, -1.0):
        y = sign * values
        for first, after in runs(y == y.max()):
            if after - first < _RUN:
                continue
            sides = (y[max(first - _BEFORE, 0) : first], y[after : after + _BEFORE][::-1])
            beyond = max(_continued(side) for side in sides) - y[first]
            out[first:after] |= beyond > _BEYOND * blur
    return out


def _continued(before: Array) -> float:
    """Value of the parabola through samples where a run that follows them has its third one."""
    if len(before) < _BEFORE:
        return -np.inf
    steps = np.arange(-_BEFORE, 0.0)
    return float(np.polyval(np.polyfit(steps, before, 2), _RUN - 1.0))
