"""What models are worth to joints without a motor: how far they swing as predicted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...estimation.balance.balance import Balance
from ...estimation.balance.free_joints import HORIZON, predict_free_joints
from ...types import Array
from .result import FreeMotion


def free_motion(before: Sequence[Balance], after: Sequence[Balance]) -> tuple[FreeMotion, ...]:
    """Predictions over `HORIZON` of every joint that has no motor, or one that is off.

    Args:
        before: The model as it stands, along every recording.
        after: The extended model along the same.
    """
    robot = before[0].robot
    squares = _squares(before), _squares(after)
    return tuple(
        FreeMotion(
            joint=joint,
            horizon=HORIZON,
            windows=len(squares[0][joint]),
            rms_before=float(np.sqrt(np.mean(squares[0][joint]))),
            rms_after=float(np.sqrt(np.mean(squares[1][joint]))),
            median_before=float(np.sqrt(np.median(squares[0][joint]))),
            median_after=float(np.sqrt(np.median(squares[1][joint]))),
            unit=robot.unit_of('rad', joint),
        )
        for joint in squares[0]
    )


def _squares(balances: Sequence[Balance]) -> dict[str, Array]:
    """By joint, mean squared error of every window of all recordings."""
    found: dict[str, list[Array]] = {}
    for balance in balances:
        for joint, errors in predict_free_joints(balance).items():
            found.setdefault(joint, []).append(errors)
    return {joint: np.concatenate(errors) for joint, errors in found.items()}
