"""A formula of a robot file: its text, its parameters, the quantities it takes, their units."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np

from ...errors import ConfigurationError
from ...model.robot import Robot
from ...model.schema import FloatList, param, parse_section
from ...types import Array
from ..parameter import Parameter
from .expression import Expression
from .quantities import (
    AXES,
    CHANNELS,
    MEASURED,
    OF_BASE,
    OF_JOINTS,
    READING,
    anywhere,
    at_rest,
    is_axis,
    is_known,
    known_quantities,
    listed,
    parts,
    unit_of,
)

KEYS = ('torque', 'force', 'change')
"""What a formula is: a torque, a force, what a sensor says too much."""
_OWN = (*KEYS, 'channel', 'parameters', 'extra', 'law', 'title')
_TINY = 1e-9  # of its values there: rounding


@dataclass(frozen=True)
class Formula:
    """A formula that was read.

    Args:
        law: Its name.
        title: What it is, in words.
        key: One of `KEYS`.
        text: As it was written.
        channel: What it changes; empty for a force.
        declared: Its parameters, by name.
        extra: What else it takes, by name.
        is_at_joint: Whether it acts at a joint, not at an axis of the base.
    """

    law: str
    title: str
    key: str
    text: str
    channel: str
    declared: tuple[tuple[str, DeclaredParameter], ...]
    extra: tuple[tuple[str, DeclaredExtra], ...]
    is_at_joint: bool

    @classmethod
    def read(
        cls,
        name: str,
        where: str | None,
        given: Mapping[str, Any],
        place: str,
        *,
        is_known_motion: bool = False,
    ) -> Formula:
        """From an entry of a robot file, checked as far as no robot is needed.

        Args:
            name: Of the formula.
            where: Its place.
            given: The entry.
            place: Where that stands in the file.
            is_known_motion: Whether it is asked along a known motion alone, see `quantities`.

        Raises:
            ConfigurationError: with the place in the entry.
        """
        law = str(given.get('law', name))
        if not law.isidentifier():
            raise ConfigurationError(f'{place}.law', f'{law!r} can not be the name of a formula')
        formula = cls(
            law,
            str(given.get('title', f'{law} (a formula)')),
            *_text(given, place),
            _channel(given, place),
            sections(DeclaredParameter, given, 'parameters', place),
            sections(DeclaredExtra, given, 'extra', place),
            not is_axis(where),
        )
        formula._check(place, is_known_motion)
        return formula

    @staticmethod
    def values(given: Mapping[str, Any]) -> dict[str, Any]:
        """Of its parameters in an entry: what is nothing else there."""
        return {key: value for key, value in given.items() if key not in _OWN}

    def entry(self) -> dict[str, Any]:
        """As in a robot file, without values."""
        channel = {'channel': self.channel} if self.channel else {}
        extra = {'extra': entries(self.extra)} if self.extra else {}
        parameters = {'parameters': entries(self.declared)}
        return {self.key: self.text, **channel, 'law': self.law, **parameters, **extra}

    @cached_property
    def expression(self) -> Expression:
        """What computes it."""
        return Expression.parse(self.text, self.law)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """What the fit may change."""
        return tuple(d.named(name) for name, d in self.declared if d.fixed is None)

    @cached_property
    def _constants(self) -> dict[str, float]:
        return {name: d.fixed for name, d in self.declared if d.fixed is not None}

    def __call__(self, state: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """(N,) what it is.

        Args:
            state: (N,) each of its quantities.
            values: Of its parameters.
        """
        return self.expression({**self._constants, **state, **values})

    @cached_property
    def quantities(self) -> tuple[str, ...]:
        """Names in it that are no parameters, such as `rate` or `rate[joint_2]`."""
        return tuple(sorted(self.expression.names - {name for name, _ in self.declared}))

    @cached_property
    def sources(self) -> tuple[tuple[str, str, str], ...]:
        """Of every quantity its name, what it is, and whose."""
        return tuple((name, *parts(name)) for name in self.quantities)

    @property
    def kinds(self) -> set[str]:
        """What its quantities are, such as `rate`."""
        return {what for _, what, _ in self.sources}

    def check_robot(self, robot: Robot, where: str | None, place: str) -> None:
        """Refuse quantities that this robot does not have, and units that do not fit."""
        for name, what, whose in self.sources:
            if what in OF_JOINTS and whose and whose not in robot.joints:
                why = f'{name}: no such joint (there are {", ".join(robot.joints)})'
                raise ConfigurationError(place, why)
            if what in OF_BASE and not robot.is_free:
                raise ConfigurationError(place, f'{name}: the base is fixed')
        whole = self._unit(robot, where)
        units = {name: declared.unit for name, declared in self.declared}
        units |= {f'extra[{name}]': declared.unit for name, declared in self.extra}
        units[READING] = whole
        for name in set(self.quantities) - set(units):
            units[name] = unit_of(name, robot, where)
        self.expression.check_unit(units, whole, place)

    def states(self, is_random: bool = True) -> dict[str, Array]:
        """Values of its quantities to try it at: at rest, or random ones."""
        rng = np.random.default_rng(0)
        states = {n: anywhere(n, rng) if is_random else at_rest(n) for n in self.quantities}
        for name, declared in self.extra:
            if (key := f'extra[{name}]') in states:
                states[key] += declared.typical or 0.0
        return states

    def _unit(self, robot: Robot, where: str | None) -> str:
        """Unit of the formula."""
        if self.channel in MEASURED or self.is_at_joint:
            return robot.unit_of(OF_JOINTS[MEASURED.get(self.channel, 'effort')], str(where))
        axis = {'torque': 'N m', 'force': 'N', 'gyro': 'rad/s', 'attitude': 'rad'}
        return axis[self.channel or self.key]

    def _check(self, place: str, is_known_motion: bool) -> None:
        at = f'{place}.{self.key}'
        Expression.parse(self.text, at)
        if self.is_at_joint and (self.key == 'force' or self.channel in ('gyro', 'attitude')):
            why = f'acts on the base: where is one of its axes, such as base_link/{AXES[0]}'
            raise ConfigurationError(at, why)
        if self.channel in MEASURED and not self.is_at_joint:
            raise ConfigurationError(f'{place}.channel', 'is of a joint, not of an axis')
        extra = [name for name, _ in self.extra]
        known = known_quantities(self.channel, self.is_at_joint, extra, is_known_motion)
        own = dict(self.declared)
        for name in sorted(self.expression.names - set(own)):
            if not is_known(name, known):
                there = ', '.join([*listed(known), *own])
                why = f'nothing is called {name!r} here (there are {there})'
                raise ConfigurationError(at, why)
        for name, declared in self.declared:
            _check_name(name, declared, self.expression.names, f'{place}.parameters.{name}')
        self._check_linear(at)

    def _check_linear(self, place: str) -> None:
        """Refuse a formula that is not in proportion to the parameters without guesses.

        It must add up over them, and vanish without them: f(a + 2 b) = f(a) + 2 f(b).
        """
        rng, state = np.random.default_rng(1), self.states()
        linear = [p.name for p in self.parameters if p.role == 'linear']
        held = {p.name: p.nominal for p in self.parameters if p.role != 'linear'}
        drawn = [{name: float(rng.uniform(0.5, 1.5)) for name in linear} for _ in range(2)]
        both = {name: drawn[0][name] + 2.0 * drawn[1][name] for name in linear}
        tried = [self(state, {**held, **values}) for values in (*drawn, both)]
        found = np.stack(np.broadcast_arrays(*tried)).reshape(len(tried), -1)
        first, second, whole = found[:, np.isfinite(found).all(axis=0)]
        scale = float(np.max(np.abs(whole), initial=0.0))
        gap = np.abs(whole - first - 2.0 * second)
        if self.parameters and np.max(gap, initial=0.0) > _TINY * scale:
            why = (
                f'{self.text!r} is not in proportion to {", ".join(linear) or "nothing"} together:'
                ' give first guesses (guesses: [...]) of a parameter that it is not in proportion '
                'to'
            )
            raise ConfigurationError(place, why)


def _text(given: Mapping[str, Any], place: str) -> tuple[str, str]:
    """What it is, and the formula."""
    keys = [key for key in KEYS if key in given]
    if len(keys) != 1:
        why = 'needs one formula: torque, force, or change with the channel that it changes'
        raise ConfigurationError(place, why)
    return keys[0], Expression.parse(given[keys[0]], f'{place}.{keys[0]}').text


def _channel(given: Mapping[str, Any], place: str) -> str:
    channel = str(given.get('channel', ''))
    if 'change' not in given and channel:
        raise ConfigurationError(f'{place}.channel', 'belongs to change, not to a force')
    if 'change' in given and channel not in CHANNELS:
        why = f'expected one of {", ".join(CHANNELS)}, got {channel!r}'
        raise ConfigurationError(f'{place}.channel', why)
    return channel


def _check_name(name: str, declared: DeclaredParameter, used: frozenset[str], at: str) -> None:
    taken = (*OF_JOINTS, *OF_BASE, READING, 'time', *_OWN)
    if not name.isidentifier() or name in taken:
        raise ConfigurationError(at, f'{name!r} can not be the name of a parameter')
    if name not in used:
        raise ConfigurationError(at, f'the formula has no {name!r}')
    if not declared.minimum < declared.maximum:
        why = f'is not below the maximum of {declared.maximum:g}'
        raise ConfigurationError(f'{at}.minimum', f'{declared.minimum:g} {why}')


Kind = TypeVar('Kind')


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredParameter:
    """A parameter of a formula.

    Args:
        unit: SI unit; empty for a pure number.
        size: Plausible magnitude: the standard deviation of the fit's prior.
        relevant: Smallest magnitude worth naming.
        minimum: Smallest value.
        maximum: Largest value.
        guesses: First guesses of one that the formula is not in proportion to.
        fixed: Its value where it is known and no parameter at all, but has a unit.
    """

    unit: str = param()
    size: float = param(math.inf, above=0.0)
    relevant: float = param(0.0, minimum=0.0)
    minimum: float = param(-math.inf)
    maximum: float = param(math.inf)
    guesses: FloatList = param(())
    fixed: float | None = param(None)

    def named(self, name: str) -> Parameter:
        """The parameter."""
        keys = (f.name for f in fields(self) if f.name != 'fixed')
        given: dict[str, Any] = {key: getattr(self, key) for key in keys}
        if self.guesses:
            given |= {'nominal': self.guesses[0], 'role': 'search'}
        return Parameter(name, **given)


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredExtra:
    """Something that a mapping's `extra` names.

    Args:
        unit: As there.
        typical: Value where nobody measures it, as in a simulation.
    """

    unit: str = param('')
    typical: float | None = param(None)


def sections(
    kind: type[Kind], given: Mapping[str, Any], key: str, place: str
) -> tuple[tuple[str, Kind], ...]:
    """Sections of a map under free names."""
    found, at = given.get(key, {}), f'{place}.{key}'
    if not isinstance(found, Mapping):
        raise ConfigurationError(at, 'expected {name: {unit: ...}, ...}')
    read = partial(parse_section, kind)
    return tuple((str(name), read(entry, f'{at}.{name}')) for name, entry in found.items())


def entries(sections: tuple[tuple[str, Any], ...]) -> dict[str, dict[str, Any]]:
    """Sections as a robot file has them, without defaults."""
    return {name: dict(_stated(section)) for name, section in sections}


def _stated(section: Any) -> Iterator[tuple[str, Any]]:
    for f in fields(section):
        value = getattr(section, f.name)
        if value != f.default:
            yield f.name, list(value) if isinstance(value, tuple) else value
