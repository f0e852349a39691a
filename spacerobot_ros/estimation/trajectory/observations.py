"""Records as filters use them: what is needed is there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...errors import RecordingError
from ...formats import counted
from ...model.robot import Robot
from ...recording.faults.joint_limits import with_stops
from ...recording.faults.thresholds import FEWEST_SAMPLES
from ...recording.record import Record


def observed(record: Record, robot: Robot) -> Record:
    """The record without the sensors that say nothing of this robot's motion, its stops marked.

    Raises:
        RecordingError: no joints, too few samples, or no body rate where the base is free.
    """
    joints = record.joints
    if joints is None:
        raise RecordingError('/joint_states', 'is missing: without joints there is no motion')
    if len(joints) < FEWEST_SAMPLES:
        raise RecordingError(
            '/joint_states',
            f'has {counted(len(joints), "sample")}; a diagnosis needs {FEWEST_SAMPLES} or more',
        )
    record = with_stops(record, robot)
    if not robot.is_free:
        return replace(record, zero_ns=record.origin_ns, rates=None, attitudes=None)
    if record.rates is None and record.attitudes is None:
        raise RecordingError(
            '/imu/data and /attitude',
            'are both missing: the motion of a free base is not seen (robot.base: fixed?)',
        )
    return record


def refuse_unbalanced(records: Sequence[Record], robot: Robot) -> None:
    """Refuse recordings that can not be judged together.

    Raises:
        RecordingError: a free base, or no efforts.
    """
    for record in records:
        if robot.is_free or record.effort is None:
            why = 'a free base' if robot.is_free else 'no efforts'
            raise RecordingError(
                record.source or 'recordings',
                f'has {why}: recordings are judged together, or compared, where the torques of a '
                'fixed base are measured; diagnose this one alone',
            )
