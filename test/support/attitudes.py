"""Attitudes compared by SciPy."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation


def angle_between(q_a_xyzw: np.ndarray, q_b_xyzw: np.ndarray) -> float:
    """Angle between two attitudes [rad], whatever the quaternions' signs and lengths."""
    a, b = (Rotation.from_quat(q) for q in (q_a_xyzw, q_b_xyzw))
    return float((a.inv() * b).magnitude())


def quaternion_rate(q_xyzw, omega_B):
    """Time derivative of the attitude quaternion, 1/2 q * [omega_B, 0].

    Args:
        q_xyzw: (4,) attitude.
        omega_B: (3,) angular velocity of the base in base coordinates [rad/s].
    """
    x, y, z, w = q_xyzw
    a, b, c = omega_B
    return 0.5 * np.array(
        [
            w * a + y * c - z * b,
            w * b + z * a - x * c,
            w * c + x * b - y * a,
            -x * a - y * b - z * c,
        ]
    )
