"""What a formula declares: its parameters, and what else it takes of a recording."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from functools import partial
from typing import Any, TypeVar

from ...errors import ConfigurationError
from ...model.schema import FloatList, param, parse_section
from ..parameter import Parameter

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
