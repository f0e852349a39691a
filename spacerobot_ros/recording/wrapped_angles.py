"""Angles that begin anew after a turn, as encoders and drivers of continuous joints log them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model.robot import Robot
from ..types import Array, BoolArray
from .gaps import longest_pause
from .record import Record

_TURN = 2.0 * np.pi
_WHOLE = 1.001  # turns that all readings lie within, rounding included
_AMBIGUOUS = 0.25  # turns from sample to sample: twice as far either way round would be as near
_BAD = 0.01  # of the samples, that may be so by a fault


def with_turns_counted(record: Record, robot: Robot) -> Record:
    """The record with angles that go on where a joint goes round, which its notes say.

    An angle is of one turn where its readings lie within one, some follow each other by almost a
    turn, and hardly any by much with these taken back: a joint that turns by a quarter and more
    between samples stays as it was logged.

    Args:
        record: Joints in the robot's order.
        robot: Tells joints that turn from those that slide.
    """
    joints = record.joints
    if joints is None or len(joints) < 2:
        return record
    steps = np.diff(record.joint_time)
    is_near = steps <= longest_pause(record.joint_time)
    whole, position = [], joints.position.copy()
    for j, name in enumerate(joints.names):
        unwrapped = np.unwrap(position[:, j])
        turns = robot.unit_of('N m', name) == 'N m'
        if turns and _is_of_one_turn(position[:, j], unwrapped, is_near):
            position[:, j] = unwrapped
            whole.append(name)
    if not whole:
        return record
    note = f'{", ".join(whole)}: angles begin anew after a turn: turns counted'
    return record.corrected({'joints': replace(joints, position=position)}, note)


def _is_of_one_turn(angle: Array, unwrapped: Array, is_near: BoolArray) -> bool:
    """Whether an angle (N,) is what is left of another (N,) without its turns."""
    lowest, highest = np.quantile(angle, (0.5 * _BAD, 1.0 - 0.5 * _BAD))
    began_anew = is_near & (np.abs(np.diff(angle)) > 0.5 * _TURN)
    if highest - lowest > _WHOLE * _TURN or not began_anew.any():
        return False
    is_far = np.abs(np.diff(unwrapped)) > _AMBIGUOUS * _TURN
    return bool(np.mean(is_far[is_near]) < _BAD and np.mean(is_far[began_anew]) < 0.5)
