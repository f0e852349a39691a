"""The grammar of learned torques: every form that a law may have, written once.

A form is a name and columns: functions of one or two inputs x and y, some with parameters, whose
sum with coefficients is a torque. Nothing is evaluated from text: the name is looked up. The
simulator, the controller and the search for what a leftover depends on use the same forms.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from ...model.body import joint_unit
from ...types import Array
from ..joint import direction
from .dimensions import powers_of, unit_text
from .hysteresis import followed

ColumnsOf = Callable[..., tuple[Array, ...]]

DAHL, PLAY = 'dahl(x)', 'play(x)'


@dataclass(frozen=True, slots=True)
class Form:
    """A form of the grammar.

    Args:
        name: Its formula, with x and y for the inputs.
        columns: (N,) each, of inputs (N,), and of parameters by name.
        powers: Of every column, the power of each input in it, for the units of coefficients.
        ratio: r where it is a function of x + r y alone; 0 else.
        has_history: Whether its one column is a share of the torque that a path mobilises.
    """

    name: str
    columns: ColumnsOf
    powers: tuple[tuple[float, ...], ...]
    ratio: float = 0.0
    has_history: bool = False

    keys: ClassVar[tuple[str, ...]] = ()

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of what it is not linear in: what its columns take behind the inputs."""
        return _arguments(self.columns)[self.inputs :]

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return len(self.powers[0])

    def entry(self) -> dict[str, str]:
        """As in a robot file."""
        return {'form': self.name}

    def __call__(self, inputs: Sequence[Array], parameters: Mapping[str, float]) -> Array:
        """(N, K) columns of (N,) inputs along a motion; a history begins free of torque."""
        values = {name: parameters[name] for name in self.parameters}
        return np.stack(self.columns(*inputs, **values), axis=1)


@cache
def _arguments(columns: ColumnsOf) -> tuple[str, ...]:
    return tuple(inspect.getfullargspec(columns).args)


def _sum_of(ratio: float) -> tuple[Form, ...]:
    """Friction of a rate that is the sum or the difference of two."""
    u = 'x + y' if ratio > 0.0 else 'x - y'

    def both(x: Array, y: Array) -> tuple[Array, ...]:
        return direction(x + ratio * y), x + ratio * y

    def turning(x: Array, y: Array) -> tuple[Array, ...]:
        return np.sin(x + ratio * y), np.cos(x + ratio * y)

    return (
        Form(f'sign({u})', lambda x, y: both(x, y)[:1], ((0, 0),), ratio=ratio),
        Form(f'sign({u}), {u}', both, ((0, 0), (1, 0)), ratio=ratio),
        Form(f'sin({u}), cos({u})', turning, ((0, 0), (0, 0))),
    )


def _hysteresis(name: str) -> Form:
    """Dry friction that builds up over a displacement."""

    def share(x: Array, displacement: float) -> tuple[Array, ...]:
        return (followed(x, displacement, is_dahl=name == DAHL),)

    return Form(name, share, ((0,),), has_history=True)


def _each(count: int) -> Form:
    """A sum of so many inputs, each with a coefficient."""
    powers = tuple(tuple(float(i == k) for i in range(count)) for k in range(count))
    return Form(f'sum of {count}', lambda *x: x, powers)


def _spring(degree: int) -> Form:
    """A polynomial of a degree about an angle, which rests anywhere."""
    powers = tuple(range(degree + 1))
    name = ', '.join(('1', 'u', 'u^2', 'u^3')[: degree + 1])

    def columns(x: Array, centre: float) -> tuple[Array, ...]:
        return tuple((x - centre) ** k for k in powers)

    return Form(f'{name} of u = x - centre', columns, tuple((k,) for k in powers))


def _times(x: Array, m: float) -> tuple[Array, ...]:
    return np.ones(len(x)), np.sin(m * x), np.cos(m * x)


def _hollow(x: Array, lower: float, upper: float) -> tuple[Array, ...]:
    return np.minimum(x - lower, 0.0), np.maximum(x - upper, 0.0)


