r"""The published method: linear least squares on the momentum equation, sample by sample.

    R_k^T h_W - sum_b R_b h_b - Y(q, q', w) x = h0        # eqs. (22)-(28) of the identification
    paper

Rows are taken to the inertial frame, where the total momentum h_W is a constant unknown (never the
first sample's). Noise in the regressor biases the result towards zero; `method='ml'` is the
remedy, this is the comparison.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from ..errors import IdentificationError
from ..estimation.momentum_filter import SquareRootInformation
from ..estimation.momentum_process import MomentumModel
from ..estimation.reference import Kinematics
from ..estimation.smoothing import SensorData
from ..types import Array

_BLOCK = 50  # rows added at once by the recursive form


def sampled_reference(data: SensorData) -> Kinematics:
    """Raw samples at the joints' stamps: gyro and attitude interpolated, nothing smoothed.

    Raises:
        IdentificationError: fewer than two gyro or attitude samples, or no stretch that all
            sensors cover.
    """
    if min(len(data.rate_time), len(data.attitude_time)) < 2:
        raise IdentificationError('least squares needs at least two gyro and two attitude samples')
    start = max(data.rate_time[0], data.attitude_time[0])
    end = min(data.rate_time[-1], data.attitude_time[-1])
    inside = (data.joint_time >= start) & (data.joint_time <= end)
    if not np.any(inside) or not np.all(np.isfinite(data.qd[inside])):
        raise IdentificationError(
            'least squares needs joint positions and rates while gyro and attitude are measured'
        )
    time = data.joint_time[inside]
    omega = np.column_stack([np.interp(time, data.rate_time, data.omega[:, i]) for i in range(3)])
    rotation = Slerp(data.attitude_time, Rotation.from_quat(data.attitude_xyzw))(time)
    return Kinematics(time, data.q[inside], data.qd[inside], omega, rotation)


def momentum_rows(model: MomentumModel, reference: Kinematics) -> tuple[Array, Array]:
    """(3 N, p) columns of [h_W; AAM; x] and (3 N,) right-hand side, in the inertial frame."""
    columns, h0 = model.regressor(reference)
    R = reference.rotation.as_matrix()
    return (R @ columns).reshape(-1, model.size), np.einsum('nab,nb->na', R, h0).ravel()


def solve_least_squares(
    model: MomentumModel, reference: Kinematics, levels: dict[str, float], recursive: bool
) -> tuple[Array, SquareRootInformation]:
    """Least squares for [h_W; AAM; x], at once or recursively in square-root form.

    Args:
        model: Robot and minimal set.
        reference: Samples, from `sampled_reference`.
        levels: Noise levels by name, to judge the residual.
        recursive: Whether to add rows block by block.

    Returns:
        (p,) constants, and the information of their errors: scaled by the residual's own spread,
            its residual judged
        against the sensors' noise.
    """
    columns, values = momentum_rows(model, reference)
    information = SquareRootInformation(model.size)
    step = _BLOCK if recursive else len(values)
    for start in range(0, len(values), step):
        information.add(columns[start : start + step], values[start : start + step])
    constants, _ = information.solve()
    residual = values - columns @ constants
    dof = max(len(values) - model.size, 1)
    spread = max(float(np.sqrt(residual @ residual / dof)), 1e-300)
    scaled = SquareRootInformation(model.size)
    scaled.factor = information.factor / spread
    scaled.shift(constants)
    chi2 = _chi2(model, reference, constants, levels)
    scaled.rows, scaled.residual = len(values), chi2
    return constants, scaled


def _chi2(
    model: MomentumModel, reference: Kinematics, constants: Array, levels: dict[str, float]
) -> float:
    """Residual as a body-rate error, weighted by the sensors' noise sample by sample."""
    rate = model.linearize(reference, constants)
    variance = np.repeat(
        np.array(
            [levels['attitude_std'], levels['joint_position_std'], levels['joint_velocity_std']]
        )
        ** 2,
        [3, model.n, model.n],
    )
    covariance = (rate.state * variance) @ np.swapaxes(rate.state, 1, 2) + np.eye(3) * levels[
        'gyro_std'
    ] ** 2
    weighted = np.linalg.solve(covariance, rate.offset[..., None])[..., 0]
    return float(np.sum(rate.offset * weighted))
