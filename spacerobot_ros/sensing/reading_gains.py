"""By how much the readings of sensors that misread change with the truth.

A reading y = f(x) + v that is undone is x + v / f': its noise is divided by the gain f', as it is.
Readings that are a scale behind a turn, f' = R diag(s), have gains s, the lengths of its columns.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effects.effect import Effect
from ..effects.motion import Motion
from ..model.robot import Robot
from ..recording.record import Record
from ..types import Array
from .sensor_faults import SensorFaults

_STEP = 1e-6  # rad, rad/s; sensors are smooth over it
_LEAST = 0.1  # a sensor that says less of the truth can not be undone


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
    still = np.zeros_like(record.q)
    rates, efforts = (still if x is None else x for x in (record.qd, record.effort))
    out = {}
    if record.q.size:
        joints = Motion(robot, record.joint_time, record.q, rates, efforts)
        out['joint_position'] = _gains(faults, 'joint_position', record.q, joints)
        if record.qd is not None:
            out['joint_velocity'] = _gains(faults, 'joint_velocity', record.qd, joints)
    if record.omega.size:
        still = np.zeros((len(record.omega), robot.n_joints))
        base = Motion(robot, record.rate_time, still, still, still, omega=record.omega)
        out['gyro'] = _gains(faults, 'gyro', record.omega, base)
    return out


def _gains(faults: SensorFaults, channel: str, true: Array, motion: Motion) -> Array:
    """(N, width) lengths of the columns of the readings' derivative."""
    read, out = faults.sensed(channel, true, motion), np.empty_like(true)
    for axis in range(true.shape[1]):
        moved = true.copy()
        moved[:, axis] += _STEP
        change = faults.sensed(channel, moved, motion) - read
        out[:, axis] = np.linalg.norm(change, axis=1) / _STEP
    return np.maximum(out, _LEAST)
