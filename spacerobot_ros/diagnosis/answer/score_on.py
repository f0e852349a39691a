"""What an extended model is worth on another record: torques that it misses, before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...effects.effect import Effect
from ...errors import RecordingError
from ...estimation.balance import BAND as BAND
from ...estimation.balance import band_limited
from ...estimation.noise_levels import noise_levels
from ...estimation.observations import observed
from ...estimation.runs import BalanceRun, Run
from ...model.robot import Robot
from ...recording.faults.check import check_data
from ...recording.record import Record

_EDGE = 1.0  # s at both ends, where splines and filters are less sure


@dataclass(frozen=True, slots=True, kw_only=True)
class JointScore:
    """Torque that a model misses at one joint, root mean square below `BAND`.

    Args:
        joint: Its name.
        before: Of the model as it stands [N m].
        after: Of the extended model [N m].
    """

    joint: str
    before: float
    after: float


def score_on(
    record: Record,
    robot: Robot,
    causes: Sequence[Effect],
    believed: Sequence[Effect] = (),
) -> tuple[JointScore, ...]:
    """Hold a model with causes from one record against another; nothing is fitted.

    Args:
        record: The other record, with efforts.
        robot: The robot file's robot.
        causes: What was found.
        believed: The robot file's own effects.

    Raises:
        RecordingError: faulty data, or no efforts in it.
    """
    check_data(record, robot)
    if record.joints is None or record.joints.effort is None:
        raise RecordingError(record.source or 'score', 'has no efforts to hold a model against')
    measured = observed(record, robot)
    run = BalanceRun(Run(measured, robot, believed, noise_levels(robot.sensors, measured)[0]), ())
    before, after = (_rms(run, chosen) for chosen in ((), tuple(causes)))
    return tuple(
        JointScore(joint=joint, before=float(b), after=float(a))
        for joint, b, a in zip(robot.joints, before, after, strict=True)
    )


def total(scores: Sequence[JointScore]) -> tuple[float, float]:
    """Root mean square over the joints, before and after [N m]."""
    before = float(np.sqrt(np.mean([s.before**2 for s in scores])))
    return before, float(np.sqrt(np.mean([s.after**2 for s in scores])))


def to_dict(scores: Sequence[JointScore]) -> dict[str, Any]:
    """Plain values."""
    before, after = total(scores)
    return {
        'unit': 'N m',
        'band_hz': BAND,
        'rms_before': before,
        'rms_after': after,
        'joints': {s.joint: {'rms_before': s.before, 'rms_after': s.after} for s in scores},
    }


def _rms(run: BalanceRun, causes: Sequence[Effect]) -> np.ndarray:
    balance = run.unscaled(causes)
    times = balance.times
    inside = (times > times[0] + _EDGE) & (times < times[-1] - _EDGE)
    return np.sqrt(np.mean(band_limited(balance.missed, times)[inside] ** 2, axis=0))
