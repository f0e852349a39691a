"""Records as filters use them: what is needed is there, and known sensor faults are undone.

What the believed sensor effects do (`sense`, `delay`) is undone here, once, so that the filter
behind sees sensors that are right as far as the model knows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..effects.effect import Effect
from ..effects.motion import Motion
from ..errors import RecordingError
from ..model.robot import Robot
from ..recording.record import JointSeries, Record
from ..types import Array, IntArray

_FEWEST_SAMPLES = 50
_UNDO_PASSES = 3  # of the fixed point that removes sensor effects; faults are small


def observed(record: Record, robot: Robot) -> Record:
    """The record without the sensors that say nothing of this robot's motion.

    Raises:
        RecordingError: no joints, too few samples, or no body rate where the base is free.
    """
    joints = record.joints
    if joints is None:
        raise RecordingError('/joint_states', 'is missing: without joints there is no motion')
    if len(joints) < _FEWEST_SAMPLES:
        raise RecordingError(
            '/joint_states',
            f'has {len(joints)} samples; a diagnosis needs {_FEWEST_SAMPLES} or more',
        )
    if not robot.is_free:
        return replace(record, zero_ns=record.origin_ns, rates=None, attitudes=None)
    if record.rates is None and record.attitudes is None:
        raise RecordingError(
            '/imu/data and /attitude',
            'are both missing: the motion of a free base is not seen (robot.base: fixed?)',
        )
    return record


def corrected(record: Record, effects: Sequence[Effect], robot: Robot) -> Record:
    """The record as right sensors with punctual clocks would have taken it.

    Args:
        record: As measured.
        effects: Believed effects; only `sense` and `delay` matter here.
        robot: The robot, for the effects' places.
    """
    if not effects:
        return record

    def earlier(stamp_ns: IntArray, clock: str) -> IntArray:
        return stamp_ns - round(sum(effect.delay(clock) for effect in effects) * 1e9)

    joints, rates, attitudes = record.joints, record.rates, record.attitudes
    if joints is not None:
        late = sum(effect.delay('effort') for effect in effects)
        joints = replace(
            _undo_joint_sensors(joints, record.joint_time, effects, robot),
            stamp_ns=earlier(joints.stamp_ns, 'joints'),
            effort_delay=joints.effort_delay + late,
        )
    if rates is not None and len(rates):
        omega = rates.omega
        for _ in range(_UNDO_PASSES):
            still = _still(robot, record.rate_time, omega)
            omega = rates.omega - _error('gyro', omega, effects, still)
        rates = replace(rates, stamp_ns=earlier(rates.stamp_ns, 'imu'), omega=omega)
    if attitudes is not None and record.attitude is not None:
        zero = np.zeros((len(attitudes), 3))
        turn = _error('attitude', zero, effects, _still(robot, record.attitude_time, zero))
        true = record.attitude * Rotation.from_rotvec(turn).inv()
        stamps = earlier(attitudes.stamp_ns, 'attitude')
        attitudes = replace(attitudes, stamp_ns=stamps, q_xyzw=true.as_quat())
    origin = record.origin_ns
    return replace(record, joints=joints, rates=rates, attitudes=attitudes, zero_ns=origin)


def _undo_joint_sensors(
    series: JointSeries, time: Array, effects: Sequence[Effect], robot: Robot
) -> JointSeries:
    """Undo what is done to /joint_states; an effect may depend on all three of its channels."""
    fields = {'joint_position': 'position', 'joint_velocity': 'velocity', 'joint_effort': 'effort'}
    zeros = np.zeros_like(series.position)
    measured = {channel: getattr(series, name) for channel, name in fields.items()}
    true = {channel: zeros if v is None else v for channel, v in measured.items()}
    for _ in range(_UNDO_PASSES):
        motion = Motion(robot, time, *true.values())
        true = {
            channel: true[channel]
            if v is None
            else v - _error(channel, true[channel], effects, motion)
            for channel, v in measured.items()
        }
    found: dict[str, Any] = {fields[c]: true[c] for c, v in measured.items() if v is not None}
    return replace(series, **found)


def _error(channel: str, true: Array, effects: Sequence[Effect], motion: Motion) -> Array:
    value = true
    for effect in effects:
        value = effect.sense(channel, value, motion)
    return value - true


def _still(robot: Robot, time: Array, omega: Array) -> Motion:
    zeros = np.zeros((len(time), robot.n_joints))
    return Motion(robot, time, zeros, zeros, zeros, omega=omega)
