"""The catalogue: every effect by its id, and the `effects:` section of a robot file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any

from ..errors import ConfigurationError
from ..model.robot import Robot
from . import (
    bodies,
    clocks,
    drive,
    environment,
    flexibility,
    friction,
    orbit,
    rotors,
    sensors,
    slosh,
    sprung,
    wheels,
)
from .effect import AppliedEffect, Effect, checked_values

_MODULES = (
    *(friction, drive, flexibility),
    *(sensors, clocks),
    *(wheels, rotors),
    *(bodies, sprung, slosh),
    *(environment, orbit),
)
CATALOGUE: Mapping[str, Effect] = MappingProxyType(
    {effect.id: effect for module in _MODULES for effect in module.EFFECTS}
)
"""Every effect by its id, in the order of the documentation."""


def apply_effect(
    name: str,
    effect_id: str,
    where: str | None,
    values: Mapping[str, float],
    robot: Robot,
) -> AppliedEffect:
    """An effect at a place, checked against the robot.

    Args:
        name: Its free name, for messages.
        effect_id: Id in the catalogue.
        where: Joint, link, or None.
        values: Its parameters; those with a default may be left out.
        robot: The robot it acts on.

    Raises:
        ConfigurationError: unknown id, place or parameter, or values that make no sense.
    """
    place = f'effects.{name}'
    if effect_id not in CATALOGUE:
        near = get_close_matches(effect_id, CATALOGUE, n=3)
        hint = f' (did you mean {", ".join(near)}?)' if near else ''
        raise ConfigurationError(f'{place}.effect', f'no effect {effect_id!r}{hint}')
    effect = CATALOGUE[effect_id]
    if effect.needs_free_base and not robot.is_free:
        raise ConfigurationError(place, f'{effect_id} shows nothing on a fixed base: leave it out')
    places = effect.places(robot)
    if places == (None,) and where == robot.base_link:
        where = None  # what sits on the base may say so
    if where not in places:
        raise ConfigurationError(f'{place}.where', _wrong_place(effect, where, places))
    complete = checked_values(effect, values, place)
    effect.check(robot, where, complete, place)
    return AppliedEffect(name=name, effect=effect, where=where, values=complete)


def parse_effects(section: Mapping[str, Any], robot: Robot) -> tuple[AppliedEffect, ...]:
    """The `effects:` map of a robot file.

    Args:
        section: Free name to {effect, where, parameters...}.
        robot: The robot it acts on.

    Raises:
        ConfigurationError: anything wrong in it, with its place.
    """
    applied = []
    for name, entry in section.items():
        if not isinstance(entry, Mapping) or 'effect' not in entry:
            raise ConfigurationError(
                f'effects.{name}', 'expected {effect: ..., where: ..., parameters...}'
            )
        values = {key: value for key, value in entry.items() if key not in ('effect', 'where')}
        applied.append(
            apply_effect(str(name), str(entry['effect']), entry.get('where'), values, robot)
        )
    _check_contradictions(applied)
    return tuple(applied)


def changed_robot(robot: Robot, effects: Iterable[AppliedEffect]) -> Robot:
    """The robot as all effects make it, in their order."""
    for effect in effects:
        robot = effect.change(robot)
    return robot


def _check_contradictions(effects: list[AppliedEffect]) -> None:
    for i, second in enumerate(effects):
        for first in effects[:i]:
            ids = (first.effect.id, second.effect.id)
            excluded = ids[0] in second.effect.excludes or ids[1] in first.effect.excludes
            if excluded and first.where == second.where:
                at = '' if second.where is None else f' at {second.where}'
                raise ConfigurationError(
                    f'effects.{second.name}',
                    f'{ids[1]}{at} contradicts {ids[0]} of effects.{first.name}: give one of them',
                )


def _wrong_place(effect: Effect, where: str | None, places: tuple[str | None, ...]) -> str:
    if places == (None,):
        return f'{effect.id} acts on the system as a whole: leave `where` out, got {where!r}'
    if not places:
        return f'{effect.id} has no place on this robot'
    if where is None:
        return f'is missing: {effect.id} acts at one of {", ".join(map(str, places))}'
    return f'{effect.id} has no place {where!r} (it has {", ".join(map(str, places))})'
