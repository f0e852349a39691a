"""The entry of a learned torque in a robot file: numbers, texts and ranges with their places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Any

from ...errors import ConfigurationError
from ...model.schema import parse_list, parse_number
from .grammar import FORMS, Form
from .table_form import TableForm


class LearnedEntry:
    """An entry of a robot file, read piece by piece.

    Args:
        given: The entry. place: Its place, for messages.
    """

    def __init__(self, given: Mapping[str, Any], place: str) -> None:
        self._given, self._place = given, place

    def form(self) -> Form | TableForm:
        """A form of the grammar, or a table."""
        if self._given.get('form') == TableForm.name:
            return TableForm.read(self._given, self._place)
        name = str(self._required('form'))
        if name not in FORMS:
            near = get_close_matches(name, FORMS, n=3)
            hint = f'did you mean {" or ".join(map(repr, near))}?' if near else 'see docs'
            raise ConfigurationError(f'{self._place}.form', f'no form {name!r} ({hint})')
        return FORMS[name]

    def number(self, key: str) -> float:
        """A number that must be there."""
        return float(parse_number(self._required(key), f'{self._place}.{key}'))

    def numbers(self, key: str) -> tuple[float, ...]:
        """A list of them."""
        return parse_list(parse_number, self._required(key), f'{self._place}.{key}')

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of texts."""
        return tuple(str(value) for value in self._list(key))

    def one(self, key: str) -> str:
        """A list of one text at the most; empty: none."""
        given = self._list(key) if key in self._given else ()
        if len(given) > 1:
            raise ConfigurationError(f'{self._place}.{key}', f'expected one, got {list(given)}')
        return str(given[0]) if given else ''

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Smallest and largest, by input."""
        given, at = self._required('range'), f'{self._place}.range'
        if not isinstance(given, Mapping):
            raise ConfigurationError(at, 'expected {input: [smallest, largest]}')
        out = {}
        for name, ends in given.items():
            if not isinstance(ends, list | tuple) or len(ends) != 2:
                raise ConfigurationError(f'{at}.{name}', f'expected two numbers, got {ends!r}')
            low, high = (float(parse_number(end, f'{at}.{name}')) for end in ends)
            out[str(name)] = (low, high)
        return out

    def refuse_others(self, known: Sequence[str]) -> None:
        """Refuse what is not known."""
        for key in self._given:
            if key not in known:
                why = f'learned_torque has no such parameter (it has {", ".join(known[2:])})'
                raise ConfigurationError(f'{self._place}.{key}', why)

    def _list(self, key: str) -> Sequence[Any]:
        place = f'{self._place}.{key}'
        return parse_list(lambda entry, _: entry, self._required(key), place)

    def _required(self, key: str) -> Any:
        if key not in self._given:
            raise ConfigurationError(f'{self._place}.{key}', 'is missing')
        return self._given[key]
