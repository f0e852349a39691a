"""Joints where what the model misses drives the motion, as efforts of the wrong sign do.

    s = sum(e q') / sum|e q'|,    e = measured - needed torque

is 1 where friction alone is missing, near 0 where a mass is: its work comes back. Of 17 joints of
four measured machines s is above 0.4 at twelve, and -0.77 at the least, where a file's inertias
are wrong; with the sign of a joint's efforts turned it was -0.96 to -1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...estimation.balance.balance import Balance
from ...types import Array
from .arm_found import ArmFound
from .arm_verdict import Left

_DRIVES = -0.9  # of the work


def driving_notes(found: ArmFound, left: Left) -> tuple[str, ...]:
    """What to say of such joints, of which more is left than usual."""
    shares, joints = braking(found.fit.rows.balances), found.robot.joints
    return tuple(
        f'{joints[j]}: what the model misses of its efforts drives the motion ({-shares[j]:.0%} '
        'of the work), where friction would brake it: are they of the wrong sign?'
        for j in left.unusual
        if shares[j] < _DRIVES
    )


def braking(balances: Sequence[Balance]) -> Array:
    """(n,) share s of what the model misses at each joint; 0 where nothing moves."""
    net, whole = 0.0, 0.0
    for balance in balances:
        stride = balance.arm.stride
        power = balance.torque * balance.motion.qd[::stride] * balance.arm.is_moving[::stride]
        net, whole = net - np.sum(power, axis=0), whole + np.sum(np.abs(power), axis=0)
    return np.divide(net, whole, out=np.zeros_like(net), where=np.asarray(whole) > 0.0)
