"""Maps checked against dataclasses whose fields carry unit, bounds and meaning.

The meaning of a field is its entry under `Args:` in the docstring of its class; unit and bounds
are given where it gets its default (`param`).
"""

from __future__ import annotations

import difflib
import inspect
import math
import re
import types
import typing
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any

from ..errors import ConfigurationError

FloatList = tuple[float, ...]
TextList = tuple[str, ...]
FloatOrList = float | FloatList
TextOrList = str | TextList
FreeMaps = Mapping[str, Mapping[str, Any]]
"""Maps under free names, of numbers, texts, and lists and maps of these, whose meaning is checked
elsewhere."""
FloatMap = Mapping[str, float]
"""Numbers under free names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """What a number may be: at least `minimum`, above `above`, at most `maximum`."""

    minimum: float = -math.inf
    above: float = -math.inf
    maximum: float = math.inf

    @property
    def words(self) -> list[str]:
        """The bounds there are, such as 'above 0'."""
        named = {'at least': self.minimum, 'above': self.above, 'at most': self.maximum}
        return [f'{word} {bound:g}' for word, bound in named.items() if math.isfinite(bound)]

    def check(self, number: float, place: str, unit: str = '') -> None:
        """Refuse a number out of bounds.

        Raises:
            ConfigurationError: with its place.
        """
        for is_wrong, bound in (
            (number < self.minimum, f'at least {self.minimum:.9g}'),
            (number <= self.above, f'above {self.above:.9g}'),
            (number > self.maximum, f'at most {self.maximum:.9g}'),
        ):
            if is_wrong:
                value = f'{number:.9g} {unit}'.rstrip()
                raise ConfigurationError(place, f'{value} must be {bound}')


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowed(Bounds):
    """What a parameter may be; bounds of a list are those of its entries.

    Args:
        unit: SI unit; empty for pure numbers and texts.
        choices: Allowed texts; empty: any.
        length: Required number of entries of a list.
    """

    unit: str = ''
    choices: tuple[str, ...] = ()
    length: int | None = None

    def check_value(self, value: Any, place: str) -> None:
        """Refuse a number, text or list of the right type that is not allowed."""
        if self.length is not None and len(value) != self.length:
            raise ConfigurationError(place, f'expected {self.length} numbers, got {len(value)}')
        entries = {place: value}
        if isinstance(value, tuple):
            entries = {f'{place}[{i}]': entry for i, entry in enumerate(value)}
        for where, entry in entries.items():
            if self.choices and entry not in self.choices:
                names = ', '.join(self.choices)
                raise ConfigurationError(where, f'{entry!r} is not one of {names}')
            if not isinstance(entry, str | bool):
                self.check(entry, where, self.unit)


LARGEST = 1e50
"""Magnitude of a number of a robot, in any unit: sixth powers of it and its inverse exist."""

LONGEST = 1e9
"""Longest time [s] and highest rate [Hz]: whole nanoseconds of it fill a ninth of 64 bits."""

TIMES = {'minimum': 1e-6, 'maximum': LONGEST}
"""Limits of a time or rate that is not zero."""


def param(default: Any = MISSING, unit: str = '', **limits: Any) -> Any:
    """A field of a settings dataclass, see `Allowed`; without a default it must be given."""
    return field(default=default, metadata={'allowed': Allowed(unit=unit, **limits)})


def entry(parse: Callable[[Any, str], Any], default: Any = MISSING) -> Any:
    """A field that is read by a function of the value and its place; see `param`."""
    return field(default=default, metadata={'parse': parse})


def meanings(cls: type) -> dict[str, str]:
    """What every field means: its entry under `Args:`, in the class or in what it derives from."""
    found = {}
    for base in reversed(cls.__mro__):
        section = inspect.cleandoc(base.__doc__ or '').partition('\nArgs:\n')[2]
        for names, text in re.findall(r'^ {4}([\w, ]+): (.*(?:\n {8}.*)*)', section, re.MULTILINE):
            found.update(dict.fromkeys(names.split(', '), ' '.join(text.split())))
    return found


def plain_types(hint: Any) -> tuple[Any, ...]:
    """The types of a parameter, whether or not it may be None: one, or one and a list of it."""
    if isinstance(hint, types.UnionType):
        return tuple(a for a in typing.get_args(hint) if a is not type(None))
    return (hint,)


def parse_section(cls: type, values: Any, place: str) -> Any:
    """Build a settings dataclass of a map; `place` names it in error messages."""
    if not isinstance(values, Mapping):
        why = f'expected a map of parameters, got {values!r}'
        raise ConfigurationError(place.rstrip(': ') or 'parameters', why)
    known = {f.name: f for f in fields(cls)}
    for key in values:
        if key not in known:
            why = f'unknown parameter{_suggest(str(key), list(known))}'
            raise ConfigurationError(_join(place, str(key)), why)
    hints = typing.get_type_hints(cls)
    parsed = {}
    for name, f in known.items():
        where = _join(place, name)
        if name in values:
            parsed[name] = _parse_value(f, plain_types(hints[name]), values[name], where)
        elif f.default is MISSING and f.default_factory is MISSING:
            meaning = meanings(cls).get(name, f.type)
            raise ConfigurationError(where, f'required parameter is missing ({meaning})')
    return cls(**parsed)


def parse_number(value: Any, place: str, kind: type = float) -> Any:
    """A finite number, whole where `kind` is int; one that is next to nothing is zero.

    Raises:
        ConfigurationError: anything else.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ConfigurationError(place, f'expected a number, got {value!r}')
    if not abs(value) <= LARGEST:
        why = f'{value} is not a finite number of a magnitude up to {LARGEST:g}'
        raise ConfigurationError(place, why)
    if kind is int and value != int(value):
        raise ConfigurationError(place, f'expected a whole number, got {value}')
    return kind(value if abs(value) >= 1.0 / LARGEST else 0)


