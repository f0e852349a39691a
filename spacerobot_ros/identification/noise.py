"""Sensor noise from the data, where the robot file does not state it.

Fourth differences of a smooth signal are noise alone, with variance 70 sigma^2 (1 + 16 + 36 + 16 +
1).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ..estimation.noise_levels import fourth_difference_std
from ..estimation.smoothing import SensorData
from ..model.settings import SensorSettings
from ..types import Array

# Below any real sensor, and far enough above rounding for the filter's covariance.
_FLOOR = {
    'joint_position_std': 1e-8,
    'joint_velocity_std': 1e-7,
    'gyro_std': 1e-8,
    'attitude_std': 1e-8,
}


def noise_levels(
    sensors: SensorSettings, data: SensorData
) -> tuple[dict[str, float], tuple[str, ...]]:
    """Standard deviations of one sample: as stated, else estimated from fourth differences.

    Args:
        sensors: What the robot file states.
        data: Samples.

    Returns:
        Standard deviation by name (`joint_position_std`, `joint_velocity_std`, `gyro_std`,
        `attitude_std`), and a note for each one that was estimated.
    """
    turns = Rotation.from_quat(data.attitude_xyzw) if len(data.attitude_xyzw) else None
    signals = {
        'joint_position_std': data.q,
        'joint_velocity_std': data.qd,
        'gyro_std': data.omega,
        'attitude_std': _accumulated(turns),
    }
    levels, notes = {}, []
    for name, values in signals.items():
        stated = getattr(sensors, name)
        levels[name] = max(
            stated if stated is not None else fourth_difference_std(values), _FLOOR[name]
        )
        if stated is None:
            notes.append(f'{name} is not stated; estimated from the data: {levels[name]:.3g}')
    return levels, tuple(notes)


def _accumulated(turns: Rotation | None) -> Array:
    if turns is None or len(turns) < 2:
        return np.zeros((0, 3))
    steps = (turns[:-1].inv() * turns[1:]).as_rotvec()
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
