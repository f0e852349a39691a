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

from ..errors import ConfigurationError
from ..estimation.minimal import MinimalSet
from ..estimation.momentum_process import MomentumModel
from ..estimation.reference import Kinematics
from ..model.robot import Robot
from ..model.settings import SensorSettings
from ..types import Array
from .sensitivity import ORDER, Intervals, MotionCurve, basis

_STDS = ('joint_position_std', 'joint_velocity_std', 'gyro_std', 'attitude_std')
_FREE = 1e-4  # 1/rad; keeps the factor triangular where nothing was measured, and tells nothing


@dataclass(frozen=True, slots=True, eq=False)
class SensorPlan:
    """When each sensor measures and how well; a standard deviation of None: not measured.

    Args:
        joint_time: (Nj,) increasing, in the motion's time [s].
        rate_time: (Ng,). attitude_time: (Na,).
        joint_position_std: [rad]. joint_velocity_std: [rad/s].
        gyro_std: [rad/s]. attitude_std: [rad] an axis.

    Raises:
        ConfigurationError: times that do not increase, or a standard deviation not above zero.
    """

    joint_time: Array
    rate_time: Array
    attitude_time: Array
    joint_position_std: float | None
    joint_velocity_std: float | None
    gyro_std: float | None
    attitude_std: float | None

    def __post_init__(self) -> None:
        """Check."""
        for name in ('joint_time', 'rate_time', 'attitude_time'):
            time = getattr(self, name)
            if not np.all(np.isfinite(time)) or np.any(np.diff(time) <= 0.0):
                raise ConfigurationError(f'plan.{name}', 'must be finite and increasing')
        for name in _STDS:
            std = getattr(self, name)
            if std is not None and not 0.0 < std < np.inf:
                raise ConfigurationError(f'plan.{name}', f'{std} must be finite and above zero')

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
        joints, rates, attitudes = (
            np.arange(int(duration * rate + 1e-9) + 1) / rate
            for rate in (joint_rate, imu_rate, attitude_rate)
        )
        stds = {name: getattr(sensors, name) for name in _STDS}
        return cls(joints, rates, attitudes, **stds)


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
    motion: Kinematics,
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
    intervals = Intervals(model, MotionCurve(motion), knot_spacing)
    rows = _measured_rows(intervals, plan)
    factor = _chain(intervals, rows)
    covariance, rank = _invert(factor[3:, 3:])
    return CramerRaoBound(factor, model.n_aam, rank, covariance)


def _measured_rows(intervals: Intervals, plan: SensorPlan) -> list[list[Array]]:
    """Whitened rows (r, C) of every interval."""
    rows: list[list[Array]] = [[] for _ in range(intervals.count)]
    if plan.gyro_std is not None and len(plan.rate_time):
        time = plan.rate_time
        matrix, drive = intervals.rates(time, intervals.locate(time)[1])
        _sort(rows, intervals, time, (matrix @ intervals.attitude(time) + drive) / plan.gyro_std)
    if plan.attitude_std is not None and len(plan.attitude_time):
        time = plan.attitude_time
        _sort(rows, intervals, time, intervals.attitude(time) / plan.attitude_std)
    for interval, joint in enumerate(_joint_rows(intervals, plan)):
        whole = np.zeros((joint.shape[0] * intervals.n, intervals.width))
        whole[:, 3 : 3 + ORDER * intervals.n] = np.kron(joint, np.eye(intervals.n))
        rows[interval].append(whole)
    return rows


def _sort(rows: list[list[Array]], intervals: Intervals, time: Array, values: Array) -> None:
    """Give every interval its own rows of values (N, 3, C)."""
    index, _ = intervals.locate(time)
    bounds = np.searchsorted(index, np.arange(intervals.count + 1))
    for interval, (first, last) in enumerate(pairwise(bounds)):
        if last > first:
            rows[interval].append(values[first:last].reshape(-1, intervals.width))


def _joint_rows(intervals: Intervals, plan: SensorPlan) -> list[Array]:
    """(r, 6) rows of every interval by a joint's own coefficients, the same for all joints."""
    index, u = intervals.locate(plan.joint_time)
    weighted = [np.zeros((0, ORDER))]
    owners = [np.zeros(0, dtype=int)]
    for derivative, std in enumerate((plan.joint_position_std, plan.joint_velocity_std)):
        if std is not None:
            weighted.append(basis(u, derivative) / intervals.length**derivative / std)
            owners.append(index)
    values, owner = np.concatenate(weighted), np.concatenate(owners)
    return [_triangle(values[owner == interval]) for interval in range(intervals.count)]


def _chain(intervals: Intervals, rows: list[list[Array]]) -> Array:
    """(p, p) square-root information of t, everything else eliminated interval by interval.

    A coefficient is eliminated when its last interval has been added; psi is taken from the
    start to the end of each.
    """
    n, width, joints = intervals.n, intervals.width, ORDER * intervals.n
    pending = np.zeros((3 + joints, width))
    pending[:, : 3 + joints] = _FREE * np.eye(3 + joints)
    for interval in range(intervals.count):
        stacked = np.concatenate([pending, *rows[interval]])
        end = intervals.psi[interval, -1]
        by_end = np.linalg.solve(end[:, :3].T, stacked[:, :3].T).T
        rest = stacked[:, 3:] - by_end @ end[:, 3:]
        triangle = _triangle(np.concatenate([rest[:, :n], by_end, rest[:, n:]], axis=1))[n:]
        pending = np.zeros((len(triangle) + n, width))
        pending[n:, : 3 + joints - n] = triangle[:, n : 3 + joints]
        pending[n:, 3 + joints :] = triangle[:, 3 + joints :]
        pending[:n, 3 + joints - n : 3 + joints] = _FREE * np.eye(n)
    triangle = _triangle(pending)[3 + joints :, 3 + joints :]
    factor = np.zeros((intervals.p, intervals.p))
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
