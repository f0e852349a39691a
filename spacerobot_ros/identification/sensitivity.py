r"""How body rate and attitude along a motion depend on the joint trajectory and on the constants.

The joint trajectory is a uniform quintic B-spline, the constants are t = [h_W; AAM; x], and psi is
the attitude error in the inertial frame. On every interval between knots psi is a linear function
of the interval's columns: psi at its start, six coefficients a joint, t.

Symbols: S intervals, n joints, p constants, C = 3 + 6 n + p columns.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline, CubicSpline
from scipy.spatial.transform import Rotation

from ..errors import IdentificationError
from ..estimation.momentum_process import MomentumModel
from ..estimation.reference import Kinematics
from ..types import Array

ORDER = 6  # coefficients that a quintic spline has on each interval
_LONGEST_STEP = 0.05  # s; Runge-Kutta of the smooth, linear attitude error


class MotionCurve:
    """A sampled motion at any time within its span."""

    def __init__(self, motion: Kinematics) -> None:
        self.start, self.end = float(motion.time[0]), float(motion.time[-1])
        quaternions = motion.rotation.as_quat()
        flips = np.cumprod(
            np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0, -1.0, 1.0)
        )
        quaternions[1:] *= flips[:, None]
        self._n = motion.q.shape[1]
        values = np.concatenate([motion.q, motion.qd, motion.omega, quaternions], axis=1)
        self._curve = CubicSpline(motion.time, values)
        self.reference = motion

    def at(self, time: Array) -> Kinematics:
        """The motion at times (N,) within its span [s]."""
        n, values = self._n, self._curve(time)
        return Kinematics(
            time,
            values[:, :n],
            values[:, n : 2 * n],
            values[:, 2 * n : -4],
            Rotation.from_quat(values[:, -4:]),
        )


class Intervals:
    """The attitude error on every interval, as a linear function of the interval's columns.

    Args:
        model: Robot and minimal set.
        motion: Noise-free motion of the model's robot.
        knot_spacing: Distance of the knots, rounded to a whole number of intervals [s].

    Attributes:
        count: Number S of intervals. length: Of each [s]. width: Number C of columns.
        psi: (S, steps + 1, 3, C) at the integration's nodes.
    """

    def __init__(self, model: MomentumModel, motion: MotionCurve, knot_spacing: float) -> None:
        self._model, self._motion = model, motion
        self._constants = model.prior()
        self._constants[:3] = model.total_momentum(motion.reference, self._constants)
        span = motion.end - motion.start
        self.n, self.p = model.n, model.size
        self.count = max(1, round(span / knot_spacing))
        self.length = span / self.count
        self.width = 3 + ORDER * self.n + self.p
        self._steps = max(2, int(np.ceil(self.length / _LONGEST_STEP)))
        self._linear = self._linearize()
        self.psi = self._integrate()

    def locate(self, time: Array) -> tuple[Array, Array]:
        """Interval of each time (N,), increasing, and where in it, from 0 to 1.

        Raises:
            IdentificationError: a time beyond the motion.
        """
        start, end = self._motion.start, self._motion.end
        if len(time) and (time[0] < start - 1e-9 or time[-1] > end + 1e-9):
            raise IdentificationError(
                f'sensor times reach from {time[0]:g} to {time[-1]:g} s, the motion '
                f'from {start:g} to {end:g} s'
            )
        position = (time - self._motion.start) / self.length
        index = np.clip(position.astype(int), 0, self.count - 1)
        return index, position - index

    def rates(self, time: Array, u: Array) -> tuple[Array, Array]:
        """(N, 3, 3) and (N, 3, C) with psi' = first @ psi + second @ columns.

        Args:
            time: (N,) [s].
            u: (N,) where in its interval each time lies, from 0 to 1.
        """
        n = self.n
        linear = self._linear(time)
        by_q, by_rate = linear[..., 3 : 3 + n], linear[..., 3 + n : 3 + 2 * n]
        values, slopes = basis(u, 0), basis(u, 1) / self.length
        joints = by_q[..., None, :] * values[:, None, :, None]
        joints += by_rate[..., None, :] * slopes[:, None, :, None]
        drive = np.zeros((len(time), 3, self.width))
        # coefficient by coefficient, joints inside
        drive[..., 3 : 3 + ORDER * n] = joints.reshape(len(time), 3, -1)
        drive[..., 3 + ORDER * n :] = linear[..., 3 + 2 * n :]
        return linear[..., :3], drive

    def attitude(self, time: Array) -> Array:
        """(N, 3, C) psi at any times, cubic between the integration's nodes."""
        index, u = self.locate(time)
        node = np.clip((u * self._steps).astype(int), 0, self._steps - 1)
        s = (u * self._steps - node)[:, None, None]
        h = self.length / self._steps
        p0, p1 = self.psi[index, node], self.psi[index, node + 1]
        v0, v1 = self._slopes[index, node], self._slopes[index, node + 1]
        return (
            (1.0 + 2.0 * s) * (1.0 - s) ** 2 * p0
            + s * (1.0 - s) ** 2 * h * v0
            + s**2 * (3.0 - 2.0 * s) * p1
            - s**2 * (1.0 - s) * h * v1
        )

    def _linearize(self) -> CubicSpline:
        """(3, 3 + 2 n + p) derivatives of psi' by psi, q, q' and t, as a function of time."""
        count = 2 * self._steps * self.count + 1
        motion = self._motion.at(np.linspace(self._motion.start, self._motion.end, count))
        linear = self._model.linearize(motion, self._constants)
        R = motion.rotation.as_matrix()
        state = R @ linear.state
        state[..., :3] = state[..., :3] @ np.swapaxes(R, 1, 2)
        return CubicSpline(motion.time, np.concatenate([state, R @ linear.constants], axis=2))

    def _integrate(self) -> Array:
        """(S, steps + 1, 3, C) psi at the nodes; Runge-Kutta on all intervals at once."""
        steps, count = self._steps, self.count
        fractions = np.arange(2 * steps + 1) / (2 * steps)
        matrix, drive = self._on_intervals(fractions)
        h = self.length / steps
        psi = np.zeros((count, steps + 1, 3, self.width))
        psi[:, 0, :, :3] = np.eye(3)
        for k in range(steps):
            a, b, c = 2 * k, 2 * k + 1, 2 * k + 2
            x = psi[:, k]
            k1 = matrix[:, a] @ x + drive[:, a]
            k2 = matrix[:, b] @ (x + 0.5 * h * k1) + drive[:, b]
            k3 = matrix[:, b] @ (x + 0.5 * h * k2) + drive[:, b]
            k4 = matrix[:, c] @ (x + h * k3) + drive[:, c]
            psi[:, k + 1] = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        self._slopes = matrix[:, ::2] @ psi + drive[:, ::2]
        return psi

    def _on_intervals(self, fractions: Array) -> tuple[Array, Array]:
        """`rates` at the same fractions of every interval, from 0 to 1."""
        starts = self._motion.start + self.length * np.arange(self.count)[:, None]
        times = np.minimum(starts + self.length * fractions, self._motion.end)
        matrix, drive = self.rates(times.ravel(), np.tile(fractions, self.count))
        shape = (self.count, len(fractions), 3)
        return matrix.reshape(*shape, 3), drive.reshape(*shape, self.width)


def basis(u: Array, derivative: int) -> Array:
    """(N, 6) uniform quintic B-splines that live on an interval, at u (N,) from 0 to 1."""
    knots = np.arange(-ORDER + 1.0, ORDER + 1.0)
    curve = BSpline(knots, np.eye(ORDER), ORDER - 1)
    return np.asarray(curve(u, derivative)) if len(u) else np.zeros((0, ORDER))
