r"""Cramer-Rao bound of the wheel momentum and the minimal parameters along a motion.

What the sensors of a run can tell at best, however they are processed. Unknown are the whole joint
trajectory (a quintic B-spline), the first attitude, the total momentum h_W, and [AAM; x]; body
rate and attitude follow from the conservation of momentum. With psi the attitude error in the
inertial frame,

    psi' = R dw,    dw = D^-1 (E_phi R^T psi + E_q dq + E_q' dq' + V t)      (linearize.py)

every sample is linear in psi(0), the spline's coefficients and the constants' errors t. B-splines
are local: each interval between knots depends on psi at its start, on six coefficients a joint and
on t, and the intervals are chained in square-root form, so that the cost grows with the length of
the run and not with its cube. No estimator is involved.

Symbols: S intervals, n joints, p constants, C = 3 + 6 n + p columns of an interval [psi;
coefficients; t].
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import BSpline, CubicSpline
from scipy.spatial.transform import Rotation

from ..errors import IdentificationError
from ..model.robot import Robot
from ..model.settings import SensorSettings
from ..types import Array
from .linearize import MomentumModel, Reference
from .minimal import MinimalSet

_ORDER = 6  # coefficients that a quintic spline has on each interval
_LONGEST_STEP = 0.05  # s; Runge-Kutta of the smooth, linear attitude error
_FREE = 1e-4  # 1/rad; keeps the factor triangular where nothing was measured, and tells nothing


@dataclass(frozen=True, slots=True, eq=False)
class SensorPlan:
    """When each sensor measures and how well; a standard deviation of None: not measured.

    Args:
        joint_time: (Nj,) increasing, in the motion's time [s].
        rate_time: (Ng,). attitude_time: (Na,).
        joint_position_std: [rad]. joint_velocity_std: [rad/s].
        gyro_std: [rad/s]. attitude_std: [rad] an axis.
    """

    joint_time: Array
    rate_time: Array
    attitude_time: Array
    joint_position_std: float | None
    joint_velocity_std: float | None
    gyro_std: float | None
    attitude_std: float | None

    @classmethod
    def regular(
        cls,
        sensors: SensorSettings,
        duration: float,
        joint_rate: float,
        imu_rate: float,
        attitude_rate: float,
    ) -> SensorPlan:
        """Sensors at constant rates [Hz] from t = 0 to the duration [s], both included."""
        times = [
            np.arange(int(duration * rate + 1e-9) + 1) / rate
            for rate in (joint_rate, imu_rate, attitude_rate)
        ]
        return cls(
            times[0],
            times[1],
            times[2],
            sensors.joint_position_std,
            sensors.joint_velocity_std,
            sensors.gyro_std,
            sensors.attitude_std,
        )


@dataclass(frozen=True, slots=True, eq=False)
class CramerRaoBound:
    """The bound.

    Args:
        factor: (p, p) triangular square root of the Fisher information of [h_W; AAM; x].
        n_aam: Number of wheel-momentum entries.
        rank: Number of directions of [AAM; x] that the data tell.
        covariance: (p - 3, p - 3) bound of [AAM; x] [N m s; kg m^2]; infinite variance where the
            data tell nothing.
    """

    factor: Array
    n_aam: int
    rank: int
    covariance: Array

    @property
    def std(self) -> Array:
        """(p - 3,) smallest standard deviations that an unbiased estimate of [AAM; x] can have."""
        return np.sqrt(np.diag(self.covariance))


def cramer_rao_bound(
    robot: Robot,
    minimal: MinimalSet,
    motion: Reference,
    plan: SensorPlan,
    knot_spacing: float = 0.5,
) -> CramerRaoBound:
    """Bound for one motion of one robot.

    Args:
        robot: The true robot, its captured wheels' momentum included.
        minimal: The parameters to be identified.
        motion: Noise-free motion, sampled every 20 ms or finer, over all the plan's times.
        plan: Sensors.
        knot_spacing: Distance of the knots of the unknown joint trajectory [s]; shorter leaves it
            more freedom.

    Raises:
        IdentificationError: a plan that reaches beyond the motion.
        ConfigurationError: fixed base or prismatic joints.
    """
    model = MomentumModel(robot, minimal)
    pieces = _Pieces(model, _Motion(motion), knot_spacing)
    rows = _measured_rows(pieces, plan)
    factor = _chain(pieces, rows)
    covariance, rank = _invert(factor[3:, 3:])
    return CramerRaoBound(factor, model.n_aam, rank, covariance)


def true_constants(model: MomentumModel, motion: Reference) -> Array:
    """(p,) [h_W; AAM; x] of the model's robot along a motion of its own."""
    constants = model.prior()
    columns, h0 = model.regressor(motion)
    h_B = h0 - columns[..., 3:] @ constants[3:]
    constants[:3] = np.mean(motion.rotation.apply(h_B), axis=0)
    return constants


