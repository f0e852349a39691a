"""The trajectory about which everything is linear: splines through the data themselves.

It rests on no model, so a wrong model does not bend it; and it only carries the linearisation, so
its own small error does not matter: the filter estimates the deviation from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation, Slerp

from ..recording.record import Record
from ..types import Array
from .smoothing import integrated_rotation
from .splines import Samples, fit_spline

_FEWEST_FOR_DRIFT = 8
_DRIFT_PASSES = 3
_CLOSE = 10.0  # of the tracker's noise: as close as linearity needs, far below a milliradian


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseLevels:
    """Standard deviation of one sample of each channel, SI."""

    joint_position: float
    joint_velocity: float
    joint_effort: float
    gyro: float
    attitude: float


@dataclass(frozen=True, eq=False)
class Kinematics:
    """The reference at N times.

    Args:
        time: (N,). q, qd, qdd: (N, n). omega, alpha: (N, 3) base rate and its derivative, in the
            base. rotation: N rotations R_WB.
    """

    time: Array
    q: Array
    qd: Array
    qdd: Array
    omega: Array
    alpha: Array
    rotation: Rotation

    @cached_property
    def matrices(self) -> Array:
        """(N, 3, 3) of `rotation`."""
        return np.asarray(self.rotation.as_matrix())


class ReferenceTrajectory:
    """Smooth motion through the observations, with derivatives at any time.

    Args:
        record: Record.
        noise: Noise levels, for the splines' weights.
        times: (N,) increasing; the attitude is integrated along them.
    """

    def __init__(self, record: Record, noise: NoiseLevels, times: Array) -> None:
        start, end = float(times[0]), float(times[-1])
        joints = [Samples(record.joint_time, record.q, noise.joint_position)]
        if record.qd is not None:
            joints.append(
                Samples(record.joint_time, record.qd, noise.joint_velocity, derivative=1)
            )
        self._joints = fit_spline(joints, start, end).curve
        self._rate = _base_rate(record, noise, start, end)
        self._rotations = Slerp(times, _attitude(self._rate, record, times))
        self._effort = None
        if record.effort is not None:
            effort = Samples(record.effort_time, record.effort, noise.joint_effort)
            self._effort = fit_spline([effort], start, end).curve

    def at(self, times: Array) -> Kinematics:
        """The reference at any times within the span."""
        joints, rate = self._joints, self._rate
        return Kinematics(
            times,
            np.asarray(joints(times)),
            np.asarray(joints.derivative()(times)),
            np.asarray(joints.derivative(2)(times)),
            rate(times),
            rate(times, 1),
            self._rotations(times),
        )

    def effort(self, times: Array, derivative: int = 0) -> Array:
        """(N, n) smooth motor torque [N m], or a derivative of it; zero where none is measured."""
        if self._effort is None:
            return np.zeros((len(times), self._joints.c.shape[1]))
        return np.asarray(self._effort(times, nu=derivative))


class _Rate:
    """A sum of splines: the body rate and slow corrections of it."""

    def __init__(self, *curves: BSpline) -> None:
        self.curves = curves

    def __call__(self, times: Array, derivative: int = 0) -> Array:
        total = np.zeros((len(times), 3))
        for curve in self.curves:
            total += curve(times, nu=derivative)
        return total


def _base_rate(record: Record, noise: NoiseLevels, start: float, end: float) -> _Rate:
    """Base rate: through the gyro's samples, drawn to the tracker where the two disagree."""
    if len(record.rate_time):
        gyro = [Samples(record.rate_time, record.omega, noise.gyro)]
        return _drawn_to_tracker(
            _Rate(fit_spline(gyro, start, end).curve), record, noise, start, end
        )
    if record.attitude is None:
        return _Rate()
    steps = np.diff(record.attitude_time)[:, None]
    turns = (record.attitude[:-1].inv() * record.attitude[1:]).as_rotvec() / steps
    middle = 0.5 * (record.attitude_time[1:] + record.attitude_time[:-1])
    std = noise.attitude * np.sqrt(2.0) / float(np.median(steps))
    return _Rate(fit_spline([Samples(middle, turns, std)], start, end).curve)


def _drawn_to_tracker(
    rate: _Rate, record: Record, noise: NoiseLevels, start: float, end: float
) -> _Rate:
    """The rate plus the slow drift that the tracker sees of its integral.

    Without it a biased gyro would carry the reference attitude away until it is no longer close.
    """
    if record.attitude is None or len(record.attitude_time) < _FEWEST_FOR_DRIFT:
        return rate
    at = record.attitude_time
    times = np.unique(np.concatenate([record.rate_time, at, [start, end]]))
    for _ in range(_DRIFT_PASSES):
        rotation = _attitude(rate, record, times)
        here = rotation[np.searchsorted(times, at)]
        deviation = (here.inv() * record.attitude).as_rotvec()
        if np.max(np.abs(deviation)) < _CLOSE * noise.attitude:
            break
        std = noise.attitude / float(np.median(np.diff(at)))
        drift = Samples(at, np.gradient(deviation, at, axis=0), std)
        rate = _Rate(*rate.curves, fit_spline([drift], start, end).curve)
    return rate


def _attitude(rate: _Rate, record: Record, times: Array) -> Rotation:
    """Attitudes whose rate is given, turned as a whole to agree with the tracker."""
    integrated = integrated_rotation(rate, times, Rotation.identity())
    if record.attitude is None:
        return integrated
    inside = (record.attitude_time >= times[0]) & (record.attitude_time <= times[-1])
    here = Slerp(times, integrated)(record.attitude_time[inside])
    return (record.attitude[inside] * here.inv()).mean() * integrated
