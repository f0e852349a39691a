"""The trajectory about which everything is linear: splines through the data themselves.

It rests on no model, so a wrong model does not bend it; and it only carries the linearization, so
its own small error does not matter: the filter estimates the deviation from it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property

import numpy as np
import scipy

from ...dynamics.compiling import compiled
from ...recording.record import Record
from ...types import Array
from .splines import Samples, SplineFit, fit_spline

_FEWEST_FOR_DRIFT = 8
_DRIFT_PASSES = 3
_CLOSE = 10.0  # of the tracker's noise: as close as linearity needs, far below a milliradian

_LARGEST_TURN = 1e6  # rad in a step


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
    """Joints and base of a motion at N times.

    Args:
        time: (N,) [s].
        q: (N, n) joint positions [rad]. qd: (N, n) joint rates [rad/s].
        omega: (N, 3) body rate omega_WB_B [rad/s].
        rotation: N attitudes R_WB.
        qdd: (N, n) [rad/s^2]. alpha: (N, 3) derivative of omega, in the base [rad/s^2]; both
            empty where accelerations are of no interest.
    """

    time: Array
    q: Array
    qd: Array
    omega: Array
    rotation: scipy.spatial.transform.Rotation
    qdd: Array = field(default_factory=lambda: np.zeros(0))
    alpha: Array = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def matrices(self) -> Array:
        """(N, 3, 3) of `rotation`."""
        return np.asarray(self.rotation.as_matrix())

    def part(self, part: slice) -> Kinematics:
        """Some of the times."""
        return Kinematics(*(getattr(self, each.name)[part] for each in fields(self)))


class ReferenceTrajectory:
    """Smooth motion through the samples, with derivatives at any time.

    Args:
        record: Samples.
        noise: Noise levels, for the splines' weights.
        times: (N,) increasing; the attitude is integrated along them.
        start: Attitude at the first time; None: as agrees best with the tracker, to whose samples
            the body rate is then drawn as well.
        span: Ends of the splines, around the times; None: the first and the last time [s].
    """

    def __init__(
        self,
        record: Record,
        noise: NoiseLevels,
        times: Array,
        start: scipy.spatial.transform.Rotation | None = None,
        span: tuple[float, float] | None = None,
    ) -> None:
        ends = (float(times[0]), float(times[-1])) if span is None else span
        self.times = times
        joints = [Samples(record.joint_time, record.q, noise.joint_position)]
        if record.qd is not None:
            joints.append(
                Samples(record.joint_time, record.qd, noise.joint_velocity, derivative=1)
            )
        self.joints = fit_spline(joints, *ends)
        self.rate = _base_rate(record, noise, ends, start is None)
        rotations = (
            integrated_rotation(self.rate, times, start)
            if start is not None
            else _attitude(self.rate, record, times)
        )
        self._start, self._rotations = (
            rotations[0],
            scipy.spatial.transform.Slerp(times, rotations),
        )
        self._efforts = (record.effort_time, record.effort, noise.joint_effort, ends)

    def at(self, times: Array) -> Kinematics:
        """The reference at any times within the span."""
        joints, rate = self.joints, self.rate
        return Kinematics(
            times,
            joints(times),
            joints(times, 1),
            rate(times),
            self._rotations(times),
            joints(times, 2),
            rate(times, 1),
        )

    def effort(self, times: Array, derivative: int = 0) -> Array:
        """(N, n) smooth motor torque [N m], or a derivative of it; zero where none is measured."""
        spline = self._effort
        return np.zeros_like(self.joints(times)) if spline is None else spline(times, derivative)

    @cached_property
    def _effort(self) -> SplineFit | None:
        time, effort, std, ends = self._efforts
        return None if effort is None else fit_spline([Samples(time, effort, std)], *ends)


@dataclass(frozen=True, slots=True, eq=False)
class BaseRate:
    """A sum of splines: the body rate and slow corrections of it; zero without any."""

    fits: tuple[SplineFit, ...]

    def __call__(self, times: Array, order: int = 0) -> Array:
        """(N, 3) [rad/s], or a derivative."""
        return np.asarray(sum((fit(times, order) for fit in self.fits), np.zeros((len(times), 3))))

    @property
    def spacing(self) -> float:
        """Distance of the body rate's knots [s]."""
        return self.fits[0].spacing


