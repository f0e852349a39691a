"""Which laws a leftover may follow: forms of the grammar with inputs, and how rare each is.

A law's price is the negative logarithm of its rarity [nats], as people who build such machines see
it: what every joint has costs nothing, what needs another joint's variable 2.5, a clock 2.5 and
more. The evidence must pay it beside the price of the coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...effects.laws.grammar import FORMS, Form
from ...types import Array

_PER_TURN = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0)
_BENDS = (0.03, 0.1, 0.3)  # of the 95 % rate
_DISPLACEMENTS = (2e-3, 6e-3, 0.02, 0.06)  # rad
_WARM_UP = (0.1, 0.3, 1.0)  # of the record's length
_STOPS = (0.1, 0.2, 0.3)  # of the range, at either end
_SWEEPS = (0.0, 4.0, -4.0, 8.0, -8.0, 16.0, -16.0, 32.0, -32.0)  # of sines of the time, 1/T^2
_LOWEST, _HIGHEST = 0.05, 2.0  # Hz, of sines of the time: up to half the band
_SPACING = 0.5
"""Of the resolution 1/T: between two of them a sine keeps 81 % of its square. With 0.75 (63 %) 5
of 16 slow sweeps were functions of nothing that is measured, now 1 is."""
_MOST = 1500  # sines of the time: longer records sweep less, then have the low frequencies alone
REFINED = ('scale', 'displacement')
"""Options whose values are refined by the likelihood."""
SHAPE = 'shape'
NO_LAWS = ('inertial', 'clock', SHAPE)
"""Kinds that are none: where they win the leftover is an error of the masses, follows time, or is
of the shape of a cause."""


@dataclass(frozen=True, slots=True)
class Law:
    """A form with inputs.

    Args:
        form: Of the grammar.
        inputs: Their names.
        price: [nats].
        resembles: Class of laws, in words.
        kind: What it does with energy, see `learned_torque.KINDS`; `inertial` and `clock` are no
            laws: where they win, the leftover is an error of the masses, or follows the time.
        options: What the form is not linear in.
    """

    form: Form
    inputs: tuple[str, ...]
    price: float
    resembles: str
    kind: str
    options: Mapping[str, float] = field(default_factory=dict)

    @property
    def family(self) -> tuple[frozenset[str], str]:
        """Variables and class: laws that say the same in other words."""
        return frozenset(self.inputs), self.resembles

    @property
    def in_words(self) -> str:
        """Class and form."""
        values = [f', {name} {value:.3g}' for name, value in self.options.items() if value]
        return f'{self.resembles}: {self.form.name}{"".join(values)}'


@dataclass(frozen=True, slots=True)
class Extent:
    """What a motion covers, for guesses of options.

    Args:
        fast: 95 % rate of each joint [rad/s]. low, high: Its angles [rad]. duration: [s].
    """

    fast: Mapping[str, float]
    low: Mapping[str, float]
    high: Mapping[str, float]
    duration: float

    @classmethod
    def of(cls, joints: Sequence[str], q: Array, qd: Array, duration: float) -> Extent:
        """Of angles and rates (N, n)."""
        fast = np.maximum(np.quantile(np.abs(qd), 0.95, axis=0), 1e-3)
        ends = fast, np.min(q, axis=0), np.max(q, axis=0)
        rates, low, high = (dict(zip(joints, x.tolist(), strict=True)) for x in ends)
        return cls(rates, low, high, duration)


_OWN_RATE = (
    ('x', 0.0, 'viscous friction'),
    ('sign(x)', 1.0, 'Coulomb friction'),
    ('sign(x), x', 1.0, 'Coulomb and viscous friction'),
    ('x |x|', 1.5, 'drag'),
    ('sign(x) sqrt|x|', 2.0, 'friction that grows ever less with the rate'),
    ('sign(x), x, |x|', 2.0, 'friction that differs between directions'),
    ('x^3', 2.5, 'friction that grows ever more with the rate'),
)
_ANGLE_AND_RATE = (  # x is the rate, y the angle
    ('sign(x), y sign(x), y^2 sign(x)', 3.0, 'friction that changes with the angle'),
    ('x, x y, x y^2', 3.5, 'viscous friction that changes with the angle'),
)
_TURNING_AND_RATE = (
    ('sign(x), sin(m y) sign(x), cos(m y) sign(x)', 3.0, 'friction that changes with the angle'),
    ('x, x sin(m y), x cos(m y)', 3.5, 'viscous friction that changes with the angle'),
)
_LOAD = (
    (('rate', 'load'), '|y| sign(x)', 2.0, 'friction in proportion to the load', 'dissipative'),
    (('rate', 'load'), 'y^2 sign(x)', 3.0, 'friction that grows with the load', 'dissipative'),
    (('rate', 'load'), 'y |x|', 3.0, 'a gain that changes with the rate', 'gain'),
    (('load',), 'x |x|', 3.5, 'a gain that changes with the load', 'gain'),
)
_OTHER = (  # of another joint alone
    ('rate', 'x', 2.5, 'friction of another joint'),
    ('rate', 'sign(x)', 2.5, 'friction of another joint'),
    ('rate', 'sign(x), x', 3.0, 'friction of another joint'),
)
_SUMS = (  # x is the joint's own
    ('rate', 'sign(x + y)', 3.0, 'friction of a coupled wrist'),
    ('rate', 'sign(x + y), x + y', 3.0, 'friction of a coupled wrist'),
    ('rate', 'sign(x - y)', 3.0, 'friction of a coupled wrist'),
    ('rate', 'sign(x - y), x - y', 3.0, 'friction of a coupled wrist'),
    ('angle', 'sin(x + y), cos(x + y)', 3.0, 'a load on two angles'),
    ('angle', 'sin(x - y), cos(x - y)', 3.0, 'a load on two angles'),
)
_BOTH = (
    ('rate', 'x y', 3.5, 'a torque of two rates'),
    ('rate', 'x, y', 4.0, 'viscous friction of two joints'),
    ('rate', 'sign(x), y', 4.0, 'friction of two joints'),
)
_PRODUCT = 'sin(m y), cos(m y), x sin(m y), x cos(m y)'
"""A product of functions of two angles, as loads on two joints are, where x turns little."""
_WITH_EXTRA = (  # x is the rate, y is measured beside the motion
    ('x, x y', 3.0, 'viscous friction that changes with what is measured'),
    ('sign(x), y sign(x)', 3.0, 'Coulomb friction that changes with what is measured'),
)


def joint_laws(
    joint: str, joints: Mapping[str, str], extras: Sequence[str], at: Extent
) -> list[Law]:
    """Laws of a joint's torque.

    Args:
        joint: Whose.
        joints: All, with the unit of what they move by: only what has one unit adds up.
        extras: Names of what else is measured.
        at: Of the motion.
    """
    out = list(_own_laws(joint, at))
    for other, unit in joints.items():
        if other != joint:
            out += _shared_laws(joint, other, at, adds_up=unit == joints[joint])
    for extra in extras:
        name = f'extra/{extra}'
        out += [_law(form, (f'rate/{joint}', name), p, r) for form, p, r in _WITH_EXTRA]
        out.append(_law('x', (name,), 2.5, 'what is measured', 'external'))
        out.append(_law('x, x^2', (name,), 3.0, 'what is measured', 'external'))
    return [*out, *_slow_laws(at)]


def time_sines(duration: float) -> list[Law]:
    """The rival of every law: sines and cosines of 2 pi (f t + c t^2 / 2), by their number.

    Args:
        duration: T of the record [s].
    """
    frequencies = np.arange(_LOWEST, _HIGHEST, _SPACING / duration)[:_MOST].tolist()
    count = max(1, min(len(_SWEEPS), _MOST // max(len(frequencies), 1)))
    options = [{'f': f, 'c': c / duration**2} for f in frequencies for c in _SWEEPS[:count]]
    price = math.log(max(len(options), 1))
    return [Law(_SWEEP, ('time',), price, 'a sine of the time', 'clock', o) for o in options]


def _turning(t: Array, f: float, c: float) -> tuple[Array, ...]:
    angle = 2.0 * math.pi * (f * t + 0.5 * c * t**2)
    return np.sin(angle), np.cos(angle)


_SWEEP = Form('sin, cos of 2 pi (f t + c t^2 / 2)', _turning, ((0,), (0,)))


def _own_laws(joint: str, at: Extent) -> Iterator[Law]:
    v, q = f'rate/{joint}', f'angle/{joint}'
    for form, price, resembles in _OWN_RATE:
        yield _law(form, (v,), price, resembles)
    for share in _BENDS:
        options = {'scale': share * at.fast[joint]}
        yield _law('sign(x) exp(-(x/scale)^2)', (v,), 2.5, 'Stribeck friction', options=options)
    yield from _angle_laws(q, at.low[joint], at.high[joint])
    for form, price, resembles in _ANGLE_AND_RATE:
        yield _law(form, (v, q), price, resembles)
    for m in _PER_TURN:
        for form, price, resembles in _TURNING_AND_RATE:
            yield _law(form, (v, q), price, resembles, options={'m': m})
    for what, form, price, resembles, kind in _LOAD:
        yield _law(form, tuple(f'{name}/{joint}' for name in what), price, resembles, kind)
    for length in _WARM_UP:
        options = {'scale': length * at.duration}
        yield _law(
            'x, x exp(-y/scale)', (v, 'time'), 3.5, 'friction that warms up', options=options
        )
    yield _law('x', (f'acceleration/{joint}',), 2.0, 'an inertial error', 'inertial')


def _angle_laws(q: str, low: float, high: float) -> Iterator[Law]:
    middle = {'centre': 0.5 * (low + high)}
    for form in ('1, u of u = x - centre', '1, u, u^2, u^3 of u = x - centre'):
        yield _law(form, (q,), 1.5, 'a spring', 'potential', middle)
    for m in _PER_TURN:
        if m * (high - low) < 2.0 * math.pi:
            continue  # beyond the part of a period that was seen a sine turns back: nobody saw it
        form, options = 'sin(m x), cos(m x)', {'m': m}
        yield _law(form, (q,), 2.5, 'a torque that goes round', 'potential', options)
    for share in _STOPS:
        ends = {'lower': low + share * (high - low), 'upper': high - share * (high - low)}
        yield _law('beyond(x)', (q,), 3.0, 'a spring near the stops', 'potential', ends)
    for displacement in _DISPLACEMENTS:
        options = {'displacement': displacement}
        yield _law('play(x)', (q,), 3.0, 'dry friction with a history', options=options)
        yield _law('dahl(x)', (q,), 3.0, 'dry friction with a history', options=options)


def _shared_laws(joint: str, other: str, at: Extent, *, adds_up: bool) -> Iterator[Law]:
    spring, q = '1, u of u = x - centre', f'angle/{other}'  # it rests anywhere
    centre = {'centre': 0.5 * (at.low[other] + at.high[other])}
    yield _law(spring, (q,), 2.5, 'a spring to another joint', 'coupled', centre)
    for what, form, price, resembles in _OTHER:
        yield _law(form, (f'{what}/{other}',), price, resembles, 'coupled')
    for what, form, price, resembles in (*(_SUMS if adds_up else ()), *_BOTH):
        yield _law(form, (f'{what}/{joint}', f'{what}/{other}'), price, resembles, 'coupled')
    angles = (f'angle/{joint}', f'angle/{other}')
    for m in _PER_TURN[:2]:  # a load turns once or twice with a joint
        for inputs in (angles, angles[::-1]):
            yield _law(_PRODUCT, inputs, 4.0, 'a load on two angles', 'coupled', {'m': m})
    yield _law('x', (f'acceleration/{other}',), 3.5, 'an inertial error', 'inertial')


def _slow_laws(at: Extent) -> Iterator[Law]:
    yield _law('x', ('time',), 2.5, 'a drift', 'clock')
    yield _law('x, x^2', ('time',), 3.0, 'a drift', 'clock')
    for length in _WARM_UP:
        yield _law(
            'exp(-x/scale)', ('time',), 4.0, 'a drift', 'clock', {'scale': length * at.duration}
        )


def _law(
    form: str,
    inputs: tuple[str, ...],
    price: float,
    resembles: str,
    kind: str = 'dissipative',
    options: Mapping[str, float] | None = None,
) -> Law:
    return Law(FORMS[form], inputs, price, resembles, kind, dict(options or {}))
