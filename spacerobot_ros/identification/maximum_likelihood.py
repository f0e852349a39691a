"""Maximum-likelihood estimate of the constants from one stretch of data: the filter, iterated about its own result."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..types import Array
from .linearize import MomentumModel, Reference
from .momentum_filter import Measurements, MomentumFilter, Noise
from .smoothing import SensorData, align, smooth, time_grid

_PASSES = 4
_CONVERGED = 0.01  # shift of the constants in standard deviations


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Constants with covariance.

    Args:
        constants: (p,) [h_W; AAM; x].
        covariance: (p, p).
        factor: (p, p) square root of the information.
        chi2_per_dof: Whitened innovations' mean square.
        passes: Filter passes until converged.
    """

    constants: Array
    covariance: Array
    factor: Array
    chi2_per_dof: float
    passes: int


def estimate_constants(model: MomentumModel, data: SensorData, levels: dict[str, float]) -> Solution:
    """Estimate total momentum, AAM and minimal parameters.

    Args:
        model: Robot and minimal set.
        data: Samples.
        levels: Noise levels by name, from `noise_levels`.
    """
    times = time_grid(data)
    stds = (levels['joint_position_std'], levels['joint_velocity_std'], levels['gyro_std'])
    smoothed = smooth(data, times[0], times[-1], stds)
    reference = smoothed.reference(times, Rotation.identity())
    reference = smoothed.reference(times, align(reference, data.attitude_time, data.attitude_xyzw))
    noise = Noise(*stds, levels['attitude_std'], smoothed.snap_density(times))
    measured = measurements(data, reference)
    constants = model.prior()
    constants[:3] = first_momentum(model, reference, constants)
    for count in range(1, _PASSES + 1):
        engine = MomentumFilter(model.n, model.size, noise)
        engine.run(reference, model.linearize(reference, constants), measured)
        change, covariance = engine.information.solve()
        constants = constants + change
        std = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        if np.max(np.abs(change) / std) < _CONVERGED:
            break
    dof = engine.information.rows - model.size - 3 - 4 * model.n
    return Solution(
        constants, covariance, engine.information.factor[:, :-1], engine.information.residual / max(dof, 1), count
    )


def measurements(data: SensorData, reference: Reference) -> Measurements:
    """Put samples on the reference's times, as deviations from it where the filter wants that."""
    count, n = len(reference.time), data.q.shape[1]
    q, qd = np.full((count, n), np.nan), np.full((count, n), np.nan)
    gyro, attitude = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    j, r, a = (np.searchsorted(reference.time, t) for t in (data.joint_time, data.rate_time, data.attitude_time))
    q[j], qd[j] = data.q, data.qd
    gyro[r] = data.omega - reference.omega[r]
    if len(a):
        attitude[a] = (reference.rotation[a].inv() * Rotation.from_quat(data.attitude_xyzw)).as_rotvec()
    return Measurements(q, qd, gyro, attitude)


def first_momentum(model: MomentumModel, reference: Reference, constants: Array) -> Array:
    """(3,) total momentum that fits the reference best, the other constants given."""
    columns, h0 = model.regressor(reference)
    rest = h0 - columns[..., 3:] @ constants[3:]
    return np.asarray(np.mean(reference.rotation.apply(rest), axis=0))
