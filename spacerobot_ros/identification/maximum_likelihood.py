"""Maximum-likelihood estimate from one stretch of data: the filter, iterated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..estimation.momentum_filter import Measurements, MomentumFilter, Noise
from ..estimation.momentum_process import MomentumModel
from ..estimation.nuisances import SensorColumns
from ..estimation.reference import Kinematics
from ..estimation.smoothing import SensorData, Smoothed, align, smooth, time_grid
from ..types import Array
from .prior import Prior

_PASSES = 5
_CONVERGED = 0.01  # shift of the constants in standard deviations


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """One stretch of data made ready for the filter.

    Args:
        data: Samples. reference: At all their stamps. noise: Noise levels. smoothed: The splines
            behind the reference.
    """

    data: SensorData
    reference: Kinematics
    noise: Noise
    smoothed: Smoothed


def prepare(data: SensorData, levels: dict[str, float]) -> Stretch:
    """Smooth a stretch of data into a reference that is aligned with the measured attitudes.

    Args:
        data: Samples, at least a second of each sensor.
        levels: Noise levels by name, from `noise_levels`.
    """
    # Splines say nothing outside the samples they are fitted to.
    start = max(data.joint_time[0], data.rate_time[0])
    end = min(data.joint_time[-1], data.rate_time[-1])
    data = data.between(np.nextafter(start, -np.inf), end)
    times = time_grid(data)
    stds = (levels['joint_position_std'], levels['joint_velocity_std'], levels['gyro_std'])
    smoothed = smooth(data, times[0], times[-1], stds)
    reference = smoothed.reference(times, Rotation.identity())
    if len(data.attitude_time):
        reference = smoothed.reference(
            times, align(reference, data.attitude_time, data.attitude_xyzw)
        )
    noise = Noise(*stds, levels['attitude_std'], smoothed.snap_density(times))
    return Stretch(data, reference, noise, smoothed)


def estimate_constants(
    model: MomentumModel, stretch: Stretch, prior: Prior, start: Array | None = None
) -> tuple[Array, MomentumFilter, bool]:
    """Estimate total momentum, AAM and minimal parameters from one stretch.

    Args:
        model: Robot and minimal set.
        stretch: From `prepare`.
        prior: Weak prior that keeps unexcited directions finite.
        start: (p,) first point of linearisation; the prior's mean by default.

    Returns:
        (p,) constants, the filter about them, and whether they moved by less than 0.01 sigma in
        the last pass.
    """
    constants = prior.mean if start is None else start
    for _ in range(_PASSES):
        engine = start_filter(stretch, prior, constants)
        run_stretch(engine, model, stretch, constants)
        change, covariance = engine.information.solve()
        proposed = prior.admissible(model, stretch.reference, constants, constants + change)
        engine.shift_constants(proposed - constants)
        constants = proposed
        converged = bool(np.max(np.abs(change) / np.sqrt(np.diag(covariance))) < _CONVERGED)
        if converged:
            break
    return constants, engine, converged


def start_filter(stretch: Stretch, prior: Prior, constants: Array) -> MomentumFilter:
    """A filter at the start of a stretch; it holds the prior and counts from `constants`."""
    times = stretch.reference.time
    engine = MomentumFilter(len(prior.mean), stretch.noise, *stretch.smoothed.joint_start(times))
    engine.information.add(np.diag(1.0 / prior.std), (prior.mean - constants) / prior.std)
    engine.information.reset_residual()
    return engine


def run_stretch(
    engine: MomentumFilter, model: MomentumModel, stretch: Stretch, constants: Array
) -> None:
    """Run the filter over a stretch, everything linearised about `constants`."""
    reference = stretch.reference
    measured = measurements(
        stretch.data,
        reference,
        model.nuisances.sensor_columns(
            reference.time, reference.omega, _held(model, stretch, constants)
        ),
        constants[model.other],
    )
    disturbed = stretch.smoothed.disturbed(reference)
    engine.run(reference, model.linearize(reference, constants, disturbed), measured)


def _held(model: MomentumModel, stretch: Stretch, constants: Array) -> Array | None:
    """(N, 3 + n) what holding torques takes off the rates, a unit of k; None: not estimated."""
    holds, time = stretch.data.holds, stretch.reference.time
    if holds is None or 'torque_hold' not in model.nuisances.parts:
        return None
    return holds.shape(time)[:, None] * model.held_jerk(stretch.smoothed, time, constants)


def measurements(
    data: SensorData, reference: Kinematics, columns: SensorColumns, values: Array
) -> Measurements:
    """Put samples on the reference's times, as deviations from it where the filter wants that.

    Args:
        data: Samples, their stamps among the reference's times.
        reference: Reference.
        columns: Derivatives of the measurements by the nuisances.
        values: (m,) their present values, which are taken out of the samples.
    """
    count, n = len(reference.time), data.q.shape[1]
    q, qd = np.full((count, n), np.nan), np.full((count, n), np.nan)
    gyro, attitude = np.full((count, 3), np.nan), np.full((count, 3), np.nan)
    j, r, a = (
        np.searchsorted(reference.time, t)
        for t in (data.joint_time, data.rate_time, data.attitude_time)
    )
    q[j] = data.q - columns.q[j] @ values
    qd[j] = data.qd - columns.qd[j] @ values
    gyro[r] = data.omega - reference.omega[r] - columns.gyro[r] @ values
    if len(a):
        turns = reference.rotation[a].inv() * Rotation.from_quat(data.attitude_xyzw)
        attitude[a] = turns.as_rotvec() - columns.attitude[a] @ values
    return Measurements(q, qd, gyro, attitude, columns)
