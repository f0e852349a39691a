"""By how much the readings of sensors that misread change with the truth, and with the torque.

A reading y = f(x) + v that is undone is x + v / f': its noise is divided by the gain f', as it is.
Readings that are a scale behind a turn, f' = R diag(s), have gains s, the lengths of its columns.
An encoder that moves with the torque, as one behind some play, is as unsure as the torque besides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..effects.effect import Effect
from ..effects.motion import Motion
from ..model.robot import Robot
from ..recording.record import Record
from ..types import Array
from .sensor_faults import SensorFaults

_STEP = 1e-6  # rad, rad/s; sensors are smooth over it
_LEAST = 0.1  # a sensor that says less of the truth can not be undone


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """How sure readings are whose sensors' effects were undone.

    Args:
        gains: Channel to (samples, width) by which they, and their noise, were divided; of those
            without nothing was.
        unsure: Channel to (samples, width) standard deviation of what they were corrected by, as
            if no two of its errors were alike; of those without it is none.
        alike: Number of samples over which its errors are alike.
    """

    gains: Mapping[str, Array]
    unsure: Mapping[str, Array]
    alike: float


AS_READ = Readings({}, {}, 1.0)
"""Where no sensor says anything but the truth."""


def reading_gains(record: Record, robot: Robot, effects: Sequence[Effect]) -> dict[str, Array]:
    """Channel to (samples, width) by how much its readings change with the truth of each axis.

    Args:
        record: Right samples, sensor effects already undone.
        robot: The robot that the effects act on.
        effects: Believed effects; only those of sensors matter here.

    Returns:
        Of channels that are measured; none where no sensor says anything but the truth. Attitudes
        are turned, not scaled.
    """
    faults = SensorFaults(robot, effects)
    if faults.are_none:
        return {}
    out = {}
    if record.q.size:
        joints = _joints(record, robot)
        out['joint_position'] = _gains(faults, 'joint_position', record.q, joints)
        if record.qd is not None:
            out['joint_velocity'] = _gains(faults, 'joint_velocity', record.qd, joints)
    if record.omega.size:
        still = np.zeros((len(record.omega), robot.n_joints))
        base = Motion(robot, record.rate_time, still, still, still, omega=record.omega)
        out['gyro'] = _gains(faults, 'gyro', record.omega, base)
    return out


def moved_by_torque(
    record: Record,
    robot: Robot,
    effects: Sequence[Effect],
    effort_noise: Array | float,
    std: float,
) -> dict[str, Array]:
    """Encoder channel to (samples, n) half the change of readings by two deviations of torque.

    Args:
        record: Right samples, sensor effects already undone.
        robot: The robot that the effects act on.
        effects: Believed effects; only those of sensors matter here.
        effort_noise: What of the efforts encoders were taken to see nothing of [N m].
        std: Standard deviation of the torques that they were taken to see [N m].
    """
    faults = SensorFaults(robot, effects)
    if faults.are_none or not (std and record.q.size):
        return {}
    more, less = (_joints(record, robot, sign * std - effort_noise) for sign in (1.0, -1.0))
    out = {}
    for channel, values in (('joint_position', record.q), ('joint_velocity', record.qd)):
        if values is not None:
            change = faults.sensed(channel, values, more) - faults.sensed(channel, values, less)
            out[channel] = 0.5 * change
    return out


def _joints(record: Record, robot: Robot, more_torque: Array | float = 0.0) -> Motion:
    """The joints' samples as a motion; what was not measured is zero."""
    still = np.zeros_like(record.q)
    rates, efforts = (still if x is None else x for x in (record.qd, record.effort))
    return Motion(robot, record.joint_time, record.q, rates, efforts + more_torque)


def _gains(faults: SensorFaults, channel: str, true: Array, motion: Motion) -> Array:
    """(N, width) lengths of the columns of the readings' derivative."""
    read, out = faults.sensed(channel, true, motion), np.empty_like(true)
    for axis in range(true.shape[1]):
        moved = true.copy()
        moved[:, axis] += _STEP
        change = faults.sensed(channel, moved, motion) - read
        out[:, axis] = np.linalg.norm(change, axis=1) / _STEP
    return np.maximum(out, _LEAST)
