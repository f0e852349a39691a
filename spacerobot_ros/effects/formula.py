"""Effects that a robot file writes as formulas: a torque at a joint, or what its sensor reads.

Each formula is a kind of effect of its own, as those of the catalogue are: the same object is
simulated, fed forward, fitted, and looked for at every joint.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from ..errors import ConfigurationError
from ..model.robot import Robot
from ..model.schema import parse_number
from ..types import Array
from .effect import Effect
from .expression import Expression
from .joint import STICTION_RATE, JointEffect, JointTorque
from .motion import Motion
from .parameter import Parameter

QUANTITIES = ('position', 'rate', 'effort', 'time')
"""What a formula knows of its joint: angle or length, its rate, the motor's torque, the time."""
_READING = 'reading'
_READINGS = {'joint_position': 'position', 'joint_velocity': 'rate', 'joint_effort': 'effort'}
"""Channels that a formula may change, with the quantity that they measure."""
_OWN = ('torque', 'channel', 'change', 'parameters', 'law', 'title')
_OF_PARAMETER = ('unit', 'size', 'relevant', 'minimum', 'maximum', 'guesses')
_TRIALS = 16  # random states at which a formula is tried
_TINY = 1e-9  # of its values there: rounding
_RATES = np.concatenate([[0.0], np.geomspace(1e-4, 10.0, 26)])  # rad/s
_STEP = 1e-6  # rad/s or rad, of its derivatives


class FormulaEffect(JointEffect):
    """tau = f(position, rate, effort, time), or reading = truth + f, f written in the robot file.

    Typical: what its author says of it.
    Signature: whatever the formula says.
    Source: docs/effects.md, section formula.
    """

    id = 'formula'
    group = 'own'
    title = 'an effect written as a formula'
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    is_fitted = False  # each formula is a kind of its own, which is

    expression: ClassVar[Expression]
    written: ClassVar[Mapping[str, Any]]
    channel: ClassVar[str] = ''

    @classmethod
    def read(cls, name: str, where: str | None, given: Mapping[str, Any], place: str) -> Effect:
        """From an entry of a robot file."""
        law = str(given.get('law', name))
        text, channel = _text(given, place)
        declared = given.get('parameters', {})
        if not isinstance(declared, Mapping):
            raise ConfigurationError(f'{place}.parameters', 'expected {name: {unit: ...}, ...}')
        parameters = tuple(
            _parameter(str(key), entry, f'{place}.parameters.{key}')
            for key, entry in declared.items()
        )
        title = str(given.get('title', f'{law} (a formula)'))
        _check(law, text, channel, parameters, place)
        kind = _made(law, text, channel, parameters, title)
        values = {key: value for key, value in given.items() if key not in _OWN}
        for parameter in parameters:
            values.setdefault(parameter.name, parameter.nominal)
        return kind._bound(name, where, values, place)

    @classmethod
    def _bound(cls, name: str, where: str | None, values: Mapping[str, Any], place: str) -> Effect:
        known = {p.name: p for p in cls.parameters}
        for key in values:
            if key not in known:
                has = ', '.join(known) or 'none'
                raise ConfigurationError(f'{place}.{key}', f'no such parameter (it has {has})')
        numbers = {key: parse_number(value, f'{place}.{key}') for key, value in values.items()}
        for key, number in numbers.items():
            known[key].check(number, f'{place}.{key}', known[key].unit)
        return cls(name=name, where=where, values=numbers)

    def entry(self) -> dict[str, Any]:
        """As in a robot file; `effect` says that it is a formula."""
        return {'effect': FormulaEffect.id, **self.written, **self.values}

    def check(self, robot: Robot) -> None:
        """Units that fit, and finite values wherever a joint may be."""
        slides = robot.bodies[1 + robot.joints.index(str(self.where))].is_prismatic
        units = _units(slides, self.channel)
        self.expression.check_unit(
            {**units, **{p.name: p.unit for p in self.parameters}},
            self._unit(units),
            f'effects.{self.name}',
        )
        at_rest = {name: np.zeros(1) for name in (*QUANTITIES, _READING)}
        for state in (at_rest, _states(np.random.default_rng(0))):
            self._finite(self.expression({**state, **self.values}), state)

    def _unit(self, units: Mapping[str, str]) -> str:
        return units['effort']

    def value(self, motion: Motion, reading: Array | None = None) -> Array:
        """(N,) of the formula at its joint along a motion."""
        column = motion.column(self.where)
        state = {
            'position': motion.q[:, column],
            'rate': motion.qd[:, column],
            'effort': motion.effort[:, column],
            'time': motion.time,
        }
        if reading is not None:
            state[_READING] = reading
        out = self.expression({**state, **self.values})
        if not np.isfinite(out).all():
            self._finite(out, state)
        return np.broadcast_to(out, motion.time.shape)

    def _finite(self, values: Array, state: Mapping[str, Array]) -> None:
        bad = np.flatnonzero(~np.isfinite(np.broadcast_to(values, state['time'].shape)))
        if len(bad):
            used = [name for name in state if name in self.expression.names]
            at = ', '.join(f'{name} {state[name][bad[0]]:g}' for name in used) or 'any state'
            why = f'{self.expression.text!r} is not finite at {at}: does it divide by zero?'
            raise self.refusal(why)


