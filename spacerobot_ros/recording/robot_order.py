"""Joints of a recording in the order of the robot's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import MessageRejectedError, RecordingError
from ..model.robot import Robot
from .messages import joint_order
from .record import JointSeries, Record


def in_robot_order(record: Record, robot: Robot) -> Record:
    """The record with its joints in the robot's order.

    Raises:
        RecordingError: its joints are not the robot's.
    """
    joints, arm = record.joints, robot.arm
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
        raise RecordingError(place, f'{reason} (the robot has {", ".join(wanted)})') from error
