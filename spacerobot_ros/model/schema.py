"""Maps checked against dataclasses whose fields carry unit, bounds and meaning."""

from __future__ import annotations

import difflib
import math
import sys
import types
import typing
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields
from typing import Any

from ..errors import ConfigurationError

FloatList = tuple[float, ...]
TextList = tuple[str, ...]
FreeMaps = Mapping[str, Mapping[str, float | str]]
"""Maps under free names, of numbers and texts whose meaning is checked elsewhere."""


def parse_section(cls: type, values: Any, place: str) -> Any:
    """Build a settings dataclass of a map; `place` names it in error messages."""
    if not isinstance(values, Mapping):
        raise ConfigurationError(
            place.rstrip(': ') or 'parameters', f'expected a map of parameters, got {values!r}'
        )
    known = {f.name: f for f in fields(cls)}
    for key in values:
        if key not in known:
            raise ConfigurationError(
                _join(place, str(key)), f'unknown parameter{_suggest(str(key), list(known))}'
            )
    hints = typing.get_type_hints(cls)
    parsed = {}
    for name, f in known.items():
        where = _join(place, name)
        if name in values:
            parsed[name] = _parse_value(f, hints[name], values[name], where)
        elif f.default is MISSING and f.default_factory is MISSING:
            raise ConfigurationError(
                where, f'required parameter is missing ({f.metadata.get("doc", f.type)})'
            )
    return cls(**parsed)


def _parse_value(f: Field[Any], hint: Any, value: Any, place: str) -> Any:
    if hasattr(hint, '__dataclass_fields__'):
        return parse_section(hint, value, place)
    if isinstance(hint, types.UnionType):
        hint = next(a for a in typing.get_args(hint) if a is not type(None))
    parsed: Any
    if hint == FreeMaps:
        return _free_maps(value, place)
    if hint == FloatList:
        parsed = tuple(
            _number(v, f'{place}[{i}]', float) for i, v in enumerate(_list(value, place))
        )
    elif hint == TextList:
        parsed = tuple(_text(v, f'{place}[{i}]') for i, v in enumerate(_list(value, place)))
    elif hint is bool:
        if not isinstance(value, bool):
            raise ConfigurationError(place, f'expected true or false, got {value!r}')
        parsed = value
    elif hint is str:
        parsed = _text(value, place)
    else:
        parsed = _number(value, place, hint)
    _check_bounds(f, parsed, place)
    return parsed


def _free_maps(value: Any, place: str) -> dict[str, dict[str, float | str]]:
    """In the order of the names: parameters of a ROS 2 node keep no other."""
    if not isinstance(value, Mapping):
        raise ConfigurationError(place, f'expected a map of named entries, got {value!r}')
    for name, entry in value.items():
        if not isinstance(name, str) or not name or '.' in name:
            raise ConfigurationError(place, f'{name!r} is no name: give text without a dot')
        if not isinstance(entry, Mapping):
            raise ConfigurationError(f'{place}.{name}', f'expected a map, got {entry!r}')
    return {
        name: {str(key): _scalar(v, f'{place}.{name}.{key}') for key, v in entry.items()}
        for name, entry in sorted(value.items())
    }


def _scalar(value: Any, place: str) -> float | str:
    return value if isinstance(value, str) else float(_number(value, place, float))


def _list(value: Any, place: str) -> list[Any]:
    if isinstance(value, (str, bytes, Mapping)) or not hasattr(value, '__iter__'):
        raise ConfigurationError(place, f'expected a list, got {value!r}')
    return list(value)


def _text(value: Any, place: str) -> str:
    if not isinstance(value, str):
        raise ConfigurationError(place, f'expected text, got {value!r}')
    return value


def _number(value: Any, place: str, kind: type) -> Any:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ConfigurationError(place, f'expected a number, got {value!r}')
    if abs(value) > sys.float_info.max or not math.isfinite(value):
        raise ConfigurationError(place, f'{value} is not a finite number in range')
    if kind is int and value != int(value):
        raise ConfigurationError(place, f'expected a whole number, got {value}')
    return kind(value)


def _check_bounds(f: Field[Any], value: Any, place: str) -> None:
    meta = f.metadata
    if meta.get('choices') and value not in meta['choices']:
        raise ConfigurationError(place, f'{value!r} is not one of {", ".join(meta["choices"])}')
    if meta.get('length') is not None and len(value) != meta['length']:
        raise ConfigurationError(place, f'expected {meta["length"]} numbers, got {len(value)}')
    entries = list(enumerate(value)) if isinstance(value, tuple) else [(None, value)]
    for index, entry in entries:
        if isinstance(entry, (str, bool)):
            continue
        where = place if index is None else f'{place}[{index}]'
        unit = f' {meta["unit"]}' if meta.get('unit') else ''
        if meta.get('minimum') is not None and entry < meta['minimum']:
            raise ConfigurationError(
                where, f'{entry}{unit} is below the smallest allowed value {meta["minimum"]}'
            )
        if meta.get('above') is not None and entry <= meta['above']:
            raise ConfigurationError(where, f'{entry}{unit} must be above {meta["above"]}')
        if meta.get('maximum') is not None and entry > meta['maximum']:
            raise ConfigurationError(
                where, f'{entry}{unit} is above the largest allowed value {meta["maximum"]}'
            )


def _join(place: str, key: str) -> str:
    return f'{place}.{key}' if place and not place.endswith(': ') else f'{place}{key}'


def _suggest(key: str, known: list[str]) -> str:
    close = difflib.get_close_matches(key, known, n=1)
    return f' (did you mean {close[0]!r}?)' if close else f' (known: {", ".join(sorted(known))})'