class FormulaTorque(FormulaEffect, JointTorque):
    """A formula that is a torque on its joint."""

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque at its joint."""
        return motion.joint_force(self.where, self.value(motion))

    def fastest(self, robot: Robot) -> float:
        """Rate at which it settles by what it makes of the rate, or swings by its stiffness."""
        state = {name: np.zeros_like(_RATES) for name in QUANTITIES}
        slopes = {}
        for name in ('rate', 'position'):
            ends = [
                self.expression({**state, 'rate': _RATES, name: x, **self.values})
                for x in (_at(name) - _STEP, _at(name) + _STEP)
            ]
            slopes[name] = float(np.max(np.abs(ends[1] - ends[0]))) / (2.0 * _STEP)
        mobility = self.mobility(robot)
        return max(slopes['rate'] * mobility, float(np.sqrt(slopes['position'] * mobility)))


class FormulaReading(FormulaEffect):
    """A formula that is added to what a sensor of its joint says."""

    group = 'sensor'

    def sense(
        self, channel: str, value: Array, motion: Motion, hidden: Array | None = None
    ) -> Array:
        """The joint's column of its channel changed."""
        if channel != self.channel:
            return value
        out, column = np.array(value), motion.column(self.where)
        out[:, column] += self.value(motion, out[:, column])
        return out

    def _unit(self, units: Mapping[str, str]) -> str:
        return units[_READINGS[self.channel]]


def _at(name: str) -> Array:
    return _RATES if name == 'rate' else np.linspace(-np.pi, np.pi, len(_RATES))


@dataclass(frozen=True)
class _Text:
    """The formula of an entry and its key."""

    key: str
    text: str


def _text(given: Mapping[str, Any], place: str) -> tuple[_Text, str]:
    """The formula, and the channel that it changes; empty for a torque."""
    if ('torque' in given) == ('change' in given):
        why = 'needs one formula: torque, or change with the channel that it changes'
        raise ConfigurationError(place, why)
    channel = str(given.get('channel', ''))
    if 'torque' in given and channel:
        raise ConfigurationError(f'{place}.channel', 'belongs to change, not to a torque')
    if 'change' in given and channel not in _READINGS:
        why = f'expected one of {", ".join(_READINGS)}, got {channel!r}'
        raise ConfigurationError(f'{place}.channel', why)
    key = 'torque' if 'torque' in given else 'change'
    return _Text(key, str(given[key])), channel


def _parameter(name: str, entry: Any, place: str) -> Parameter:
    if not isinstance(entry, Mapping) or 'unit' not in entry:
        raise ConfigurationError(place, "expected {unit: ..., size: ...} ('' for a pure number)")
    for key in entry:
        if key not in _OF_PARAMETER:
            why = f'there is no {key!r} (there are {", ".join(_OF_PARAMETER)})'
            raise ConfigurationError(place, why)
    if not name.isidentifier() or name in (*QUANTITIES, _READING, *_OWN):
        raise ConfigurationError(place, f'{name!r} can not be the name of a parameter')
    unit, guesses = str(entry['unit']), entry.get('guesses', ())
    numbers = {
        key: parse_number(entry[key], f'{place}.{key}')
        for key in ('size', 'relevant', 'minimum', 'maximum')
        if key in entry
    }
    if not guesses:
        return Parameter(name, unit, **numbers)
    tries = tuple(parse_number(guess, f'{place}.guesses') for guess in guesses)
    return Parameter(name, unit, nominal=tries[0], role='search', guesses=tries, **numbers)


