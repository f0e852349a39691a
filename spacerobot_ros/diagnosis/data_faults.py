"""Faults of the data themselves: with one of them nothing physical is concluded.

What one channel says of another is compared in `recording.faults` (kinematics) and
`recording.torque_faults` (the robot's dynamics). Here: what is missing, dead, too short, or timed
by another clock. Small errors of scale, angle and time are physical causes, and none of these.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import RecordingError
from ..model.robot import Robot
from ..recording.faults import JUMP_PERIODS, DataFault, find_faults
from ..recording.record import AttitudeSeries, JointSeries, RateSeries, Record
from ..recording.torque_faults import find_torque_faults
from ..types import Array, IntArray

FEWEST_SAMPLES = 50
SHORTEST = 2.0  # s; the filter needs a part of it to find the state
_PERIODS = (2e-5, 2.0)  # s; samples closer or farther are not stamped in seconds
_OVERLAP = 0.5  # share of the shorter record that two sensors must have in common
_NEAR, _FEWEST_NEAR = 0.3, 8  # s, samples on each side of a pause that are looked at
_SEEN = 3.0  # of the misfit without a pause: more with it is a jump


def check_data(record: Record, robot: Robot) -> None:
    """Refuse data from which only wrong conclusions could be drawn.

    Raises:
        RecordingError: with every fault in one line.
    """
    faults = data_faults(record, robot)
    if faults:
        raise RecordingError(record.source or 'data', 'faulty data: ' + '; '.join(faults))


def data_faults(record: Record, robot: Robot) -> tuple[str, ...]:
    """Every fault of a record, one line each.

    Args:
        record: As it was read.
        robot: What the model believes.

    Returns:
        The first kind that is found of: missing or dead channels and impossible stamps; channels
        that contradict each other; efforts that are unlike the model's. Empty where there is none.
    """
    faults = tuple(_absent(record, robot)) or tuple(_clocks(record)) or tuple(_dead(record))
    faults = faults or find_faults(record) or find_torque_faults(record, robot)
    return _in_lines(faults)


def _in_lines(faults: tuple[DataFault, ...]) -> tuple[str, ...]:
    """One line a message, with all the places that it is said of."""
    places: dict[str, list[str]] = {}
    for fault in faults:
        places.setdefault(fault.message, []).append(fault.place)
    return tuple(f'{", ".join(where)}: {message}' for message, where in places.items())


def _absent(record: Record, robot: Robot) -> Iterator[DataFault]:
    joints = record.joints
    if joints is None:
        yield DataFault('absent', '/joint_states', 'is missing: without joints nothing is known')
        return
    if joints.names != robot.joints:
        yield DataFault(
            'absent',
            '/joint_states',
            f'has joints {", ".join(joints.names)}; the robot has {", ".join(robot.joints)}',
        )
    if len(joints.stamp_ns) < FEWEST_SAMPLES:
        count = len(joints.stamp_ns)
        message = f'has {count} samples; a diagnosis needs {FEWEST_SAMPLES} or more'
        yield DataFault('short', '/joint_states', message)
    if robot.is_free and record.rates is None and record.attitudes is None:
        message = 'are both missing: the motion of a free base is not seen (robot.base: fixed?)'
        yield DataFault('absent', '/imu/data and /attitude', message)
    if not robot.is_free and joints.effort is None:
        message = 'no efforts: without torques a fixed base tells nothing of its arm'
        yield DataFault('absent', '/joint_states', message)


def _clocks(record: Record) -> Iterator[DataFault]:
    """Stamps of another unit, of another clock, or of a clock that was set meanwhile."""
    sensors = _sensors(record)
    for place, stamps, values in sensors:
        seconds = (stamps - stamps[0]) / 1e9
        if len(seconds) < 2:
            continue
        period = float(np.median(np.diff(seconds)))
        if not _PERIODS[0] < period < _PERIODS[1]:
            message = f'a sample every {period:.3g} s: the stamps are not in seconds'
            yield DataFault('clock', place, message)
        else:
            yield from _jumps(place, seconds, values)
    (_, first, _), *others = sensors
    if (first[-1] - first[0]) / 1e9 < SHORTEST:
        lasted = (first[-1] - first[0]) / 1e9
        message = f'the record lasts {lasted:.3g} s; a diagnosis needs {SHORTEST:g} s or more'
        yield DataFault('short', 'joints', message)
    for place, stamps, _ in others:
        shared = min(first[-1], stamps[-1]) - max(first[0], stamps[0])
        if shared < _OVERLAP * min(first[-1] - first[0], stamps[-1] - stamps[0]):
            apart = (stamps[0] - first[0]) / 1e9
            message = f'begins {apart:.6g} s after the joints: their clocks are not the same'
            yield DataFault('clock', place, message)


def _sensors(record: Record) -> list[tuple[str, IntArray, Array]]:
    """Place, stamps and smooth values of every sensor, the joints first."""
    out = []
    if record.joints is not None:
        out.append(('joints', record.joints.stamp_ns, record.joints.position))
    if record.rates is not None:
        out.append(('gyro', record.rates.stamp_ns, record.rates.omega))
    if record.attitudes is not None:
        out.append(('attitude', record.attitudes.stamp_ns, _turns(record.attitudes)))
    return out


def _turns(attitudes: AttitudeSeries) -> Array:
    """(N, 3) turns from sample to sample, added up [rad]."""
    rotation = Rotation.from_quat(attitudes.q_xyzw)
    steps = (rotation[:-1].inv() * rotation[1:]).as_rotvec().reshape(-1, 3)
    return np.vstack([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def _jumps(place: str, seconds: Array, values: Array) -> Iterator[DataFault]:
    """Pauses over which the values go on smoothly only if no time had passed."""
    steps = np.diff(seconds)
    period = float(np.median(steps))
    count = max(_FEWEST_NEAR, int(np.ceil(_NEAR / period)))
    for k in np.flatnonzero(steps > JUMP_PERIODS * period).tolist():
        if not count <= k + 1 <= len(seconds) - count:
            continue
        near = np.arange(k + 1 - count, k + 1 + count)
        paused = seconds[near]
        unpaused = paused - np.where(near > k, steps[k] - period, 0.0)
        if _misfit(paused, values[near], 2) > _SEEN * _misfit(unpaused, values[near], 3):
            yield DataFault(
                'clock',
                place,
                f'the clock jumps by {steps[k]:.4g} s, {seconds[k]:.6g} s after the start: the '
                'values go on as if no time had passed',
            )


def _misfit(seconds: Array, values: Array, degree: int) -> float:
    """What a polynomial leaves of values, root mean square.

    Values and slopes at the two ends of a pause are four numbers: any cubic over it fits them.
    """
    reach = 0.5 * float(seconds[-1] - seconds[0])
    basis = np.vander((seconds - seconds[0]) / reach - 1.0, degree + 1)
    rest = values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0]
    return float(np.sqrt(np.mean(rest**2)))


def _dead(record: Record) -> Iterator[DataFault]:
    """Channels that never change, although what they measure does."""
    if record.joints is not None:
        yield from _dead_joints(record.joints)
    if record.rates is not None and record.attitudes is not None:
        yield from _dead_base(record.rates, record.attitudes)


def _dead_joints(joints: JointSeries) -> Iterator[DataFault]:
    still = np.ptp(joints.position, axis=0) == 0.0
    if joints.velocity is not None:
        still &= np.ptp(joints.velocity, axis=0) == 0.0
    for name in np.array(joints.names)[still]:
        message = 'never changes: a dead sensor, or a joint to be made fixed in the URDF'
        yield DataFault('constant', f'joint_position/{name}', message)
    if joints.effort is None:
        return
    if not np.any(joints.effort):
        yield DataFault('constant', 'joint_torque', 'all efforts are zero: they were not measured')
        return
    for name in np.array(joints.names)[(np.ptp(joints.effort, axis=0) == 0.0) & ~still]:
        yield DataFault(
            'constant', f'joint_torque/{name}', 'never changes although the joint moves'
        )


def _dead_base(rates: RateSeries, attitudes: AttitudeSeries) -> Iterator[DataFault]:
    turned = _turns(attitudes)
    seconds = (attitudes.stamp_ns - attitudes.stamp_ns[0]) / 1e9
    told = np.abs(rates.omega.mean(axis=0)) * seconds[-1]
    if np.ptp(attitudes.q_xyzw, axis=0).max() == 0.0 and len(seconds) > 2 and np.any(rates.omega):
        yield DataFault('constant', 'attitude', 'never changes, the gyro does')
        return
    moved = np.ptp(turned, axis=0)
    for i in np.flatnonzero(np.ptp(rates.omega, axis=0) == 0.0):
        if moved[i] > 0.1 * moved.max() and not np.isclose(moved[i], told[i], rtol=0.1, atol=0.0):
            yield DataFault('constant', f'gyro/{"xyz"[i]}', 'never changes, the attitude does')
