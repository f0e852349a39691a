"""The grammar of laws: every form that the search for what a leftover depends on may propose.

A form is a sum of columns, each a formula of one or two inputs x and y and of parameters that it
is not linear in. With coefficients it is the formula of a `learned_torque`.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from ...model.body import joint_unit
from ...types import Array
from ..motion import Motion
from .dimensions import powers_of, unit_text
from .expression import Expression
from .quantities import bracketed, quantity_along

Powers = tuple[float, ...]


@dataclass(frozen=True)
class Form:
    """A form of the grammar.

    Args:
        name: Its columns, separated by commas, with x and y for the inputs.
        powers: Of every column, the power of each input in it, for the units of coefficients.
        options: Parameters that it is not linear in, with the power of each input in them.
        ratio: r where it is a function of x + r y alone; 0 else.
    """

    name: str
    powers: tuple[Powers, ...]
    options: Mapping[str, Powers] = field(default_factory=dict)
    ratio: float = 0.0

    @cached_property
    def columns(self) -> tuple[Expression, ...]:
        """What computes each column."""
        texts = re.split(r', (?![^(]*\))', self.name)
        return tuple(Expression.parse(text, self.name) for text in texts)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of what it is not linear in."""
        return tuple(self.options)

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return len(self.powers[0])

    def __call__(self, inputs: Sequence[Array], parameters: Mapping[str, float]) -> Array:
        """(N, K) columns of (N,) inputs along a motion."""
        values = {**dict(zip('xy', inputs, strict=False)), **parameters}
        columns = [np.broadcast_to(column(values), len(inputs[0])) for column in self.columns]
        return np.stack(columns, axis=1)

    def entry(
        self, inputs: Sequence[str], options: Mapping[str, float], units: LawUnits
    ) -> dict[str, Any]:
        """The formula of a law in a robot file, without values: its text and its parameters.

        Args:
            inputs: Names of the inputs, such as `rate/joint_2`.
            options: Values of its parameters.
            units: Of its place.
        """
        keys = zip('xy'[: len(inputs)], inputs, strict=True)
        names = {key: formula_name(name, units.where) for key, name in keys}
        texts = [
            re.sub(r'\b[xy]\b', lambda found: names[found[0]], column.text)
            for column in self.columns
        ]
        parameters: dict[str, dict[str, Any]] = {
            f'c{k}': {'unit': units.of(powers, inputs)} for k, powers in enumerate(self.powers, 1)
        }
        for option, powers in self.options.items():
            unit = units.of([-power for power in powers], inputs, '')
            parameters[option] = {'unit': unit, 'fixed': float(options[option])}
        terms = (f'c{k} * ({text})' for k, text in enumerate(texts, 1))
        return {'torque': ' + '.join(terms), 'parameters': parameters}


@dataclass(frozen=True, slots=True)
class LawUnits:
    """Units of a law at a place.

    Args:
        where: The place. unit: Of the torque there. sliding: Joints that slide.
        extra: Units of what else is measured, by name.
    """

    where: str
    unit: str = 'N m'
    sliding: Collection[str] = ()
    extra: Mapping[str, str] = field(default_factory=dict)

    def of(self, powers: Sequence[float], inputs: Sequence[str], unit: str | None = None) -> str:
        """Unit by the powers of each input; see `unit_of`."""
        whole = self.unit if unit is None else unit
        return unit_of(powers, inputs, whole, self.sliding, self.extra)


def _form(name: str, *powers: Powers, ratio: float = 0.0, **options: Powers) -> Form:
    return Form(name, powers, options, ratio)


def _sums() -> tuple[Form, ...]:
    """Functions of the sum or the difference of two inputs."""
    out = []
    for ratio, u in ((1.0, 'x + y'), (-1.0, 'x - y')):
        out.append(_form(f'sign({u})', (0, 0), ratio=ratio))
        out.append(_form(f'sign({u}), {u}', (0, 0), (1, 0), ratio=ratio))
        out.append(_form(f'sin({u}), cos({u})', (0, 0), (0, 0)))
    return tuple(out)


