"""The noise of the experiments, and records of a motion with it.

The paper's noise models are in a reference that we do not have; nominal here is a realistic level,
and scale 0.1 is where plain least squares makes the errors that the paper prints
(docs/reproduction.md).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ..estimation.reference import Kinematics
from ..identification.cramer_rao import SensorPlan
from ..model.settings import SensorSettings
from ..recording.record import AttitudeSeries, JointSeries, RateSeries, Record

_JOINT_POSITION, _JOINT_VELOCITY, _GYRO, _ATTITUDE = (
    1e-4,
    1e-3,
    1e-4,
    1e-4,
)  # rad, rad/s, rad/s, rad
SCALES = (1.0, 0.1)


def noise_of(scale: float) -> SensorSettings:
    """The nominal noise times a factor."""
    return SensorSettings(
        joint_position_std=scale * _JOINT_POSITION,
        joint_velocity_std=scale * _JOINT_VELOCITY,
        gyro_std=scale * _GYRO,
        attitude_std=scale * _ATTITUDE,
    )


def plan_of(motion: Kinematics, scale: float) -> SensorPlan:
    """All sensors at the motion's own times, for the Cramer-Rao bound."""
    noise, times = noise_of(scale), motion.time
    return SensorPlan(
        times,
        times,
        times,
        noise.joint_position_std,
        noise.joint_velocity_std,
        noise.gyro_std,
        noise.attitude_std,
    )


def noisy_record(joints: tuple[str, ...], motion: Kinematics, scale: float, seed: int) -> Record:
    """The motion as the sensors see it.

    Args:
        joints: Joint names.
        motion: Noise-free samples.
        scale: Factor on the nominal noise.
        seed: Of the noise.
    """
    rng = np.random.default_rng(seed)
    shape = motion.q.shape
    stamps = np.round(motion.time * 1e9).astype(np.int64)
    q = motion.q + scale * _JOINT_POSITION * rng.standard_normal(shape)
    qd = motion.qd + scale * _JOINT_VELOCITY * rng.standard_normal(shape)
    omega = motion.omega + scale * _GYRO * rng.standard_normal(motion.omega.shape)
    turns = Rotation.from_rotvec(scale * _ATTITUDE * rng.standard_normal(motion.omega.shape))
    attitude = (motion.rotation * turns).as_quat()
    return Record(
        JointSeries(joints, stamps, q, qd),
        RateSeries(stamps, omega),
        AttitudeSeries(stamps, attitude),
        source=f'noise scale {scale:g}, seed {seed}',
    )
