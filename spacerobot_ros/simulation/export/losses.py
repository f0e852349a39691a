"""What a file format can not say of a model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from ...effects.effect import Effect
from ...model.robot import Robot


@dataclass(frozen=True, slots=True)
class Exported:
    """A model in another format.

    Args:
        text: The file.
        said: What of the model is in it beyond geometry and inertia, a line each.
        lost: What is not, a line each.
    """

    text: str
    said: tuple[str, ...]
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
    return not any(effect.acts(action) for action in ('force', 'sense', 'delay', 'momentum'))


def without(effects: Iterable[Effect], said: Iterable[Effect]) -> Iterator[str]:
    """Effects that are not in a file, in words."""
    names = {effect.name for effect in said}
    return (in_words(effect) for effect in effects if effect.name not in names)


def wheels(robot: Robot) -> Iterator[str]:
    """Wheel momentum that a format without wheels can not say."""
    for gyrostat in robot.gyrostats:
        if gyrostat.momentum.any():
            x, y, z = gyrostat.momentum
            yield f'wheel momentum of {gyrostat.link} ({x:.6g}, {y:.6g}, {z:.6g} N m s)'
