"""Attitudes compared by SciPy."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation


def angle_between(q_a_xyzw: np.ndarray, q_b_xyzw: np.ndarray) -> float:
    """Angle between two attitudes [rad], whatever the quaternions' signs and lengths."""
    a, b = (Rotation.from_quat(q) for q in (q_a_xyzw, q_b_xyzw))
    return float((a.inv() * b).magnitude())
