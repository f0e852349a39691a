"""The noise of the experiments, and records of a motion with it.

The paper's noise models are in a reference that we do not have; nominal here is a realistic level,
and scale 0.1 is where plain least squares makes the errors that the paper prints
(docs/reproduction.md).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ..estimation.reference import Kinematics, NoiseLevels
from ..model.robot_settings import SensorSettings
from ..recording.record import AttitudeSeries, JointSeries, RateSeries, Record

NOMINAL = {
    'joint_position': 1e-4,  # rad
    'joint_velocity': 1e-3,  # rad/s
    'gyro': 1e-4,  # rad/s
    'attitude': 1e-4,  # rad
}
SCALES = (1.0, 0.1)


def noise_of(scale: float) -> SensorSettings:
    """The nominal noise times a factor."""
    return SensorSettings(**{f'{name}_std': scale * std for name, std in NOMINAL.items()})


def levels_of(scale: float) -> NoiseLevels:
    """The same as the momentum filter takes it; efforts are not measured."""
    stds = {name: scale * std for name, std in NOMINAL.items()}
    return NoiseLevels(**stds, joint_effort=np.inf)


def noisy_record(
    joints: tuple[str, ...], motion: Kinematics, scale: float, seed: int, attitude_every: int = 1
) -> Record:
    """The motion as the sensors see it.

    Args:
        joints: Joint names.
        motion: Noise-free samples.
        scale: Factor on the nominal noise.
        seed: Of the noise.
        attitude_every: Samples from one attitude to the next.
    """
    rng = np.random.default_rng(seed)
    stamps = np.round(motion.time * 1e9).astype(np.int64)
    q, qd, omega, turn = (
        scale * std * rng.standard_normal(like.shape)
        for std, like in zip(
            NOMINAL.values(), (motion.q, motion.qd, motion.omega, motion.omega), strict=True
        )
    )
    attitude = (motion.rotation * Rotation.from_rotvec(turn)).as_quat()
    return Record(
        JointSeries(joints, stamps, motion.q + q, motion.qd + qd),
        RateSeries(stamps, motion.omega + omega),
        AttitudeSeries(stamps[::attitude_every], attitude[::attitude_every]),
        source=f'noise scale {scale:g}, seed {seed}',
    )