def _check(
    law: str, text: _Text, channel: str, parameters: tuple[Parameter, ...], place: str
) -> None:
    """Check what can be without a robot."""
    if not law.isidentifier():
        raise ConfigurationError(f'{place}.law', f'{law!r} can not be the name of a formula')
    at = f'{place}.{text.key}'
    expression = Expression.parse(text.text, at)
    quantities = [*QUANTITIES, *([_READING] if channel else [])]
    expression.refuse_others([*quantities, *(p.name for p in parameters)], at)
    for parameter in parameters:
        if parameter.name not in expression.names:
            why = f'the formula has no {parameter.name!r}'
            raise ConfigurationError(f'{place}.parameters.{parameter.name}', why)
    _check_linear(expression, parameters, at)


@lru_cache(maxsize=256)  # one formula is one kind, however often it is read
def _made(
    law: str, text: _Text, channel: str, parameters: tuple[Parameter, ...], title: str
) -> type[FormulaEffect]:
    """The kind of effect that a checked formula is."""
    expression = Expression.parse(text.text, law)
    written = {text.key: expression.text, **({'channel': channel} if channel else {})}
    content = {
        'id': f'{FormulaEffect.id}_{law}',
        'title': title,
        'parameters': parameters,
        'is_fitted': bool(parameters),
        'is_own': True,
        'is_timed': 'time' in expression.names,
        'expression': expression,
        'channel': channel,
        'written': {**written, 'law': law, 'parameters': _declared(parameters)},
        '__doc__': f'{expression.text}, by the robot file.',
    }
    base = FormulaReading if channel else FormulaTorque
    return type(f'Formula_{law}', (base,), content)


def _declared(parameters: tuple[Parameter, ...]) -> dict[str, dict[str, Any]]:
    """Parameters as a robot file declares them."""
    out: dict[str, dict[str, Any]] = {}
    for p in parameters:
        numbers = {key: getattr(p, key) for key in ('size', 'relevant', 'minimum', 'maximum')}
        known = {key: float(v) for key, v in numbers.items() if np.isfinite(v) and v != 0.0}
        if p.minimum == 0.0:
            known['minimum'] = 0.0
        guesses = {'guesses': list(p.guesses)} if p.guesses else {}
        out[p.name] = {'unit': p.unit, **known, **guesses}
    return out


def _check_linear(expression: Expression, parameters: tuple[Parameter, ...], place: str) -> None:
    """Refuse a formula that is not in proportion to the parameters without guesses.

    It must add up over them, and vanish without them: f(a + 2 b) = f(a) + 2 f(b).
    """
    rng = np.random.default_rng(1)
    state = _states(rng)
    linear = [p for p in parameters if p.role == 'linear']
    held = {p.name: p.nominal for p in parameters if p.role != 'linear'}
    drawn = [{p.name: float(rng.uniform(0.5, 1.5)) for p in linear} for _ in range(2)]
    both = {p.name: drawn[0][p.name] + 2.0 * drawn[1][p.name] for p in linear}
    found = [expression({**state, **held, **values}) for values in (*drawn, both)]
    scale = float(np.nanmax(np.abs(found[2]), initial=0.0))
    gap = np.abs(found[2] - found[0] - 2.0 * found[1])
    if parameters and np.nanmax(gap, initial=0.0) > _TINY * scale:
        names = ', '.join(p.name for p in linear) or 'nothing'
        why = (
            f'{expression.text!r} is not in proportion to {names} together: give first guesses '
            '(guesses: [...]) of a parameter that it is not in proportion to'
        )
        raise ConfigurationError(place, why)


def _states(rng: np.random.Generator) -> dict[str, Array]:
    """Random states of a joint; rates both within and beyond stiction."""
    draw = {name: rng.uniform(-1.5, 1.5, _TRIALS) for name in ('position', 'effort', _READING)}
    rate = rng.uniform(-1.0, 1.0, _TRIALS) * np.where(rng.random(_TRIALS) < 0.3, STICTION_RATE, 1)
    return {**draw, 'rate': rate, 'time': rng.uniform(0.0, 10.0, _TRIALS)}


def _units(slides: bool, channel: str) -> dict[str, str]:
    """Of every quantity at a joint, and of what its channel reads."""
    turning = {'position': 'rad', 'rate': 'rad/s', 'effort': 'N m', 'time': 's'}
    sliding = {'position': 'm', 'rate': 'm/s', 'effort': 'N', 'time': 's'}
    units = sliding if slides else turning
    return {**units, **({_READING: units[_READINGS[channel]]} if channel else {})}