_FORMS = (
    _form('x', (1,)),
    _form('x, x**2', (1,), (2,)),
    _form('1, x - centre', (0,), (1,), centre=(1,)),
    _form('1, x - centre, (x - centre)**2, (x - centre)**3', (0,), (1,), (2,), (3,), centre=(1,)),
    _form('x**3', (3,)),
    _form('x*abs(x)', (2,)),
    _form('sign(x)', (0,)),
    _form('sign(x), x', (0,), (1,)),
    _form('sign(x), x, abs(x)', (0,), (1,), (1,)),
    _form('sign(x)*sqrt(abs(x))', (0.5,)),
    _form('sign(x)*exp(-(x/scale)**2)', (0,), scale=(1,)),
    _form('exp(-x/scale)', (0,), scale=(1,)),
    _form('sin(m*x), cos(m*x)', (0,), (0,), m=(-1,)),
    _form('min(x, lower) - lower, max(x, upper) - upper', (1,), (1,), lower=(1,), upper=(1,)),
    _form('x*y', (1, 1)),
    _form('x, y', (1, 0), (0, 1)),
    _form('x, x*y', (1, 0), (1, 1)),
    _form('sign(x), y', (0, 0), (0, 1)),
    _form('sign(x), y*sign(x)', (0, 0), (0, 1)),
    _form('sign(x), y*sign(x), y**2*sign(x)', (0, 0), (0, 1), (0, 2)),
    _form('x, x*y, x*y**2', (1, 0), (1, 1), (1, 2)),
    _form('sign(x), sin(m*y)*sign(x), cos(m*y)*sign(x)', *((0, 0),) * 3, m=(0, -1)),
    _form('x, x*sin(m*y), x*cos(m*y)', *((1, 0),) * 3, m=(0, -1)),
    _form('x, x*exp(-y/scale)', (1, 0), (1, 0), scale=(0, 1)),
    _form('abs(y)*sign(x)', (0, 1)),
    _form('y**2*sign(x)', (0, 2)),
    _form('y*abs(x)', (1, 1)),
    _form('sin(m*y), cos(m*y), x*sin(m*y), x*cos(m*y)', (0, 0), (0, 0), (1, 0), (1, 0), m=(0, -1)),
    *_sums(),
)

FORMS: Mapping[str, Form] = MappingProxyType({form.name: form for form in _FORMS})
"""Every form by its name."""

_QUANTITIES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        'rate': ('rate', 'rad/s'),
        'angle': ('position', 'rad'),
        'load': ('effort', 'N m'),
        'acceleration': ('acceleration', 'rad/s^2'),
        'time': ('time', 's'),
        'attitude': ('attitude', ''),
        'base_rate': ('base_rate', 'rad/s'),
    }
)
"""What an input may be: its name in formulas, and its unit, of joints that turn."""


def quantity(name: str) -> tuple[str, str]:
    """Of an input such as `rate/joint_2`: what it is, and whose."""
    what, _, whose = name.partition('/')
    return what, whose


def input_of(name: str, motion: Motion) -> Array | None:
    """(N,) an input along a motion; None where the motion does not have it."""
    what, whose = quantity(name)
    return quantity_along(_QUANTITIES.get(what, (what, ''))[0], whose, motion)


def formula_name(name: str, where: str | None = None) -> str:
    """An input such as `angle/joint_2` as formulas have it: `position` at joint_2."""
    what, whose = quantity(name)
    known = _QUANTITIES.get(what, (what, ''))[0]
    return known if whose == where else bracketed(known, whose)


def unit_of(
    powers: Sequence[float],
    inputs: Sequence[str],
    unit: str = 'N m',
    sliding: Collection[str] = (),
    extra: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """Unit of a coefficient.

    Args:
        powers: Of each input in its column.
        inputs: Their names.
        unit: Of the sum.
        sliding: Joints that slide.
        extra: Units of what else is measured; the name of one that is not in it stands for it.
    """
    total = powers_of(unit)
    for power, name in zip(powers, inputs, strict=True):
        what, whose = quantity(name)
        own = {whose: 1.0} if whose not in extra else powers_of(extra[whose])
        if what in _QUANTITIES:
            own = powers_of(joint_unit(_QUANTITIES[what][1], {whose in sliding}))
        for base, count in own.items():
            total[base] = total.get(base, 0) - power * count
    return unit_text(total) or '1'
