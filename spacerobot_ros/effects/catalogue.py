"""The catalogue: every effect by its id, and the `effects:` section of a robot file."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ..errors import ConfigurationError
from ..model.robot import Robot
from ..model.settings import Settings
from .believed_friction import friction_of_urdf
from .bodies import appendage, bodies, grasp, sprung
from .effect import Effect
from .joints import coupled_friction, flexibility, joint_friction, motors, presliding
from .laws import formula, learned_torque
from .own_kinds import add_installed, add_named
from .sensors import joint_sensors, sensor_errors
from .surroundings import environment, external, gravity, leaking_thruster, orbit, thrusters
from .wheels import gyrostats, rotors

_MODULES = (
    *(joint_friction, motors, presliding, coupled_friction, flexibility, learned_torque, formula),
    *(joint_sensors, sensor_errors, gyrostats, rotors),
    *(bodies, appendage, grasp, sprung, environment, leaking_thruster, gravity, orbit),
    *(thrusters, external),
)


def _kinds() -> Iterator[type[Effect]]:
    for module in _MODULES:
        for value in vars(module).values():
            if isinstance(value, type) and issubclass(value, Effect) and 'id' in vars(value):
                yield value


_KNOWN: dict[str, type[Effect]] = {kind.id: kind for kind in _kinds()}
_BUILT_IN = frozenset(_KNOWN)
CATALOGUE: Mapping[str, type[Effect]] = MappingProxyType(_KNOWN)
"""Every kind of effect by its id, in the order of the documentation; then those of installed
packages, once one of them is asked for, and of the modules that the robot file names that was
read last."""


def believed_effects(
    settings: Settings, robot: Robot, folder: Path | None = None
) -> tuple[Effect, ...]:
    """The effects of a robot file, with the kinds of its own modules and of installed packages.

    And friction of the URDF, where the robot file does not state that of the joint itself.

    Args:
        settings: Of the robot file.
        robot: The robot they act on.
        folder: Of the robot file, for modules with relative names; None where it is unknown.

    Raises:
        ConfigurationError: a module that can't be used, or anything wrong in `effects`.
    """
    if settings.robot.effect_modules or len(_KNOWN) > len(_BUILT_IN):
        lasting = _add_installed()
        for one in [one for one in _KNOWN if one not in lasting]:
            del _KNOWN[one]  # of another robot file: none of what may be wrong with this robot
        add_named(_KNOWN, settings.robot.effect_modules, folder)
    own = bind_effects(settings.effects, robot)
    return (*own, *friction_of_urdf(robot, own))


def kinds_beside(believed: Iterable[Effect]) -> list[type[Effect]]:
    """The catalogue, and formulas that a robot file has: what may be a cause."""
    _add_installed()
    own = {type(effect).id: type(effect) for effect in believed}
    return list({**CATALOGUE, **own}.values())


@cache
def _add_installed() -> frozenset[str]:
    """Ids of the kinds that every robot has; to look what is installed takes some 50 ms."""
    add_installed(_KNOWN)
    return frozenset(_KNOWN)


def bind_effect(
    name: str,
    effect_id: str,
    where: str | None,
    values: Mapping[str, Any],
    robot: Robot,
    changed: Robot | None = None,
) -> Effect:
    """An effect at a place, checked against the robot.

    Args:
        name: Its free name, for messages.
        effect_id: Id in the catalogue.
        where: Joint, link, or None.
        values: Its parameters; those with a default may be left out.
        robot: The robot it acts on.
        changed: The same with the bodies that other effects leave, where there are any.

    Raises:
        ConfigurationError: unknown id, place or parameter, or values that make no sense.
    """
    place = f'effects.{name}'
    kind, where = kind_at(effect_id, where, robot, place)
    effect = kind.read(name, where, values, place)
    effect.check(robot if changed is None else changed)
    return effect


def kind_at(
    effect_id: str, where: str | None, robot: Robot, place: str
) -> tuple[type[Effect], str | None]:
    """A kind of effect and where this robot has it.

    Args:
        effect_id: Id in the catalogue.
        where: Joint, link, or None.
        robot: The robot it acts on.
        place: What asks for it, for messages.

    Raises:
        ConfigurationError: unknown id or place.
    """
    if effect_id not in CATALOGUE:
        _add_installed()
    if effect_id not in CATALOGUE:
        near = get_close_matches(effect_id, CATALOGUE, n=3)
        hint = f' (did you mean {", ".join(near)}?)' if near else ''
        raise ConfigurationError(f'{place}.effect', f'no effect {effect_id!r}{hint}')
    kind = CATALOGUE[effect_id]
    if kind.needs_free_base and not robot.is_free:
        raise ConfigurationError(place, f'{effect_id} shows nothing on a fixed base: leave it out')
    places = kind.places(robot)
    if places == (None,) and where == robot.base_link:
        where = None  # what sits on the base may say so
    if where not in places:
        raise ConfigurationError(f'{place}.where', _wrong_place(kind, where, places))
    return kind, where


def bind_effects(section: Mapping[str, Any], robot: Robot) -> tuple[Effect, ...]:
    """The `effects:` map of a robot file.

    Args:
        section: Free name to {effect, where, parameters...}.
        robot: The robot it acts on.

    Raises:
        ConfigurationError: anything wrong in it, with its place.
    """
    effects: list[Effect] = []
    changed = robot  # bodies that are named twice are changed one after another
    for name, entry in section.items():
        if not isinstance(entry, Mapping) or 'effect' not in entry:
            why = 'expected {effect: ..., where: ..., parameters...}'
            raise ConfigurationError(f'effects.{name}', why)
        values = {key: value for key, value in entry.items() if key not in ('effect', 'where')}
        kind, where = str(entry['effect']), entry.get('where')
        effects.append(bind_effect(str(name), kind, where, values, robot, changed))
        if effects[-1].group == 'bodies':
            changed = effects[-1].change(changed)
    for first, second in itertools.combinations(effects, 2):
        _check_contradiction(first, second)
    return tuple(effects)


def changed_robot(robot: Robot, effects: Iterable[Effect]) -> Robot:
    """The robot as all effects make it, in their order."""
    for effect in effects:
        robot = effect.change(robot)
    return robot


def _check_contradiction(first: Effect, second: Effect) -> None:
    excluded = first.id in second.excludes or second.id in first.excludes
    if excluded and first.where == second.where:
        at = '' if second.where is None else f' at {second.where}'
        why = f'{second.id}{at} contradicts {first.id} of effects.{first.name}: give one of them'
        raise second.refusal(why)


def _wrong_place(kind: type[Effect], where: str | None, places: tuple[str | None, ...]) -> str:
    if places == (None,):
        return f'{kind.id} acts on the system as a whole: leave `where` out, got {where!r}'
    if not places:
        return f'{kind.id} has no place on this robot'
    if where is None:
        return f'is missing: {kind.id} acts at one of {", ".join(map(str, places))}'
    return f'{kind.id} has no place {where!r} (it has {", ".join(map(str, places))})'
