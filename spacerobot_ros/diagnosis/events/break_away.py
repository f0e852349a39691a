"""From which torque on a joint that stands begins to slide, by the starts of its own motion.

Dry friction holds more than it leaves of a motion, of a light joint nearly twice as much: what a
joint bears by itself before it starts is no push.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...estimation.balance.balance import Balance
from ...types import Array

_BEFORE, _AFTER = 0.3, 0.25  # s of a start: where torque is largest, and the way has its sign
_FEWEST = 2  # starts: one may be a push


def break_away(balances: Sequence[Balance]) -> Array:
    """(n,) torques at which joints start, the median of all starts; 0 where few are seen [N m]."""
    joints = range(balances[0].robot.n_joints)
    every = [np.array([x for b in balances for x in _starts(b, j)]) for j in joints]
    return np.array([float(np.median(x)) if len(x) >= _FEWEST else 0.0 for x in every])


def _starts(balance: Balance, j: int) -> Iterator[float]:
    """Torque along the coming way that a joint bears before each start, the model's taken off."""
    arm = balance.arm
    stands = arm.rests[:, j] & arm.is_known & arm.powered[:, j]
    before, after = round(_BEFORE / arm.step), round(_AFTER / arm.step)
    borne, q = -arm.in_band(balance.missed[:, j]), arm.kinematics.q[:, j]
    for at in np.flatnonzero(stands[:-1] & ~stands[1:]).tolist():
        was, goes = slice(max(at - before, 0), at + 1), slice(at + 1, at + 1 + after)
        if stands[was].all() and arm.is_moving[goes, j].any():
            way = np.sign(q[goes][-1] - q[at])
            yield float(np.max(way * borne[was]))
