"""Maps checked against dataclasses whose fields carry unit, bounds and meaning.

The meaning of a field is its entry under `Args:` in the docstring of its class; unit and bounds
are given where it gets its default (`param`).
"""

from __future__ import annotations

import inspect
import math
import re
import types
import typing
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from functools import partial
from operator import gt, le, lt
from typing import Any, NamedTuple

from ..errors import ConfigurationError, did_you_mean

FloatList = tuple[float, ...]
TextList = tuple[str, ...]
FloatOrList = float | FloatList
TextOrList = str | TextList
FreeMaps = Mapping[str, Mapping[str, Any]]
"""Maps under free names, of numbers, texts, and lists and maps of these, whose meaning is checked
elsewhere."""
FloatMap = Mapping[str, float]
"""Numbers under free names; the name `rest` is for all that have none, and alone it is zero."""
REST = 'rest'


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """What a number may be: at least `minimum`, above `above`, at most `maximum`."""

    minimum: float = -math.inf
    above: float = -math.inf
    maximum: float = math.inf

    @property
    def words(self) -> list[str]:
        """The bounds there are, such as 'above 0'."""
        bounds = {word: getattr(self, name) for word, name, _ in _LIMITS}
        return [f'{word} {bound:g}' for word, bound in bounds.items() if math.isfinite(bound)]

    def check(self, number: float, place: str, unit: str = '') -> None:
        """Refuse a number out of bounds.

        Raises:
            ConfigurationError: with its place.
        """
        for word, name, breaks in _LIMITS:
            if breaks(number, bound := getattr(self, name)):
                value = f'{number:.9g} {unit}'.rstrip()
                raise ConfigurationError(place, f'{value} must be {word} {bound:.9g}')


_LIMITS = (('at least', 'minimum', lt), ('above', 'above', le), ('at most', 'maximum', gt))


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

    @property
    def limits(self) -> list[str]:
        """All that it must be, in words."""
        choices = [f'one of {", ".join(self.choices)}'] if self.choices else []
        length = [] if self.length is None else [f'{self.length} numbers']
        return [*choices, *length, *self.words]

    def check_value(self, value: Any, place: str) -> None:
        """Refuse a number, text or list of the right type that is not allowed."""
        if self.length is not None and len(value) != self.length:
            raise ConfigurationError(place, f'expected {self.length} numbers, got {len(value)}')
        is_list = isinstance(value, tuple)
        for i, entry in enumerate(value if is_list else [value]):
            where = f'{place}[{i}]' if is_list else place
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


Parser = Callable[[Any, str], Any]
"""Of a value and its place."""


def entry(parse: Parser, default: Any = MISSING) -> Any:
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
    kinds = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    return tuple(kind for kind in kinds if kind is not type(None))


class Leaf(NamedTuple):
    """A parameter: dotted name, meaning, what it may be, type and value."""

    name: str
    meaning: str
    allowed: Allowed
    kind: Any
    value: Any


def leaves(section: Any, prefix: str = '') -> Iterator[Leaf]:
    """Every parameter below a section, those under free names included."""
    hints, meaning = typing.get_type_hints(type(section)), meanings(type(section))
    for f in fields(section):
        name, value = prefix + f.name, getattr(section, f.name)
        if is_dataclass(value):
            yield from leaves(value, f'{name}.')
        elif isinstance(value, Mapping):
            for path, entry in _flat(name, value):
                yield Leaf(path, meaning[f.name], Allowed(), type(entry), entry)
        else:
            kind, *_ = plain_types(hints[f.name])
            yield Leaf(name, meaning[f.name], f.metadata['allowed'], kind, value)


def _flat(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Values of a nested map under dotted names."""
    if isinstance(value, Mapping):
        for key, entry in value.items():
            yield from _flat(f'{name}.{key}', entry)
    else:
        yield name, value


def parse_section(cls: type, values: Any, place: str) -> Any:
    """Build a settings dataclass of a map; `place` names it in error messages."""
    if not isinstance(values, Mapping):
        why = f'expected a map of parameters, got {values!r}'
        raise ConfigurationError(place.rstrip(': ') or 'parameters', why)
    before = f'{place}.' if place and not place.endswith(': ') else place
    known = {f.name: f for f in fields(cls)}
    for key in values:
        if key not in known:
            hint = did_you_mean(str(key), known, f'known: {", ".join(sorted(known))}')
            raise ConfigurationError(f'{before}{key}', f'unknown parameter ({hint})')
    hints = typing.get_type_hints(cls)
    parsed = {}
    for name, f in known.items():
        if name in values:
            parsed[name] = _parse_value(f, hints[name], values[name], before + name)
        elif f.default is MISSING and f.default_factory is MISSING:
            meaning = meanings(cls).get(name, f.type)
            raise ConfigurationError(before + name, f'required parameter is missing ({meaning})')
    return cls(**parsed)


def _parse_value(f: Field[Any], hint: Any, value: Any, place: str) -> Any:
    kind = plain_types(hint)[-1 if _is_list(value) else 0]
    parse = f.metadata.get('parse') or _PARSERS.get(kind) or partial(parse_section, kind)
    parsed = parse(value, place)
    if 'allowed' in f.metadata:
        f.metadata['allowed'].check_value(parsed, place)
    return parsed


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


def parse_text(value: Any, place: str, kind: type = str) -> Any:
    """A text, or true or false where `kind` is bool.

    Raises:
        ConfigurationError: anything else.
    """
    if not isinstance(value, kind):
        word = 'text' if kind is str else 'true or false'
        raise ConfigurationError(place, f'expected {word}, got {value!r}')
    return value


def parse_list(parse: Parser, value: Any, place: str) -> tuple[Any, ...]:
    """A list of what another function parses.

    Raises:
        ConfigurationError: no list, or as that function.
    """
    if not _is_list(value):
        raise ConfigurationError(place, f'expected a list, got {value!r}')
    return tuple(parse(entry, f'{place}[{i}]') for i, entry in enumerate(value))


def _named(parse: Parser, value: Any, place: str) -> dict[str, Any]:
    """A map, in the order of its names: parameters of a ROS 2 node keep no other."""
    if not isinstance(value, Mapping):
        raise ConfigurationError(place, f'expected a map of named entries, got {value!r}')
    for name in value:
        if not isinstance(name, str) or not name or '.' in name:
            raise ConfigurationError(place, f'{name!r} is no name: give text without a dot')
    return {name: parse(value[name], f'{place}.{name}') for name in sorted(value)}


def _free_map(value: Any, place: str) -> Any:
    if not isinstance(value, Mapping):
        raise ConfigurationError(place, f'expected a map, got {value!r}')
    return _free(value, place)


def _free(value: Any, place: str) -> Any:
    """Texts, numbers, and lists and maps of them."""
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        return {str(key): _free(v, f'{place}.{key}') for key, v in value.items()}
    return (partial(parse_list, _free) if _is_list(value) else parse_number)(value, place)


def _is_list(value: Any) -> bool:
    return hasattr(value, '__iter__') and not isinstance(value, str | bytes | Mapping)


_PARSERS: dict[Any, Parser] = {
    float: parse_number,
    int: partial(parse_number, kind=int),
    str: parse_text,
    bool: partial(parse_text, kind=bool),
    FloatList: partial(parse_list, parse_number),
    TextList: partial(parse_list, parse_text),
    FloatMap: lambda value, place: (
        {REST: 0.0} if value == REST else _named(parse_number, value, place)
    ),
    FreeMaps: partial(_named, _free_map),
}
"""By the type of a field; any other is that of a section."""
