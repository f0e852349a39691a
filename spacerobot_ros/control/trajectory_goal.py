"""A trajectory with tolerances, as an action asks for it: going on, reached or failed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..errors import MessageRejectedError
from ..types import Array
from .command import Command

SUCCESSFUL, INVALID_GOAL, INVALID_JOINTS = 0, -1, -2
PATH_TOLERANCE_VIOLATED, GOAL_TOLERANCE_VIOLATED = -4, -5


class GoalEnd(NamedTuple):
    """How a goal ended: a code of control_msgs/FollowJointTrajectory, and in words."""

    code: int
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Tolerances:
    """Largest errors of each joint: position (n,) [rad] and rate (n,) [rad/s]; may be infinite."""

    position: Array
    rate: Array

    @classmethod
    def of(cls, given: Any, names: list[str]) -> Tolerances:
        """From control_msgs/JointTolerance messages; what is not above zero is no limit.

        Raises:
            MessageRejectedError: a joint that is unknown.
        """
        asked: Mapping[str, Any] = {t.name: t for t in given}
        if unknown := sorted(set(asked) - set(names)):
            raise MessageRejectedError(f'tolerance of unknown joints: {", ".join(unknown)}')

        def column(kind: str) -> Array:
            values = [getattr(asked[name], kind) if name in asked else 0.0 for name in names]
            return np.array([value if value > 0.0 else np.inf for value in values])

        return cls(column('position'), column('velocity'))

    def broken(self, command: Command, names: list[str]) -> str:
        """Which joint is how far beyond; empty where none is."""
        for what, unit, error, limit in (
            ('position', 'rad', command.error, self.position),
            ('rate', 'rad/s', command.error_rate, self.rate),
        ):
            for name, value, most in zip(names, np.abs(error), limit, strict=True):
                if value > most:
                    return f'{name}: {what} off by {value:.4g} {unit}, at most {most:.4g}'
        return ''


class TrajectoryGoal:
    """Judges commands on the way to the end of a trajectory and after it.

    Args:
        names: Of the n joints.
        path: Tolerances on the way.
        goal: Tolerances at the end.
        patience: Time after the end by which those must hold [s]; zero: any.
    """

    def __init__(
        self, names: list[str], path: Tolerances, goal: Tolerances, patience: float
    ) -> None:
        self._names, self._path, self._goal, self._patience = names, path, goal, patience

    def judge(self, command: Command, time_left: float) -> GoalEnd | None:
        """How the goal ended at a command; None while it goes on.

        Args:
            command: The newest.
            time_left: Time to the end of the trajectory [s]; negative after it.
        """
        if time_left > 0.0:
            broken = self._path.broken(command, self._names)
            return GoalEnd(PATH_TOLERANCE_VIOLATED, broken) if broken else None
        broken = self._goal.broken(command, self._names)
        if not broken:
            return GoalEnd(SUCCESSFUL, '')
        is_late = self._patience > 0.0 and -time_left > self._patience
        return GoalEnd(GOAL_TOLERANCE_VIOLATED, broken) if is_late else None