def _parse_value(f: Field[Any], kinds: tuple[Any, ...], value: Any, place: str) -> Any:
    if 'parse' in f.metadata:
        return f.metadata['parse'](value, place)
    kind = kinds[-1] if _is_list(value) else kinds[0]
    if hasattr(kind, '__dataclass_fields__'):
        return parse_section(kind, value, place)
    if kind == FreeMaps:
        return _free_maps(value, place)
    if kind == FloatMap:
        return {k: parse_number(v, f'{place}.{k}') for k, v in _named(value, place).items()}
    if kind in (FloatList, TextList):
        parse = _parser(typing.get_args(kind)[0])
        parsed = tuple(parse(v, f'{place}[{i}]') for i, v in enumerate(_list(value, place)))
    else:
        parsed = _parser(kind)(value, place)
    f.metadata['allowed'].check_value(parsed, place)
    return parsed


def parse_text(value: Any, place: str, kind: type = str) -> Any:
    """A text, or true or false where `kind` is bool.

    Raises:
        ConfigurationError: anything else.
    """
    if not isinstance(value, kind):
        word = {bool: 'true or false', str: 'text'}[kind]
        raise ConfigurationError(place, f'expected {word}, got {value!r}')
    return value


def _parser(kind: type) -> Callable[[Any, str], Any]:
    parse = parse_number if kind in (float, int) else parse_text
    return lambda value, place: parse(value, place, kind)


def _named(value: Any, place: str) -> dict[str, Any]:
    """A map, in the order of its names: parameters of a ROS 2 node keep no other."""
    if not isinstance(value, Mapping):
        raise ConfigurationError(place, f'expected a map of named entries, got {value!r}')
    for name in value:
        if not isinstance(name, str) or not name or '.' in name:
            raise ConfigurationError(place, f'{name!r} is no name: give text without a dot')
    return dict(sorted(value.items()))


def _free_maps(value: Any, place: str) -> dict[str, dict[str, Any]]:
    named = _named(value, place)
    for name, entry in named.items():
        if not isinstance(entry, Mapping):
            raise ConfigurationError(f'{place}.{name}', f'expected a map, got {entry!r}')
    return {name: _free(entry, f'{place}.{name}') for name, entry in named.items()}


def _free(value: Any, place: str) -> Any:
    """Texts, numbers, and lists and maps of them."""
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        return {str(key): _free(v, f'{place}.{key}') for key, v in value.items()}
    if _is_list(value):
        return tuple(_free(v, f'{place}[{i}]') for i, v in enumerate(value))
    return parse_number(value, place)


def _is_list(value: Any) -> bool:
    return hasattr(value, '__iter__') and not isinstance(value, str | bytes | Mapping)


def _list(value: Any, place: str) -> list[Any]:
    if not _is_list(value):
        raise ConfigurationError(place, f'expected a list, got {value!r}')
    return list(value)


def _join(place: str, key: str) -> str:
    return f'{place}.{key}' if place and not place.endswith(': ') else f'{place}{key}'


def _suggest(key: str, known: list[str]) -> str:
    close = difflib.get_close_matches(key, known, n=1)
    return f' (did you mean {close[0]!r}?)' if close else f' (known: {", ".join(sorted(known))})'