class _Motion:
    """A sampled motion at any time within its span."""

    def __init__(self, motion: Reference) -> None:
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

    def at(self, time: Array) -> Reference:
        if len(time) and (time.min() < self.start - 1e-9 or time.max() > self.end + 1e-9):
            raise IdentificationError(
                f'sensor times reach from {time.min():g} to {time.max():g} s, the motion '
                f'from {self.start:g} to {self.end:g} s'
            )
        n, values = self._n, self._curve(time)
        return Reference(
            time,
            values[:, :n],
            values[:, n : 2 * n],
            values[:, 2 * n : -4],
            Rotation.from_quat(values[:, -4:]),
        )


class _Pieces:
    """The attitude error on every interval, as a linear function of the interval's columns."""

    def __init__(self, model: MomentumModel, motion: _Motion, knot_spacing: float) -> None:
        self._model, self._motion = model, motion
        self._constants = true_constants(model, motion.reference)
        span = motion.end - motion.start
        self.n, self.p = model.n, model.size
        self.count = max(1, round(span / knot_spacing))
        self.length = span / self.count
        self.width = 3 + _ORDER * self.n + self.p
        self._steps = max(2, int(np.ceil(self.length / _LONGEST_STEP)))
        self.psi = self._integrate()

    def locate(self, time: Array) -> tuple[Array, Array]:
        """Interval of each time, and where in it, from 0 to 1."""
        position = (time - self._motion.start) / self.length
        index = np.clip(position.astype(int), 0, self.count - 1)
        return index, position - index

    def rates(self, time: Array, u: Array) -> tuple[Array, Array]:
        """(N, 3, 3) and (N, 3, C) with psi' = first @ psi + second @ columns.

        Args:
            time: (N,) [s].
            u: (N,) where in its interval each time lies, from 0 to 1.
        """
        reference = self._motion.at(time)
        linear = self._model.linearize(reference, self._constants)
        R = reference.rotation.as_matrix()
        n = self.n
        drive = np.zeros((len(time), 3, self.width))
        by_q, by_rate = R @ linear.state[..., 3 : 3 + n], R @ linear.state[..., 3 + n :]
        values, slopes = basis(u, 0), basis(u, 1) / self.length
        joints = (
            by_q[..., None, :] * values[:, None, :, None]
            + by_rate[..., None, :] * slopes[:, None, :, None]
        )
        drive[..., 3 : 3 + _ORDER * n] = joints.reshape(
            len(time), 3, -1
        )  # coefficient by coefficient, joints inside
        drive[..., 3 + _ORDER * n :] = R @ linear.constants
        return R @ linear.state[..., :3] @ np.swapaxes(R, 1, 2), drive

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
    knots = np.arange(-_ORDER + 1.0, _ORDER + 1.0)
    curve = BSpline(knots, np.eye(_ORDER), _ORDER - 1)
    return np.asarray(curve(u, derivative)) if len(u) else np.zeros((0, _ORDER))


