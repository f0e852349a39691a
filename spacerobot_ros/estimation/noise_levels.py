"""How noisy each sensor is: as the robot file states it, checked against the data."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view

from ..model.robot import Robot
from ..model.robot_settings import SensorSettings
from ..recording.faults.gaps import ONE_LOST
from ..recording.faults.neighbours import NORMAL
from ..recording.faults.signals import turns
from ..recording.record import Record
from ..recording.robot_inputs import wheel_axes, wheel_rates
from ..types import Array
from .trajectory.reference import NoiseLevels, integrated_rotation

_FLOOR = {
    'joint_position': 1e-8,
    'joint_velocity': 1e-7,
    'joint_effort': 1e-8,  # of the largest effort: machines may be of any size
    'gyro': 1e-8,
    'attitude': 1e-8,
}
_UNIFORM = float(np.sqrt(12.0))  # step of a scale by standard deviation of its rounding
_WHOLE = 0.05  # of a step, off a whole number: steps that were rounded again, for a file
DISAGREEMENT = 1.5  # factor between statement and data from which on the data count


def noise_levels(
    sensors: SensorSettings, record: Record, *, is_checked: bool = True
) -> tuple[NoiseLevels, tuple[str, ...]]:
    """Standard deviations of one sample of each channel, and what should be said of them.

    Where the file states none, and where the data are clearly noisier than it states, the level
    comes from the data's fourth differences, in which a smooth motion is not seen. An effort that
    the controller itself makes rough looks noisy without being so: its stated level stands.
    Of joints that each have a level of their own, the root mean square counts.

    Args:
        sensors: What the robot file states.
        record: Samples.
        is_checked: Whether the data overrule the file, efforts are used and both shall be said;
            otherwise what is stated stands, and the test of fit tells whether it holds.
    """
    measured: dict[str, tuple[Array, Array | None]] = {
        'joint_position': (record.joint_time, record.q),
        'joint_velocity': (record.joint_time, record.qd),
        'joint_effort': (record.joint_time, record.effort if is_checked else None),
        'gyro': (
            record.rate_time,
            record.omega[:, record.gyro_axes] if len(record.omega) else None,
        ),
        'attitude': (record.attitude_time, unseen_turns(record)),
    }
    levels, notes = {}, []
    for name, (time, values) in measured.items():
        stated = sensors.std(name)
        seen = 0.0
        if values is not None and (is_checked or stated is None):
            seen = fourth_difference_std(values, time)
        level = max((seen if stated is None else stated) or 0.0, _least(name, values))
        if stated is None and values is not None and values.size:
            notes.append(f'{name}_std is not stated; estimated from the data: {level:.3g}')
        elif name != 'joint_effort' and stated and seen > DISAGREEMENT * stated:
            level = max(level, seen)
            notes.append(
                f'{name}: the data are noisier than stated, {seen:.3g} against {stated:.3g}; '
                'the data count'
            )
        levels[name] = level
    return NoiseLevels(**levels), tuple(notes)


def wheel_noise(robot: Robot, record: Record) -> Array:
    """(W, 3) standard deviation that each own wheel's measured rate gives their momentum [N m s].

    As the robot file states it of joint rates, else from the data; none where none counts.
    """
    axes, rates = wheel_axes(robot), wheel_rates(robot, record)
    if rates is None or record.wheels is None or not robot.is_free:
        return np.zeros_like(axes)
    stated, time = robot.sensors.std('joint_velocity'), record.wheels.seconds(record.origin_ns)
    stds = [stated or fourth_difference_std(rate[:, None], time) for rate in rates.T]
    return np.asarray(np.array(stds)[:, None] * axes)


def _least(name: str, values: Array | None) -> float:
    """What the noise of a channel is at least: that of its steps, and of numbers in a file."""
    floor = _FLOOR[name]
    if name == 'joint_effort' and values is not None and values.size:
        floor *= float(np.nanmax(np.abs(values))) or 1.0
    return max(_resolution(values) / _UNIFORM, floor)


def fourth_difference_std(values: Array, time: Array | None = None) -> float:
    """Noise of one sample of a smooth signal (N, m); zero for fewer than five samples.

    Its fourth differences are noise alone, with variance 70 sigma^2 (1 + 16 + 36 + 16 + 1). Where
    samples are missing they are divided differences.

    Args:
        values: (N, m).
        time: (N,) [s]; None: samples are evenly spaced.
    """
    values = values[:, np.any(values != values[:1], axis=0)]  # others are no noise of a sensor
    if len(values) < 5 or not values.size or not np.all(np.isfinite(values)):
        return 0.0
    differences = np.diff(values, n=4, axis=0) / np.sqrt(70.0)
    if time is not None:
        _bridge_lost(differences, values, time)
    differences = differences.ravel()
    spread = NORMAL * np.median(np.abs(differences - np.median(differences)))
    inliers = differences[np.abs(differences) <= 4.5 * spread] if spread > 0.0 else differences
    return float(np.std(inliers if len(inliers) else differences))  # none of a few smooth ones


def _bridge_lost(differences: Array, values: Array, time: Array) -> None:
    """Put divided differences, of the same variance by noise, where samples are missing."""
    steps = np.diff(time)
    is_long = steps > ONE_LOST * np.median(steps)
    at = np.flatnonzero(sliding_window_view(is_long, 4).any(axis=1))
    if not len(at):
        return
    nodes = sliding_window_view(time, 5)[at]
    nodes = (nodes - nodes[:, :1]) / (nodes[:, -1:] - nodes[:, :1])
    apart = nodes[:, :, None] - nodes[:, None, :] + np.eye(5)
    weights = 1.0 / np.prod(apart, axis=2)
    weights /= np.linalg.norm(weights, axis=1)[:, None]
    differences[at] = np.einsum('ki,kmi->km', weights, sliding_window_view(values, 5, axis=0)[at])


def _resolution(values: Array | None) -> float:
    """Step of (N, k) values that are rounded, the largest of all columns; 0 where none is."""
    if values is None:
        return 0.0
    return max((step_of(column) for column in values.T), default=0.0)


def step_of(column: Array) -> float:
    """Smallest step of rounded values (N,): they recur, and all are whole steps apart.

    Numbers of a joint that only moves on lie far apart, too, but never recur.
    """
    levels = np.unique(column)
    if len(levels) < 2 or len(levels) == len(column):
        return 0.0
    steps = np.diff(levels)
    counts = steps / steps.min()
    is_whole = np.median(np.abs(counts - np.round(counts))) < _WHOLE
    return float(steps.min()) if is_whole else 0.0


def unseen_turns(record: Record) -> Array | None:
    """(Na, 3) accumulated turns from sample to sample, less what the gyro saw of them.

    A tracker is slow: without the gyro a fast turn would pass for noise.
    """
    if record.attitude is None or len(record.attitude_time) < 2:
        return None
    attitude, times = record.attitude, record.attitude_time
    if len(record.rate_time) > len(times) and len(record.gyro_axes) == len('xyz'):
        grid = np.unique(np.concatenate([times, record.rate_time]))
        # more than half a turn between samples is no rate, and would overflow
        most = np.pi / np.median(np.diff(record.rate_time))
        curve = scipy.interpolate.make_interp_spline(
            record.rate_time, np.clip(record.omega, -most, most), k=3
        )
        seen = integrated_rotation(
            lambda t: np.asarray(curve(np.clip(t, *record.rate_time[[0, -1]]))),
            grid,
            scipy.spatial.transform.Rotation.identity(),
        )
        start = attitude * seen[np.searchsorted(grid, times)].inv()  # the same at all times
        return np.asarray((start[0].inv() * start).as_rotvec())
    return turns(record)
