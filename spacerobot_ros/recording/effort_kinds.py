"""What a mapping says of its efforts against what the robot file says (docs/data.md)."""

from __future__ import annotations

from collections.abc import Iterable

from ..errors import RecordingError
from ..model.robot import Robot
from .units import is_current


def check_kinds(place: str, robot: Robot | None, columns: Iterable[tuple[str, str, str]]) -> None:
    """Refuse efforts of another kind than the robot file says.

    Args:
        place: Where the mapping says it.
        robot: Its `effort_kinds` count; without one nothing is contradicted.
        columns: Joint, its kind ('' where the mapping says none) and the unit of each.

    Raises:
        RecordingError: another kind, or a current of a joint whose effort is none.
    """
    if robot is None:
        return
    believed = dict(zip(robot.arm, robot.effort_kinds, strict=True))
    for name, said, unit in columns:
        kind = believed.get(name, 'motor')
        if said not in ('', kind):
            raise RecordingError(
                f'{place}.kind',
                f'{name}: {said}, but robot.effort_kind of the robot file says {kind}',
            )
        if is_current(unit) and kind != 'current':
            raise RecordingError(
                f'{place}.unit',
                f'{name}: {unit!r} is a current, but robot.effort_kind of the robot file says '
                f'{kind}: state current there, and robot.motor_constant',
            )
