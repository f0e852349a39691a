"""Formulas as text: a closed grammar, parsed and checked, never run as code.

Numbers, names, names with another in brackets (`rate[joint_2]`), `+ - * / **`, parentheses and
the functions of `FUNCTIONS`: nothing else is in the grammar, so that a formula can compute and do
nothing besides. Units are carried along; angles are pure numbers.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from ...errors import ConfigurationError
from ...types import Array
from ..joint import direction
from .dimensions import PURE, Dimension, dimension, in_words

QuantityValues = Mapping[str, Any]
FUNCTIONS: Mapping[str, tuple[Callable[..., Any], int, str]] = MappingProxyType(
    {
        **{
            name: (getattr(np, name), 1, 'pure')
            for name in ('sin', 'cos', 'tan', 'tanh', 'exp', 'log', 'arctan')
        },
        'sqrt': (np.sqrt, 1, 'root'),
        'abs': (np.abs, 1, 'same'),
        'sign': (direction, 1, 'sign'),
        'min': (np.minimum, 2, 'same'),
        'max': (np.maximum, 2, 'same'),
    }
)
"""By name: what is computed, of how many numbers, and what becomes of their units. A sign is
smooth, so that friction can be integrated."""
_OPERATORS: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}
_LONGEST, _DEEPEST = 2000, 60  # characters, and levels of parentheses
_SHOWN = 80  # characters of what is refused


@dataclass(frozen=True, slots=True, eq=False)
class Expression:
    """A parsed formula.

    Args:
        text: As it was written.
        names: Every name in it.
    """

    text: str
    names: frozenset[str]
    _node: ast.expr
    _compute: Callable[[QuantityValues], Any]

    @classmethod
    def parse(cls, text: object, place: str) -> Expression:
        """From text.

        Raises:
            ConfigurationError: no formula of the grammar; what is not in it is quoted.
        """
        if not isinstance(text, str) or not text.strip():
            raise ConfigurationError(place, f'expected a formula as text, got {text!r}')
        if len(text) > _LONGEST:
            raise ConfigurationError(place, f'is longer than {_LONGEST} characters')
        try:
            node = ast.parse(text.strip(), mode='eval').body
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            why = error.msg if isinstance(error, SyntaxError) else type(error).__name__
            raise ConfigurationError(place, f'{text!r} is no formula: {why}') from error
        compute = _compiled(node, place)
        return cls(text.strip(), frozenset(_names(node)), node, compute)

    def __call__(self, values: QuantityValues) -> Array:
        """What it is for values of its names; not finite where it divides by zero."""
        with np.errstate(all='ignore'):
            return np.asarray(self._compute(values), dtype=float)

    def check_unit(self, units: Mapping[str, str], wanted: str, place: str) -> None:
        """Refuse a formula whose parts do not fit each other, or not the unit of the whole.

        Args:
            units: Of every name.
            wanted: Of the formula.
            place: Where it stands, for messages.
        """
        dimensions = {name: dimension(unit, place) for name, unit in units.items()}
        found = _dimension(self._node, dimensions, place)
        if found != dimension(wanted, place):
            why = f'{self.text!r} is in {in_words(found)}, expected {wanted or "a pure number"}'
            raise ConfigurationError(place, why)


def _name(node: ast.AST) -> str:
    """A name, or one with another in brackets behind it, such as `rate[joint_2]`; else empty.

    What is no name to Python stands in quotes there.
    """
    match node:
        case ast.Name(id=name):
            return name
        case ast.Subscript(value=ast.Name(id=name), slice=ast.Name(id=whose)):
            return f'{name}[{whose}]'
        case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=str() as whose)):
            return f'{name}[{whose}]'
    return ''


def _names(node: ast.expr) -> Iterator[str]:
    """Every name in a formula of the grammar."""
    if name := _name(node):
        yield name
        return
    for part in node.args if isinstance(node, ast.Call) else ast.iter_child_nodes(node):
        if isinstance(part, ast.expr):
            yield from _names(part)


def _number(number: float, place: str) -> float:
    if not abs(number) <= sys.float_info.max:
        raise ConfigurationError(place, 'has a number that is too large')
    return float(number)


def _refusal(node: ast.AST, place: str) -> ConfigurationError:
    """What to raise for what is not in the grammar."""
    try:
        text = ast.unparse(node)
    except RecursionError:
        text = 'what is nested so deeply'
    shown = text if len(text) < _SHOWN else f'{text[:_SHOWN]}...'
    return ConfigurationError(place, f'{shown!r} is not part of a formula')


def _compiled(node: ast.AST, place: str, depth: int = 0) -> Callable[[QuantityValues], Any]:
    """What computes a node; refuses all that is not in the grammar."""
    if depth > _DEEPEST:
        raise ConfigurationError(place, f'is nested deeper than {_DEEPEST} levels')
    inside = partial(_compiled, place=place, depth=depth + 1)
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            value = _number(number, place)
            return lambda values: value
        case ast.Name() | ast.Subscript() if name := _name(node):
            return lambda values: values[name]
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
            inner = inside(operand)
            return inner if isinstance(sign, ast.UAdd) else lambda values: -inner(values)
        case ast.BinOp(left=a, op=operator, right=b) if type(operator) in _OPERATORS:
            left, right, function = inside(a), inside(b), _OPERATORS[type(operator)]
            return lambda values: function(left(values), right(values))
        case ast.Call(func=ast.Name(id=name), args=given, keywords=[]) if name in FUNCTIONS:
            known, wanted, _ = FUNCTIONS[name]
            if len(given) != wanted:
                raise ConfigurationError(place, f'{name} takes {wanted}, got {len(given)}')
            parts = [inside(part) for part in given]
            return lambda values: known(*(part(values) for part in parts))
        case ast.Call(func=ast.Name(id=name)):
            why = f'there is no function {name!r} (there are {", ".join(FUNCTIONS)})'
            raise ConfigurationError(place, why)
    raise _refusal(node, place)


def _dimension(node: ast.AST, units: Mapping[str, Dimension], place: str) -> Dimension:
    """Dimension of a node whose grammar is known to be right."""
    match node:
        case ast.Name() | ast.Subscript():
            return units[_name(node)]
        case ast.UnaryOp(operand=operand):
            return _dimension(operand, units, place)
        case ast.Call(func=ast.Name(id=name)):
            return _of_call(node, name, units, place)
        case ast.BinOp():
            return _of_operation(node, units, place)
    return PURE


def _of_call(node: ast.Call, name: str, units: Mapping[str, Dimension], place: str) -> Dimension:
    first, *others = (_dimension(part, units, place) for part in node.args)
    rule = FUNCTIONS[name][2]
    if rule == 'pure' and first != PURE:
        why = f'{ast.unparse(node)!r}: {name} takes a pure number, got {in_words(first)}'
        raise ConfigurationError(place, why)
    if any(other != first for other in others):
        raise ConfigurationError(place, f'{ast.unparse(node)!r}: the units do not fit')
    if rule == 'root':
        return tuple(0.5 * power for power in first)
    return first if rule == 'same' else PURE


def _of_operation(node: ast.BinOp, units: Mapping[str, Dimension], place: str) -> Dimension:
    left, right = (_dimension(part, units, place) for part in (node.left, node.right))
    if isinstance(node.op, ast.Mult):
        return tuple(a + b for a, b in zip(left, right, strict=True))
    if isinstance(node.op, ast.Div):
        return tuple(a - b for a, b in zip(left, right, strict=True))
    if isinstance(node.op, ast.Pow):
        return _of_power(node, left, right, place)
    if left != right:
        why = f'{ast.unparse(node)!r}: {in_words(left)} and {in_words(right)} do not add up'
        raise ConfigurationError(place, why)
    return left


def _of_power(node: ast.BinOp, base: Dimension, power: Dimension, place: str) -> Dimension:
    if power != PURE:
        why = f'{ast.unparse(node)!r}: an exponent is a pure number, got {in_words(power)}'
        raise ConfigurationError(place, why)
    if base == PURE:
        return PURE
    try:
        exponent = float(ast.literal_eval(node.right))
    except (ValueError, TypeError):
        why = f'{ast.unparse(node)!r}: only a number is an exponent of {in_words(base)}'
        raise ConfigurationError(place, why) from None
    return tuple(exponent * own for own in base)
