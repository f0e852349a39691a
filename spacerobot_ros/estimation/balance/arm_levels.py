"""Levels against frequency of what no cause explains of an arm's torques, joint by joint."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...types import Array
from .arm_rows import ArmRows
from .leftover import VARIANCES, JointRows, level_of

_DRIFT = 0.03
"""Of a torque's rms: how far the level of friction and a gain may drift unnamed. More would be the
friction or the gain themselves (docs/real_machines.md)."""
_FRICTION_DRIFT = 0.1  # of the friction that was found


def leftover_levels(
    rows: ArmRows, priors: Array, friction: Array, joints: Sequence[JointRows] | None = None
) -> list[Array]:
    """(8,) variances of the leftover of every set of `ArmRows.joints`; NaN of one without rows.

    Args:
        rows: The recordings.
        priors: (K,) standard deviation of every coefficient.
        friction: (n,) Coulomb friction that was found [N m].
        joints: Rows of every joint; None: all there are.
    """
    scale = np.tile(rows.scale, 2)
    friction_drift = np.maximum(_DRIFT * scale, _FRICTION_DRIFT * np.tile(friction, 2))
    gain_drift = _DRIFT * scale * np.append(rows.is_driven, np.zeros_like(rows.is_driven))
    drifts = np.column_stack([friction_drift, gain_drift, scale, scale])
    free, _ = np.linalg.qr((rows.anchors * priors).T)
    sets = zip(joints or rows.joints, scale.tolist(), drifts, strict=True)
    return [
        level_of(own, priors, s, drift[: own.observed.shape[1]], free)
        if len(own.torque)
        else np.full(VARIANCES, np.nan)
        for own, s, drift in sets
    ]