_FORMS = (
    Form('x', lambda x: (x,), ((1,),)),
    Form('x, x^2', lambda x: (x, x**2), ((1,), (2,))),
    Form('x, x^2, x^3', lambda x: (x, x**2, x**3), ((1,), (2,), (3,))),
    _spring(1),
    _spring(3),
    Form('x^2', lambda x: (x**2,), ((2,),)),
    Form('x^3', lambda x: (x**3,), ((3,),)),
    Form('x |x|', lambda x: (x * np.abs(x),), ((2,),)),
    Form('sign(x)', lambda x: (direction(x),), ((0,),)),
    Form('sign(x), x', lambda x: (direction(x), x), ((0,), (1,))),
    Form('sign(x), x, |x|', lambda x: (direction(x), x, np.abs(x)), ((0,), (1,), (1,))),
    Form('sign(x) sqrt|x|', lambda x: (direction(x) * np.sqrt(np.abs(x)),), ((0.5,),)),
    Form(
        'sign(x) exp(-(x/scale)^2)',
        lambda x, scale: (direction(x) * np.exp(-((x / scale) ** 2)),),
        ((0,),),
    ),
    Form('exp(-x/scale)', lambda x, scale: (np.exp(-x / scale),), ((0,),)),
    Form('sin(m x), cos(m x)', lambda x, m: _times(x, m)[1:], ((0,), (0,))),
    Form('beyond(x)', _hollow, ((1,), (1,))),
    _hysteresis(PLAY),
    _hysteresis(DAHL),
    Form('x y', lambda x, y: (x * y,), ((1, 1),)),
    Form('x, y', lambda x, y: (x, y), ((1, 0), (0, 1))),
    Form('x, x y', lambda x, y: (x, x * y), ((1, 0), (1, 1))),
    Form('sign(x), y', lambda x, y: (direction(x), y), ((0, 0), (0, 1))),
    Form('sign(x), y sign(x)', lambda x, y: (direction(x), y * direction(x)), ((0, 0), (0, 1))),
    Form(
        'sign(x), y sign(x), y^2 sign(x)',
        lambda x, y: tuple(direction(x) * f for f in (np.ones(len(y)), y, y**2)),
        ((0, 0), (0, 1), (0, 2)),
    ),
    Form('x, x y, x y^2', lambda x, y: (x, x * y, x * y**2), ((1, 0), (1, 1), (1, 2))),
    Form(
        'sign(x), sin(m y) sign(x), cos(m y) sign(x)',
        lambda x, y, m: tuple(direction(x) * f for f in _times(y, m)),
        ((0, 0),) * 3,
    ),
    Form(
        'x, x sin(m y), x cos(m y)',
        lambda x, y, m: tuple(x * f for f in _times(y, m)),
        ((1, 0),) * 3,
    ),
    Form('x, x exp(-y/scale)', lambda x, y, scale: (x, x * np.exp(-y / scale)), ((1, 0), (1, 0))),
    Form('|y| sign(x)', lambda x, y: (np.abs(y) * direction(x),), ((0, 1),)),
    Form('y^2 sign(x)', lambda x, y: (y**2 * direction(x),), ((0, 2),)),
    Form('y |x|', lambda x, y: (y * np.abs(x),), ((1, 1),)),
    Form(
        'sin(m y), cos(m y), x sin(m y), x cos(m y)',
        lambda x, y, m: tuple(a * f for a in (np.ones(len(x)), x) for f in _times(y, m)[1:]),
        ((0, 0), (0, 0), (1, 0), (1, 0)),
    ),
    _each(3),
    _each(9),
    *_sum_of(1.0),
    *_sum_of(-1.0),
)

FORMS: Mapping[str, Form] = MappingProxyType({form.name: form for form in _FORMS})
"""Every form by its name."""

QUANTITIES: Mapping[str, str] = MappingProxyType(
    {
        'rate': 'rad/s',
        'angle': 'rad',
        'load': 'N m',
        'acceleration': 'rad/s^2',
        'time': 's',
        'attitude': '',
        'base_rate': 'rad/s',
    }
)
"""Units of what an input may be, those of joints that turn; that of `extra` goes by its name."""


def quantity(name: str) -> tuple[str, str]:
    """Of an input such as `rate/joint_2`: what it is, and whose."""
    what, _, whose = name.partition('/')
    return what, whose


def unit_of(
    powers: Sequence[float],
    inputs: Sequence[str],
    unit: str = 'N m',
    sliding: Collection[str] = (),
) -> str:
    """Unit of a coefficient.

    Args:
        powers: Of each input in its column.
        inputs: Their names.
        unit: Of the sum.
        sliding: Joints that slide.
    """
    total = powers_of(unit)
    for power, name in zip(powers, inputs, strict=True):
        what, whose = quantity(name)
        own = {whose: 1.0}
        if what in QUANTITIES:
            own = powers_of(joint_unit(QUANTITIES[what], {whose in sliding}))
        for base, count in own.items():
            total[base] = total.get(base, 0) - power * count
    return unit_text(total) or '1'
