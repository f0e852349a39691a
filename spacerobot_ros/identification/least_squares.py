r"""The published method: linear least squares on the momentum equation, sample by sample.

    R_k^T h_W - sum_b R_b h_b - Y(q, q', w) x = h0        # eqs. (22)-(28) of the identification
    paper

Rows are taken to the inertial frame, where the total momentum h_W is a constant unknown (never the
first sample's). Noise in the regressor biases the result towards zero; `method='ml'` is the
remedy, this is the comparison.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Slerp

from ..errors import IdentificationError
from ..estimation.filters.momentum_filter import SquareRootInformation
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.trajectory.reference import Kinematics, NoiseLevels
from ..model.settings import IdentifierSettings
from ..recording.record import Record
from ..types import Array
from .summary import Solution
from .weak_prior import weak_prior

_BLOCK = 50  # rows added at once by the recursive form


def sampled_motion(record: Record) -> Kinematics:
    """Raw samples at the joints' stamps: gyro and attitude interpolated, nothing smoothed.

    Raises:
        IdentificationError: fewer than two gyro or attitude samples, or no stretch that all
            sensors cover.
    """
    rate_time, attitude_time, attitude = record.rate_time, record.attitude_time, record.attitude
    if attitude is None or min(len(rate_time), len(attitude_time)) < 2:
        raise IdentificationError('least squares needs at least two gyro and two attitude samples')
    start = max(rate_time[0], attitude_time[0])
    end = min(rate_time[-1], attitude_time[-1])
    inside = (record.joint_time >= start) & (record.joint_time <= end)
    if record.qd is None or not np.any(inside):
        raise IdentificationError(
            'least squares needs joint positions and rates while gyro and attitude are measured'
        )
    time = record.joint_time[inside]
    omega = np.column_stack([np.interp(time, rate_time, column) for column in record.omega.T])
    rotation = Slerp(attitude_time, attitude)(time)
    return Kinematics(time, record.q[inside], record.qd[inside], omega, rotation)


def momentum_rows(model: MomentumModel, motion: Kinematics) -> tuple[Array, Array]:
    """(3 N, p) columns of [h_W; AAM; x] and (3 N,) right-hand side, in the inertial frame."""
    columns, h0 = model.regressor(motion)
    R = motion.matrices
    return (R @ columns).reshape(-1, model.size), np.einsum('nab,nb->na', R, h0).ravel()


def solve_least_squares(
    model: MomentumModel,
    settings: IdentifierSettings,
    motion: Kinematics,
    noise: NoiseLevels,
    method: str,
) -> Solution:
    """Least squares for [h_W; AAM; x], at once or recursively in square-root form.

    The information is scaled by the residual's own spread; the residual is judged against the
    sensors' noise.

    Args:
        model: Robot and minimal set.
        settings: For the prior, which is no part of the estimate but tells what is excited.
        motion: From `sampled_motion`.
        noise: Noise levels, to judge the residual.
        method: `ls`, or `recursive` to add rows block by block.
    """
    columns, values = momentum_rows(model, motion)
    information = SquareRootInformation(model.size)
    step = _BLOCK if method == 'recursive' else len(values)
    for start in range(0, len(values), step):
        information.add(columns[start : start + step], values[start : start + step])
    constants, _ = information.solve()
    residual = values - columns @ constants
    dof = max(len(values) - model.size, 1)
    information.factor /= max(float(np.sqrt(residual @ residual / dof)), 1e-300)
    information.shift(constants)
    information.residual = _chi2(model, motion, constants, noise)
    return Solution(method, constants, information, weak_prior(model, motion, settings))


def _chi2(model: MomentumModel, motion: Kinematics, constants: Array, noise: NoiseLevels) -> float:
    """Residual as a body-rate error, weighted by the sensors' noise sample by sample."""
    rate = model.linearize(motion, constants)
    levels = [noise.attitude, noise.joint_position, noise.joint_velocity]
    variance = np.repeat(np.square(levels), [3, model.n, model.n])
    covariance = (rate.state * variance) @ np.swapaxes(rate.state, 1, 2)
    covariance += noise.gyro**2 * np.eye(3)
    weighted = np.linalg.solve(covariance, rate.offset[..., None])[..., 0]
    return float(np.sum(rate.offset * weighted))
