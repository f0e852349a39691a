"""Levels against frequency of what no cause explains of an arm's torques, joint by joint."""

from __future__ import annotations

import numpy as np

from ...types import Array
from .arm_rows import ArmRows
from .leftover import VARIANCES, JointRows
from .reml import level_of

_DRIFT = 0.03
"""Of a torque's rms: how far the level of friction and a gain may drift unnamed. More would be the
friction or the gain themselves (docs/real_machines.md)."""
_FRICTION_DRIFT = 0.1  # of the friction that was found


def leftover_levels(rows: ArmRows, priors: Array, friction: Array) -> list[Array]:
    """Level of every set of `ArmRows.joints`; see `leftover_level`."""
    every = enumerate(rows.joints)
    return [leftover_level(rows, k, priors, friction, own) for k, own in every]


def leftover_level(rows: ArmRows, k: int, priors: Array, friction: Array, own: JointRows) -> Array:
    """(8,) variances of the leftover of a set of `ArmRows.joints`; NaN of one without rows.

    Args:
        rows: The recordings.
        k: Number of the set.
        priors: (K,) standard deviation of every coefficient.
        friction: (n,) Coulomb friction that was found [N m].
        own: Its rows, or some of them.
    """
    if not len(own.torque):
        return np.full(VARIANCES, np.nan)
    j = k % len(friction)
    scale = float(rows.scale[j])
    friction_drift = max(_DRIFT * scale, _FRICTION_DRIFT * friction[j])
    gain_drift = _DRIFT * scale * (k == j and rows.is_driven[j])
    drift = np.array([friction_drift, gain_drift, scale, scale])[: own.observed.shape[1]]
    free, _ = np.linalg.qr((rows.anchors * priors).T)
    return level_of(own, priors, scale, drift, free)
