"""Reference trajectory from noisy, asynchronous samples: splines and integrated attitude."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation

from ..types import Array
from .reference import Kinematics, integrated_rotation
from .splines import Samples, SplineFit, fit_spline
from .time_base import filter_times, refuse_long_gaps
from .torque_hold import Holds

# The spline's snap, seen as white noise over its knots' spacing, overstates what the filter needs:
# with this share the innovations of smooth motions have unit variance. Estimates do not depend on
# it (factors of 1000 change no digit).
_SNAP_SHARE = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class SensorData:
    """Samples of one stretch of a run, times in seconds from a common origin.

    Args:
        joint_time: (Nj,). q: (Nj, n). qd: (Nj, n); NaN where not measured.
        rate_time: (Ng,). omega: (Ng, 3).
        attitude_time: (Na,). attitude_xyzw: (Na, 4).
        holds: When torques were set; None where that is of no interest.
    """

    joint_time: Array
    q: Array
    qd: Array
    rate_time: Array
    omega: Array
    attitude_time: Array
    attitude_xyzw: Array
    holds: Holds | None = None

    def between(self, start: float, end: float) -> SensorData:
        """The samples with start < t <= end."""
        j, r, a = (
            slice(*np.searchsorted(t, [start, end], side='right'))
            for t in (self.joint_time, self.rate_time, self.attitude_time)
        )
        return SensorData(
            self.joint_time[j],
            self.q[j],
            self.qd[j],
            self.rate_time[r],
            self.omega[r],
            self.attitude_time[a],
            self.attitude_xyzw[a],
            self.holds,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Smoothed:
    """Splines of joints and body rate on one stretch."""

    joints: SplineFit
    rate: SplineFit

    def snap_density(self, times: Array) -> Array:
        """(n,) power spectral density of a white snap that follows the joints as the spline."""
        snap = self.joints(times, 4)
        return _SNAP_SHARE * np.mean(snap**2, axis=0) * self.joints.spacing + 1e-12

    def joint_start(self, times: Array) -> tuple[Array, Array]:
        """(4, n) position to jerk at the first time, and (4, n) rms of each over all times."""
        orders = [
            np.asarray(self.joints.curve(times)),
            *(self.joints(times, k) for k in (1, 2, 3)),
        ]
        spread = [np.std(orders[0], axis=0), *(np.sqrt(np.mean(x**2, axis=0)) for x in orders[1:])]
        return np.array([x[0] for x in orders]), np.array(spread) + 1e-6

    def reference(self, times: Array, start: Rotation) -> Kinematics:
        """Reference at increasing times; the attitude is integrated from `start` at the first.

        Fourth-order Magnus steps: dt/6 (w0 + 4 wm + w1) + dt^2/12 w0 x w1 with w in body axes.
        """
        return _integrated(self.joints.curve, self.rate.curve, times, start)

    def disturbed(self, reference: Kinematics) -> Kinematics:
        """The reference with a draw of its own error added."""
        joints, rate = self.joints, self.rate
        return _integrated(
            _sum(joints.curve, joints.error),
            _sum(rate.curve, rate.error),
            reference.time,
            reference.rotation[0],
        )


def _sum(curve: BSpline, error: BSpline) -> BSpline:
    """The sum of two splines on the same knots."""
    return BSpline(curve.t, curve.c + error.c, curve.k)


def _integrated(joints: BSpline, rate: BSpline, times: Array, start: Rotation) -> Kinematics:
    q, qd = np.asarray(joints(times)), np.asarray(joints.derivative()(times))
    rotation = integrated_rotation(rate, times, start)
    return Kinematics(times, q, qd, np.asarray(rate(times)), rotation)


def smooth(
    data: SensorData, start: float, end: float, stds: tuple[float, float, float]
) -> Smoothed:
    """Fit the splines on [start, end].

    Args:
        data: At least a few joint and gyro samples.
        start: Start of the interval [s].
        end: End of the interval [s].
        stds: Standard deviations of joint position [rad], joint rate [rad/s] and gyro [rad/s].
    """
    joints = [Samples(data.joint_time, data.q, stds[0])]
    if np.all(np.isfinite(data.qd)):
        joints.append(Samples(data.joint_time, data.qd, stds[1], derivative=1))
    return Smoothed(
        fit_spline(joints, start, end),
        fit_spline([Samples(data.rate_time, data.omega, stds[2])], start, end),
    )


def time_grid(data: SensorData) -> Array:
    """All stamps in order, with extra times where a gap would be longer than the filter's step.

    Raises:
        IdentificationError: a gap that can not be bridged.
    """
    stamps = np.unique(np.concatenate([data.joint_time, data.rate_time, data.attitude_time]))
    refuse_long_gaps(stamps)
    return filter_times([stamps], (stamps[0], stamps[-1]), same=0.0)


def align(reference: Kinematics, times: Array, attitude_xyzw: Array) -> Rotation:
    """First attitude that makes an integrated reference agree best with measured attitudes.

    Args:
        reference: Integrated from any first attitude.
        times: (Na,) measurement times, each one of `reference.time`.
        attitude_xyzw: (Na, 4).

    Returns:
        The rotation that belongs at `reference.time[0]`.
    """
    at = reference.rotation[np.searchsorted(reference.time, times)]
    relative = Rotation.from_quat(attitude_xyzw) * at.inv()
    return relative.mean() * reference.rotation[0]
