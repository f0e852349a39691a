"""All faults of a record: what is missing, dead, too short, badly timed, or contradicts itself.

What one channel shows of another is compared in `motion_faults` and, with the robot's dynamics,
in `torque_faults`. Small errors of scale, angle and time are physical causes, no faults of data.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...errors import RecordingError
from ...formats import counted
from ...model.robot import Robot
from ..record import JointSeries, Record
from .extras import extra_faults
from .motion_faults import DEGREES, dead_base, find_faults
from .signals import clock_faults, torn_positions
from .thresholds import BEYOND, FAR_BEYOND, FEWEST_SAMPLES, DataFault, in_lines
from .torque_faults import find_torque_faults
from .wheel_faults import wheel_faults


def check_data(record: Record, robot: Robot) -> None:
    """Refuse data from which only wrong conclusions could be drawn.

    Of data whose faults are known only what is missing is refused.

    Raises:
        RecordingError: with every fault in one line.
    """
    missing = in_lines(tuple(_absent(record, robot)))
    faults = missing if record.faults_are_known else data_faults(record, robot)
    if faults:
        remedy = '' if missing else ' (--force-data takes them as they are)'
        what = f'faulty data: {"; ".join(faults)}{remedy}'
        raise RecordingError(record.source or 'data', what)


def with_known_faults(record: Record, robot: Robot) -> Record:
    """The record for a user who takes it as it is; the notes have its faults."""
    notes = (f'{line} (taken as it is, --force-data)' for line in data_faults(record, robot))
    return replace(record, notes=(*record.notes, *notes), faults_are_known=True)


def data_faults(record: Record, robot: Robot | None) -> tuple[str, ...]:
    """Every fault of a record, one line each.

    Args:
        record: As it was read.
        robot: What the model believes; without it what is seen without it.

    Returns:
        The first kind that is found of: missing or dead channels and impossible stamps; channels
        that contradict each other; efforts that are unlike the model's. Empty where there is none.
    """
    for faults in (
        () if robot is None else tuple(_absent(record, robot)),
        tuple(clock_faults(record)) if record.joints is not None else (),
        tuple(torn_positions(record)),
        (*_dead_joints(record.joints), *dead_base(record)),
        find_faults(record),
        () if robot is None else tuple(_in_degrees(record, robot)),
        () if robot is None else wheel_faults(record, robot),
        () if robot is None else find_torque_faults(record, robot),
        tuple(extra_faults(record)),
    ):
        if faults:
            return in_lines(faults)
    return ()


def _absent(record: Record, robot: Robot) -> Iterator[DataFault]:
    joints, place = record.joints, '/joint_states'
    if joints is None and robot.joints:
        yield DataFault('absent', place, 'is missing: without joints nothing is known')
        return
    if joints is None:
        message = 'are both missing: nothing of this robot without joints is seen'
        yield DataFault('absent', '/imu/data and /attitude', message)
        return
    if joints.names != robot.joints:
        message = f'has joints {", ".join(joints.names)}; the robot has {", ".join(robot.joints)}'
        yield DataFault('absent', place, message)
    if len(joints) < FEWEST_SAMPLES:
        message = (
            f'has {counted(len(joints), "sample")}; a diagnosis needs {FEWEST_SAMPLES} or more'
        )
        yield DataFault('short', place, message)
    if robot.is_free and record.rates is None and record.attitudes is None:
        message = 'are both missing: the motion of a free base is not seen (robot.base: fixed?)'
        yield DataFault('absent', '/imu/data and /attitude', message)
    if not robot.is_free and joints.effort is None:
        message = 'no efforts: without torques a fixed base tells nothing of its arm'
        yield DataFault('absent', place, message)


def _dead_joints(joints: JointSeries | None) -> Iterator[DataFault]:
    """Channels that never change, although what they measure does.

    Encoders whose noise is within a step repeat their readings; there a joint at rest may say the
    same throughout. Where no other joint ever repeats one, a joint that does is dead.
    """
    if joints is None:
        return
    still = np.ptp(joints.position, axis=0) == 0.0
    if joints.stopped is not None:
        still &= ~joints.stopped.all(axis=0)
    if joints.velocity is not None:
        still &= np.ptp(joints.velocity, axis=0) == 0.0
    repeats = np.any(np.diff(joints.position[:, ~still], axis=0) == 0.0)
    for name in np.array(joints.names)[still & ~repeats]:
        message = 'never changes: a dead sensor, or a joint to be made fixed in the URDF'
        yield DataFault('constant', f'joint_position/{name}', message)
    if joints.effort is None:
        return
    driven = ~np.isin(joints.names, joints.passive)
    if driven.any() and not np.any(joints.effort):
        yield DataFault('constant', 'joint_torque', 'all efforts are zero: they were not measured')
        return
    for name in np.array(joints.names)[(np.ptp(joints.effort, axis=0) == 0.0) & ~still & driven]:
        message = 'never changes although the joint moves'
        yield DataFault('constant', f'joint_torque/{name}', message)


def _in_degrees(record: Record, robot: Robot) -> Iterator[DataFault]:
    """Positions far beyond the limits of the URDF, all of which are within them as degrees."""
    turns = np.array([robot.unit_of('rad', joint) == 'rad' for joint in robot.arm], dtype=bool)
    largest = np.max(np.abs(robot.position_limits[: len(turns)]), axis=1)
    known = turns & np.isfinite(largest) & (largest > 0.0)
    if record.joints is None or not known.any():
        return
    reach = np.max(np.abs(record.q), axis=0)[known] / largest[known]
    if np.max(reach) > FAR_BEYOND and np.all(reach < BEYOND * DEGREES):
        worst = int(np.argmax(reach))
        limit = float(largest[known][worst])
        message = (
            f'positions reach {reach[worst] * limit:.3g} rad, the limits of the URDF are '
            f'{limit:.3g} rad: degrees instead of radians?'
        )
        yield DataFault('scale', f'joints/{np.array(robot.arm)[known][worst]}', message)
