"""What an extended model is worth on another record: torques that it misses, before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..effects.believed_friction import extended
from ..effects.effect import Effect
from ..effects.joints.motors import MotorConstant
from ..errors import RecordingError
from ..estimation.balance.arm_motion import BAND as BAND
from ..estimation.balance.balance import balance_of, rms
from ..estimation.balance.motor_constants import as_recorded
from ..estimation.trajectory.observations import observed
from ..formats import either
from ..json_values import json_as
from ..model.robot import Robot
from ..recording.faults.data_faults import check_data
from ..recording.record import Record
from .answer.free_motion import free_motion
from .answer.result import FreeMotion


@dataclass(frozen=True, slots=True, kw_only=True)
class JointScore:
    """Torque that a model misses at one joint, root mean square below `BAND`.

    Args:
        joint: Its name.
        unit: Of the torque, or of the force where it slides.
        before: Of the model as it stands.
        after: Of the extended model.
        free: How far the joint is predicted, where it has no motor.
    """

    joint: str = json_as()
    unit: str
    before: float = json_as('rms_before')
    after: float = json_as('rms_after')
    free: FreeMotion | None = json_as(default=None)


def check_scored(record: Record, robot: Robot) -> None:
    """Refuse a record that no model can be held against, before one is looked for.

    Raises:
        RecordingError: faulty data, or no efforts in it.
    """
    check_data(record, robot)
    if record.joints is None or record.joints.effort is None:
        raise RecordingError(record.source or 'score', 'has no efforts to hold a model against')


def score_on(
    record: Record,
    robot: Robot,
    causes: Sequence[Effect],
    believed: Sequence[Effect] = (),
) -> tuple[JointScore, ...]:
    """Hold a model with causes from one record against another; nothing is fitted.

    Args:
        record: The other record, one that `check_scored` takes.
        robot: The robot file's robot.
        causes: What was found.
        believed: The robot file's own effects.
    """
    measured = observed(record, robot)
    robot = as_recorded(robot, [measured])
    constants = [cause for cause in causes if isinstance(cause, MotorConstant)]
    models = [
        [balance_of(measured, robot, extended(believed, chosen))] for chosen in (constants, causes)
    ]
    free = {one.joint: one for one in free_motion(*models)}
    return tuple(
        JointScore(
            joint=joint,
            unit=robot.unit_of('N m', joint),
            before=float(b),
            after=float(a),
            free=free.get(joint),
        )
        for joint, b, a in zip(robot.joints, *map(rms, models), strict=True)
    )


def total(scores: Sequence[JointScore]) -> tuple[float, float, str]:
    """Root mean square over the joints, before and after, and its unit."""
    before = float(np.sqrt(np.nanmean([s.before**2 for s in scores])))
    after = float(np.sqrt(np.nanmean([s.after**2 for s in scores])))
    return before, after, either(s.unit for s in scores)


def to_dict(scores: Sequence[JointScore]) -> dict[str, Any]:
    """As in diagnosis.json."""
    before, after, unit = total(scores)
    return {
        'unit': unit,
        'band_hz': BAND,
        'rms_before': before,
        'rms_after': after,
        'joints': {s.joint: s for s in scores},
        'free_motion': [s.free for s in scores if s.free],
    }