def _measured_rows(pieces: _Pieces, plan: SensorPlan) -> list[list[Array]]:
    """Whitened rows (r, C) of every interval."""
    rows: list[list[Array]] = [[] for _ in range(pieces.count)]
    if plan.gyro_std is not None and len(plan.rate_time):
        matrix, drive = pieces.rates(plan.rate_time, pieces.locate(plan.rate_time)[1])
        _sort(
            rows,
            pieces,
            plan.rate_time,
            (matrix @ pieces.attitude(plan.rate_time) + drive) / plan.gyro_std,
        )
    if plan.attitude_std is not None and len(plan.attitude_time):
        _sort(
            rows,
            pieces,
            plan.attitude_time,
            pieces.attitude(plan.attitude_time) / plan.attitude_std,
        )
    for interval, joint in enumerate(_joint_rows(pieces, plan)):
        whole = np.zeros((joint.shape[0] * pieces.n, pieces.width))
        whole[:, 3 : 3 + _ORDER * pieces.n] = np.kron(joint, np.eye(pieces.n))
        rows[interval].append(whole)
    return rows


def _sort(rows: list[list[Array]], pieces: _Pieces, time: Array, values: Array) -> None:
    """Give every interval its own rows of values (N, 3, C)."""
    index, _ = pieces.locate(time)
    bounds = np.searchsorted(index, np.arange(pieces.count + 1))
    for interval, (first, last) in enumerate(pairwise(bounds)):
        if last > first:
            rows[interval].append(values[first:last].reshape(-1, pieces.width))


def _joint_rows(pieces: _Pieces, plan: SensorPlan) -> list[Array]:
    """(r, 6) rows of every interval by a joint's own coefficients, the same for all joints."""
    index, u = pieces.locate(plan.joint_time)
    weighted = [np.zeros((0, _ORDER))]
    owners = [np.zeros(0, dtype=int)]
    for derivative, std in enumerate((plan.joint_position_std, plan.joint_velocity_std)):
        if std is not None:
            weighted.append(basis(u, derivative) / pieces.length**derivative / std)
            owners.append(index)
    values, owner = np.concatenate(weighted), np.concatenate(owners)
    return [_triangle(values[owner == interval]) for interval in range(pieces.count)]


def _chain(pieces: _Pieces, rows: list[list[Array]]) -> Array:
    """(p, p) square-root information of t, everything else eliminated interval by interval.

    A coefficient is eliminated when its last interval has been added; psi is carried from the
    start to the end of each.
    """
    n, width, joints = pieces.n, pieces.width, _ORDER * pieces.n
    carried = np.zeros((3 + joints, width))
    carried[:, : 3 + joints] = _FREE * np.eye(3 + joints)
    for interval in range(pieces.count):
        stacked = np.concatenate([carried, *rows[interval]])
        end = pieces.psi[interval, -1]
        by_end = np.linalg.solve(end[:, :3].T, stacked[:, :3].T).T
        rest = stacked[:, 3:] - by_end @ end[:, 3:]
        triangle = _triangle(np.concatenate([rest[:, :n], by_end, rest[:, n:]], axis=1))[n:]
        carried = np.zeros((len(triangle) + n, width))
        carried[n:, : 3 + joints - n] = triangle[:, n : 3 + joints]
        carried[n:, 3 + joints :] = triangle[:, 3 + joints :]
        carried[:n, 3 + joints - n : 3 + joints] = _FREE * np.eye(n)
    triangle = _triangle(carried)[3 + joints :, 3 + joints :]
    factor = np.zeros((pieces.p, pieces.p))
    factor[: len(triangle)] = triangle
    return factor


def _triangle(matrix: Array) -> Array:
    return np.asarray(np.linalg.qr(matrix, mode='r'))


def _invert(factor: Array) -> tuple[Array, int]:
    """Covariance, infinite for what lies in the information's null space, and the rank."""
    scale = np.linalg.norm(factor, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    _, singular, right = np.linalg.svd(factor / scale)
    known = singular > 1e-11 * max(float(singular[0]), 1e-300)
    inverse = right[known].T / singular[known]
    covariance = (inverse @ inverse.T) / np.outer(scale, scale)
    lost = np.any(np.abs(right[~known]) > 1e-6, axis=0)
    covariance[lost, lost] = np.inf
    return covariance, int(np.sum(known))
