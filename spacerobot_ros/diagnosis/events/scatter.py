r"""Where a model misses more: near reversals, whose friction no law knows, at speed, in one run.

    log |left| = x' c + noise,

over features x of a joint's rows: how slow it is, how fast, how fast the whole arm is, how much it
accelerates, and the recording. Rows are divided by exp(x' c), so that the level of what is left is
that of all rows. Without it a reversal looks like a push, and all other rows like noise; so does a
rough drive's recording among smooth ones.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...estimation.balance.arm_rows import ArmRows
from ...types import Array
from .scan import PulseScan

_SLOW = 0.1  # of the 95 % rate: over which friction turns
_FLOOR = 0.1  # of the median of what is left: less is as good as that
_RIDGE = 10.0  # rows without any scatter
_LEAST = 1.0  # of the median scale: where little is left of the model, it may be chance


def scales(scan: PulseScan, before: Sequence[Array]) -> list[Array]:
    """(M,) scale of every joint's rows.

    Args:
        scan: A model, its rows by the scales before.
        before: Those.
    """
    out = []
    for j, scale in enumerate(before):
        kept = ~scan.joints[j].left_out
        left = np.abs(scan.left(j)) * scale[kept]
        if not len(left) or not np.median(left) > 0.0:
            out.append(np.ones(len(scale)))
            continue
        features = _features(scan.rows, j)
        features = (features - np.mean(features, axis=0)) / np.maximum(
            np.std(features, axis=0), 1e-9
        )
        logs = np.log(left / np.median(left) + _FLOOR)
        own = features[kept]
        square = own.T @ own + _RIDGE * np.eye(features.shape[1])
        share = np.exp(features @ np.linalg.solve(square, own.T @ (logs - np.mean(logs))))
        out.append(np.maximum(share / np.median(share), _LEAST))
    return out


def _features(rows: ArmRows, k: int) -> Array:
    """(M, 4 + R) of the rows of a set, the last of them each recording's."""
    out, j = [], k % rows.robot.n_joints
    for run, balance in enumerate(rows.balances):
        arm = balance.arm
        rate, turn = np.abs(arm.kinematics.qd), np.abs(arm.kinematics.qdd)
        usual = np.maximum(np.quantile(rate, 0.95, axis=0), 1e-9)
        slow = np.exp(-((rate[:, j] / (_SLOW * usual[j])) ** 2))
        each = [slow, rate[:, j] / usual[j], np.mean(rate / usual, axis=1)]
        each.append(np.mean(turn / np.maximum(np.quantile(turn, 0.95, axis=0), 1e-9), axis=1))
        smooth = np.maximum(arm.in_band(np.column_stack(each)), 0.0)
        smooth[:, 1:] = np.log(smooth[:, 1:] + 0.05)
        moving = smooth[:: arm.stride][rows.rows_at(balance, k)]
        own = np.arange(len(rows.balances)) == run
        out.append(np.column_stack([moving, np.tile(own, (len(moving), 1))]))
    return np.concatenate(out)
