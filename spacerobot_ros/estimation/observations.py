"""Measurements as the diagnosis uses them: seconds, one array a channel, believed faults removed.

What the believed sensor effects do (`Effect.sense`, `Effect.delay`) is undone here, once, so that
the filter behind sees sensors that are right as far as the model knows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..effects.effect import Effect
from ..effects.motion import Motion
from ..errors import RecordingError
from ..model.robot import Robot
from ..recording.record import Record
from ..types import Array

_FEWEST_SAMPLES = 50
_UNDO_PASSES = 3  # of the fixed point that removes sensor effects; faults are small


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """Samples of one run, times in seconds since its first stamp.

    Args:
        joint_time: (Nj,). q: (Nj, n) [rad]. qd: (Nj, n) [rad/s], or None.
        effort_time: (Nj,) times that the efforts belong to. effort: (Nj, n) [N m], or None.
        rate_time: (Ng,); empty without a gyro. omega: (Ng, 3) [rad/s].
        attitude_time: (Na,); empty without a tracker. attitude: Na rotations R_WB, or None.
    """

    joint_time: Array
    q: Array
    qd: Array | None
    effort_time: Array
    effort: Array | None
    rate_time: Array
    omega: Array
    attitude_time: Array
    attitude: Rotation | None

    @property
    def span(self) -> tuple[float, float]:
        """First and last time of the joint samples [s]."""
        return float(self.joint_time[0]), float(self.joint_time[-1])

    def first(self, duration: float) -> Observations:
        """The first seconds of the run."""
        j, r, a = (
            slice(0, int(np.searchsorted(times, self.joint_time[0] + duration, side='right')))
            for times in (self.joint_time, self.rate_time, self.attitude_time)
        )
        return Observations(
            self.joint_time[j],
            self.q[j],
            None if self.qd is None else self.qd[j],
            self.effort_time[j],
            None if self.effort is None else self.effort[j],
            self.rate_time[r],
            self.omega[r],
            self.attitude_time[a],
            None if self.attitude is None else self.attitude[a],
        )


def observe(record: Record, robot: Robot) -> Observations:
    """The record's channels in seconds.

    Raises:
        RecordingError: no joints, too few samples, or no body rate where the base is free.
    """
    joints = record.joints
    if joints is None:
        raise RecordingError('/joint_states', 'is missing: without joints there is no motion')
    if len(joints.stamp_ns) < _FEWEST_SAMPLES:
        raise RecordingError(
            '/joint_states',
            f'has {len(joints.stamp_ns)} samples; a diagnosis needs {_FEWEST_SAMPLES} or more',
        )
    if robot.is_free and record.rates is None and record.attitudes is None:
        raise RecordingError(
            '/imu/data and /attitude',
            'are both missing: the motion of a free base is not seen (robot.base: fixed?)',
        )
    origin = record.span_ns[0]
    rates, attitudes = record.rates, record.attitudes
    if not robot.is_free:
        rates = attitudes = None
    joint_time = (joints.stamp_ns - origin) / 1e9
    return Observations(
        joint_time=joint_time,
        q=joints.position,
        qd=joints.velocity,
        effort_time=joint_time,
        effort=joints.effort,
        rate_time=np.zeros(0) if rates is None else (rates.stamp_ns - origin) / 1e9,
        omega=np.zeros((0, 3)) if rates is None else rates.omega,
        attitude_time=np.zeros(0) if attitudes is None else (attitudes.stamp_ns - origin) / 1e9,
        attitude=None if attitudes is None else Rotation.from_quat(attitudes.q_xyzw),
    )


def corrected(observed: Observations, effects: Sequence[Effect], robot: Robot) -> Observations:
    """The observations without what the believed sensor effects do to them.

    Args:
        observed: As measured.
        effects: Believed effects; only `sense` and `delay` matter here.
        robot: The robot, for the effects' places.
    """
    if not effects:
        return observed
    late = {
        clock: sum(effect.delay(clock) for effect in effects)
        for clock in ('joints', 'effort', 'imu', 'attitude')
    }
    undone = _undo_joint_sensors(observed, effects, robot)
    omega, attitude = observed.omega, observed.attitude
    if len(omega):
        omega = _undo('gyro', omega, effects, _still(robot, observed.rate_time, omega))
    if attitude is not None:
        zero = np.zeros((len(attitude), 3))
        motion = _still(robot, observed.attitude_time, zero)
        turn = zero
        for effect in effects:
            turn = effect.sense('attitude', turn, motion)
        attitude = attitude * Rotation.from_rotvec(turn).inv()
    return replace(
        undone,
        joint_time=observed.joint_time - late['joints'],
        effort_time=observed.effort_time - late['joints'] - late['effort'],
        rate_time=observed.rate_time - late['imu'],
        attitude_time=observed.attitude_time - late['attitude'],
        omega=omega,
        attitude=attitude,
    )


def _undo_joint_sensors(
    observed: Observations, effects: Sequence[Effect], robot: Robot
) -> Observations:
    """Undo what is done to /joint_states; an effect may depend on all three of its channels."""
    zeros = np.zeros_like(observed.q)
    measured = {
        'joint_position': observed.q,
        'joint_velocity': zeros if observed.qd is None else observed.qd,
        'joint_effort': zeros if observed.effort is None else observed.effort,
    }
    true = dict(measured)
    for _ in range(_UNDO_PASSES):
        motion = Motion(
            robot,
            observed.joint_time,
            true['joint_position'],
            true['joint_velocity'],
            true['joint_effort'],
        )
        true = {
            name: values - _error(name, true[name], effects, motion)
            for name, values in measured.items()
        }
    return replace(
        observed,
        q=true['joint_position'],
        qd=None if observed.qd is None else true['joint_velocity'],
        effort=None if observed.effort is None else true['joint_effort'],
    )


def _undo(channel: str, measured: Array, effects: Sequence[Effect], motion: Motion) -> Array:
    true = measured
    for _ in range(_UNDO_PASSES):
        true = measured - _error(channel, true, effects, motion)
    return true


def _error(channel: str, true: Array, effects: Sequence[Effect], motion: Motion) -> Array:
    value = true
    for effect in effects:
        value = effect.sense(channel, value, motion)
    return value - true


def _still(robot: Robot, time: Array, omega: Array) -> Motion:
    zeros = np.zeros((len(time), robot.n_joints))
    return Motion(robot, time, zeros, zeros, zeros, omega=omega)