def _base_rate(
    record: Record, noise: NoiseLevels, ends: tuple[float, float], is_drawn: bool
) -> BaseRate:
    """Base rate: through the gyro's samples, drawn to the tracker where the two disagree."""
    attitude, at = record.attitude, record.attitude_time
    if len(record.rate_time):
        gyro = Samples(record.rate_time, record.omega, noise.gyro)
        rate = BaseRate((fit_spline([gyro], *ends),))
        is_drawn = is_drawn and attitude is not None and len(at) >= _FEWEST_FOR_DRIFT
        return _drawn_to_tracker(rate, record, noise, ends) if is_drawn else rate
    if attitude is None:
        return BaseRate(())
    steps = np.diff(at)[:, None]
    turns = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / steps
    std = noise.attitude * np.sqrt(2.0) / float(np.median(steps))
    return BaseRate((fit_spline([Samples(0.5 * (at[1:] + at[:-1]), turns, std)], *ends),))


def _drawn_to_tracker(
    rate: BaseRate, record: Record, noise: NoiseLevels, ends: tuple[float, float]
) -> BaseRate:
    """The rate plus the slow drift that the tracker sees of its integral.

    Without it a biased gyro would carry the reference attitude away until it is no longer close.
    """
    at = record.attitude_time
    times = np.unique(np.concatenate([record.rate_time, at, ends]))
    for _ in range(_DRIFT_PASSES):
        here = _attitude(rate, record, times)[np.searchsorted(times, at)]
        deviation = (here.inv() * record.attitude).as_rotvec()
        if np.max(np.abs(deviation)) < _CLOSE * noise.attitude:
            break
        std = noise.attitude / float(np.median(np.diff(at)))
        # the deviation turns with the base: d' = -w x d + drift
        drift = np.gradient(deviation, at, axis=0) + np.cross(rate(at), deviation)
        rate = BaseRate((*rate.fits, fit_spline([Samples(at, drift, std)], *ends)))
    return rate


def _attitude(rate: BaseRate, record: Record, times: Array) -> scipy.spatial.transform.Rotation:
    """Attitudes whose rate is given, turned as a whole to agree with the tracker."""
    integrated = integrated_rotation(rate, times, scipy.spatial.transform.Rotation.identity())
    at = record.attitude_time
    inside = (at >= times[0]) & (at <= times[-1])
    if record.attitude is None or not np.any(inside):
        return integrated
    here = scipy.spatial.transform.Slerp(times, integrated)(at[inside])
    return (record.attitude[inside] * here.inv()).mean() * integrated


def integrated_rotation(
    rate: Callable[[Array], Array], times: Array, start: scipy.spatial.transform.Rotation
) -> scipy.spatial.transform.Rotation:
    """Attitudes at increasing times whose body rate is given, `start` at the first.

    Fourth-order Magnus steps: dt/6 (w0 + 4 wm + w1) + dt^2/12 w0 x w1 with w in body axes.

    Args:
        rate: Times (N,) to body rates (N, 3) [rad/s].
        times: (N,) [s].
        start: Attitude at the first time.
    """
    omega = np.asarray(rate(times))
    middle = np.asarray(rate(0.5 * (times[1:] + times[:-1])))
    dt = np.diff(times)[:, None]
    with np.errstate(over='ignore', invalid='ignore'):
        turns = dt / 6.0 * (omega[:-1] + 4.0 * middle + omega[1:])
        turns += dt**2 / 12.0 * np.cross(omega[:-1], omega[1:])
    # outliers near the largest numbers: any turn will do, as long as it is one
    turns = np.clip(np.nan_to_num(turns), -_LARGEST_TURN, _LARGEST_TURN)
    return accumulated_rotation(start, turns)


def accumulated_rotation(
    start: scipy.spatial.transform.Rotation, turns: Array
) -> scipy.spatial.transform.Rotation:
    """start, start exp(turns[0]), start exp(turns[0]) exp(turns[1]), ..."""
    steps = scipy.spatial.transform.Rotation.from_rotvec(turns).as_quat()
    out = np.empty((len(steps) + 1, 4))
    out[0] = start.as_quat()
    _multiply(steps, out)
    return scipy.spatial.transform.Rotation.from_quat(out)


@compiled
def _multiply(steps: Array, out: Array) -> None:
    """Products (N + 1, 4) of the first quaternion with ever more of the others (N, 4), xyzw.

    SciPy's products of stacks, by pairwise doubling, take 100 times as long for 6000.
    """
    x, y, z, w = out[0, 0], out[0, 1], out[0, 2], out[0, 3]
    for k in range(len(steps)):
        a, b, c, d = steps[k, 0], steps[k, 1], steps[k, 2], steps[k, 3]
        x, y, z, w = (
            w * a + x * d + y * c - z * b,
            w * b + y * d + z * a - x * c,
            w * c + z * d + x * b - y * a,
            w * d - x * a - y * b - z * c,
        )
        out[k + 1, 0], out[k + 1, 1], out[k + 1, 2], out[k + 1, 3] = x, y, z, w
