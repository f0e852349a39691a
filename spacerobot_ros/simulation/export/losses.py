"""What a file format can not say of a model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace

import numpy as np

from ...effects.effect import Effect
from ...model.robot import Robot
from ...model.robot_settings import SensorSettings

_ROUNDING = 1e-9  # of the largest principal moment
_BESIDE = ('force', 'sense', 'delay', 'joint_delays', 'momentum')
"""What an effect may do beside changing the robot."""


@dataclass(frozen=True, slots=True)
class Exported:
    """A model in another format.

    Args:
        text: The file.
        included: What of the model is in it beyond geometry and inertia, a line each.
        lost: What is not, a line each.
    """

    text: str
    included: tuple[str, ...]
    lost: tuple[str, ...]


def in_words(effect: Effect) -> str:
    """An effect with place and values."""
    at = '' if effect.where is None else f'@{effect.where}'
    units = {p.name: p.unit for p in effect.parameters}
    values = ', '.join(
        f'{name} {value:.6g} {units.get(name, "")}'.strip()
        for name, value in effect.values.items()
    )
    return f'{effect.id}{at} ({values})'


def only_changes_robot(effect: Effect) -> bool:
    """Whether a changed robot is all that an effect is."""
    return not any(effect.acts(action) for action in _BESIDE)


def without(effects: Iterable[Effect], included: Iterable[Effect]) -> Iterator[str]:
    """Effects that are not in a file, in words."""
    names = {effect.name for effect in included}
    return (in_words(effect) for effect in effects if effect.name not in names)


def with_rigid_bodies(robot: Robot) -> tuple[Robot, list[str]]:
    """The robot with inertias that rigid bodies can have, and what had to be changed for that.

    A motion that does not tell all parameters of a body leaves some that no format takes: the
    smallest principal moment is raised until the largest is not above the sum of the others.
    """
    changed = []
    for k, body in enumerate(robot.bodies):
        moments, axes = np.linalg.eigh(body.inertia)
        lacking = float(moments[2] - moments[0] - moments[1])
        if lacking > 0.0:
            raised = body.inertia + lacking * np.outer(axes[:, 0], axes[:, 0])
            robot = robot.with_body(k, replace(body, inertia=raised))
        if lacking > _ROUNDING * moments[2]:
            changed.append(
                f'inertia of {body.name} as it is: no rigid body has it, its smallest moment is '
                f'raised by {lacking:.6g} kg m^2'
            )
    return robot, changed


def sensor_limits(robot: Robot, beside: str = '') -> Iterator[str]:
    """What the robot file says of the sensors.

    Args:
        robot: The robot.
        beside: End of the names of what a file has of it; empty: it has nothing.
    """
    plain = asdict(SensorSettings())
    for name, value in asdict(robot.sensors).items():
        if value != plain[name] and not (beside and name.endswith(beside)):
            yield f'sensors.{name} ({value})'
