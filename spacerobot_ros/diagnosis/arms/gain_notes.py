"""A scale of its torques that would explain what is left of a joint, where it has no name.

Torques that are no torque sensor's may be 8 % off their scale on any machine, beside which three
times as much is too little evidence for a name.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...estimation.balance.balance import Balance
from ...model.robot_settings import LINK_SIDE
from ..limits import MOST
from .arm_found import ArmFound
from .arm_verdict import Left


def gain_notes(found: ArmFound, left: Left) -> tuple[str, ...]:
    """What to say of every joint of which more is left than usual."""
    kinds = dict(zip(found.robot.arm, found.robot.effort_kinds, strict=True))
    joints = [j for j in left.unusual if kinds.get(found.robot.joints[j]) != LINK_SIDE]
    return tuple(_notes(found.extended, joints))


def _notes(balances: Sequence[Balance], joints: Sequence[int]) -> Iterator[str]:
    for j in joints:
        gain, share = gain_of(balances, j)
        if share > MOST:
            yield (
                f'{balances[0].robot.joints[j]}: torques that are measured {gain:.3g} times as '
                'large as they are, or bodies so many times as heavy as in the file, would '
                f'explain {share:.0%} of what is left there (squares); that has a name where '
                "`effort_kind: link` says that they are a torque sensor's"
            )


def gain_of(balances: Sequence[Balance], j: int) -> tuple[float, float]:
    """Measured torques of a joint by those that the model needs, and the share that explains.

    By least squares over the rows where it moves; of the square of what the model misses, or of
    what was measured, if that is less: torques that have nothing to do with each other are of no
    other scale.
    """
    every, every_missed = [np.zeros(0)], [np.zeros(0)]
    for balance in balances:
        at = balance.arm.is_moving[:: balance.arm.stride, j]
        needed = balance.in_rows(balance.motion.effort[:, [j]], np.array([j]))
        every.append(needed[at, 0])
        every_missed.append(balance.torque[at, j])
    needed, missed = np.concatenate(every), np.concatenate(every_missed)
    slope = float(missed @ needed) / max(float(needed @ needed), 1e-300)
    left, measured = missed - slope * needed, needed - missed
    least = max(min(float(missed @ missed), float(measured @ measured)), 1e-300)
    return 1.0 - slope, 1.0 - float(left @ left) / least
