"""Where a model misses more: a joint that reverses has a friction that no law knows.

Rows near a reversal are divided by how much more is left of them than of others, so that the
level of what is left is that of all rows. Without it a reversal looks like a push, and all other
rows like noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...estimation.arm_rows import ArmRows
from ...types import Array
from .scan import PulseScan

_SLOW = 0.1  # of the 95 % rate: over which friction turns
_NEAR, _AWAY = 0.3, 0.05  # of a row's slowness
_FULL = 0.5
_FEWEST = 10  # rows on each side


def even(rows: ArmRows) -> list[Array]:
    """Scales of one for every joint."""
    return [np.ones(len(joint.torque)) for joint in rows.joints]


def scales(scan: PulseScan, before: Sequence[Array]) -> list[Array]:
    """(M,) scale of every joint's rows.

    Args:
        scan: A model, its rows by the scales before.
        before: Those.
    """
    out = []
    for j, scale in enumerate(before):
        slow = _slowness(scan.rows, j)
        own = slow[~scan.left_out[j]]
        left = np.abs(scan.left(j)) * scale[~scan.left_out[j]]
        near, away = left[own > _NEAR], left[own < _AWAY]
        is_told = min(len(near), len(away)) >= _FEWEST and np.median(away) > 0.0
        ratio = float(np.median(near) / np.median(away)) if is_told else 1.0
        out.append(1.0 + max(ratio - 1.0, 0.0) * np.minimum(slow / _FULL, 1.0))
    return out


def _slowness(rows: ArmRows, k: int) -> Array:
    """(M,) from 0, fast, to 1, at rest, of the rows of a set."""
    out, j = [], k % rows.robot.n_joints
    for balance in rows.balances:
        arm = balance.arm
        rate = np.abs(arm.kinematics.qd[:, j])
        turn = max(_SLOW * float(np.quantile(rate, 0.95)), 1e-9)
        slow = np.clip(arm.in_band(np.exp(-((rate / turn) ** 2))), 0.0, 1.0)
        out.append(slow[:: arm.stride][rows.rows_at(balance, k)])
    return np.concatenate(out)
