"""Which laws a leftover may follow: forms of the grammar with inputs, and how rare each is.

A law's price is the negative logarithm of its rarity [nats], as people who build such machines see
it: what every joint has costs nothing, what needs another joint's variable 2.5, a clock 2.5 and
more. The evidence must pay it beside the price of the coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...effects.laws.grammar import FORMS, Form
from ...types import Array

_PER_TURN = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0)
_BENDS = (0.03, 0.1, 0.3)  # of the 95 % rate
_WARM_UP = (0.1, 0.3, 1.0)  # of the record's length
_STOPS = (0.1, 0.2, 0.3)  # of the range, at either end
_SWEEPS = (0.0, 4.0, -4.0, 8.0, -8.0, 16.0, -16.0, 32.0, -32.0)  # of sines of the time, 1/T^2
_LOWEST, _HIGHEST = 0.05, 2.0  # Hz, of sines of the time: up to half the band
_SPACING = 0.5
"""Of the resolution 1/T: between two of them a sine keeps 81 % of its square. With 0.75 (63 %) 5
of 16 slow sweeps were functions of nothing that is measured, now 1 is."""
_PRODUCT = 'sin(m*y), cos(m*y), x*sin(m*y), x*cos(m*y)'
"""A product of functions of two angles, as loads on two joints are, where x turns little."""
_STOP = 'min(x, lower) - lower, max(x, upper) - upper'
_MOST = 1500  # sines of the time: longer records sweep less, then have the low frequencies alone
REFINED = ('scale',)
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

    def options(self, guess: str, joint: str) -> list[dict[str, float]]:
        """Guesses of what forms are not linear in; of a sine where a whole period was seen.

        Beyond a part of one it turns back, where a polynomial goes on.
        """
        low, high = self.low.get(joint, 0.0), self.high.get(joint, 0.0)
        turns = [{'m': m} for m in _PER_TURN]
        match guess:
            case 'bends':
                return [{'scale': share * self.fast[joint]} for share in _BENDS]
            case 'lengths':
                return [{'scale': length * self.duration} for length in _WARM_UP]
            case 'centre':
                return [{'centre': 0.5 * (low + high)}]
            case 'stops':
                ends = [share * (high - low) for share in _STOPS]
                return [{'lower': low + end, 'upper': high - end} for end in ends]
            case 'whole turns':
                return [t for t in turns if t['m'] * (high - low) >= 2.0 * math.pi]
        return turns[:2] if guess == 'two turns' else turns


_LAWS = {
    'dissipative': (
        ('v', 'x', 0.0, 'viscous friction'),
        ('v', 'sign(x)', 1.0, 'Coulomb friction'),
        ('v', 'sign(x), x', 1.0, 'Coulomb and viscous friction'),
        ('v', 'x*abs(x)', 1.5, 'drag'),
        ('v', 'sign(x)*sqrt(abs(x))', 2.0, 'friction that grows ever less with the rate'),
        ('v', 'sign(x), x, abs(x)', 2.0, 'friction that differs between directions'),
        ('v', 'x**3', 2.5, 'friction that grows ever more with the rate'),
        ('v', 'sign(x)*exp(-(x/scale)**2)', 2.5, 'Stribeck friction', 'bends'),
        ('vq', 'sign(x), y*sign(x), y**2*sign(x)', 3.0, 'friction that changes with the angle'),
        ('vq', 'x, x*y, x*y**2', 3.5, 'viscous friction that changes with the angle'),
        (
            *('vq', 'sign(x), sin(m*y)*sign(x), cos(m*y)*sign(x)', 3.0),
            *('friction that changes with the angle', 'turns'),
        ),
        (
            *('vq', 'x, x*sin(m*y), x*cos(m*y)', 3.5),
            *('viscous friction that changes with the angle', 'turns'),
        ),
        ('vT', 'abs(y)*sign(x)', 2.0, 'friction in proportion to the load'),
        ('vT', 'y**2*sign(x)', 3.0, 'friction that grows with the load'),
        ('vt', 'x, x*exp(-y/scale)', 3.5, 'friction that warms up', 'lengths'),
        ('ve', 'x, x*y', 3.0, 'viscous friction that changes with what is measured'),
        ('ve', 'sign(x), y*sign(x)', 3.0, 'Coulomb friction that changes with what is measured'),
    ),
    'gain': (
        ('vT', 'y*abs(x)', 3.0, 'a gain that changes with the rate'),
        ('T', 'x*abs(x)', 3.5, 'a gain that changes with the load'),
    ),
    'potential': (
        ('q', '1, x - centre', 1.5, 'a spring', 'centre'),
        ('q', '1, x - centre, (x - centre)**2, (x - centre)**3', 1.5, 'a spring', 'centre'),
        ('q', 'sin(m*x), cos(m*x)', 2.5, 'a torque that goes round', 'whole turns'),
        ('q', _STOP, 3.0, 'a spring near the stops', 'stops'),
    ),
    'coupled': (
        ('p', '1, x - centre', 2.5, 'a spring to another joint', 'centre'),
        ('w', 'x', 2.5, 'friction of another joint'),
        ('w', 'sign(x)', 2.5, 'friction of another joint'),
        ('w', 'sign(x), x', 3.0, 'friction of another joint'),
        ('vw', 'sign(x + y)', 3.0, 'friction of a coupled wrist'),
        ('vw', 'sign(x + y), x + y', 3.0, 'friction of a coupled wrist'),
        ('vw', 'sign(x - y)', 3.0, 'friction of a coupled wrist'),
        ('vw', 'sign(x - y), x - y', 3.0, 'friction of a coupled wrist'),
        ('qp', 'sin(x + y), cos(x + y)', 3.0, 'a load on two angles'),
        ('qp', 'sin(x - y), cos(x - y)', 3.0, 'a load on two angles'),
        ('vw', 'x*y', 3.5, 'a torque of two rates'),
        ('vw', 'x, y', 4.0, 'viscous friction of two joints'),
        ('vw', 'sign(x), y', 4.0, 'friction of two joints'),
        ('qp', _PRODUCT, 4.0, 'a load on two angles', 'two turns'),
        ('pq', _PRODUCT, 4.0, 'a load on two angles', 'two turns'),
    ),
    'external': (
        ('e', 'x', 2.5, 'what is measured'),
        ('e', 'x, x**2', 3.0, 'what is measured'),
    ),
    'inertial': (('a', 'x', 2.0, 'an inertial error'), ('b', 'x', 3.5, 'an inertial error')),
    'clock': (
        ('t', 'x', 2.5, 'a drift'),
        ('t', 'x, x**2', 3.0, 'a drift'),
        ('t', 'exp(-x/scale)', 4.0, 'a drift', 'lengths'),
    ),
}
"""By kind: inputs, form, price, class, and what its options are guessed by.

Rate v, angle q, load T and acceleration a of the joint, w, p and b of another, time t, and e, what
else is measured."""
_QUANTITIES = {'v': 'rate', 'w': 'rate', 'q': 'angle', 'p': 'angle', 'T': 'load'}
_QUANTITIES |= {'a': 'acceleration', 'b': 'acceleration', 'e': 'extra'}


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
    out = []
    for kind, rows in _LAWS.items():
        for letters, name, price, resembles, *guess in rows:
            others = [''] if set(letters).isdisjoint('wpb') else [k for k in joints if k != joint]
            if 'x + y' in name or 'x - y' in name:
                others = [k for k in others if joints[k] == joints[joint]]
            for other in others:
                for extra in extras if 'e' in letters else ('',):
                    whose = dict.fromkeys('wpb', other) | {'e': extra}
                    inputs = tuple(
                        'time' if x == 't' else f'{_QUANTITIES[x]}/{whose.get(x, joint)}'
                        for x in letters
                    )
                    options = at.options(guess[0], inputs[0].partition('/')[2]) if guess else [{}]
                    out += [Law(FORMS[name], inputs, price, resembles, kind, o) for o in options]
    return out


def time_sines(duration: float) -> list[Law]:
    """The rival of every law: sines and cosines of w t + s t^2, by their number.

    Args:
        duration: T of the record [s].
    """
    frequencies = np.arange(_LOWEST, _HIGHEST, _SPACING / duration)[:_MOST].tolist()
    count = max(1, min(len(_SWEEPS), _MOST // max(len(frequencies), 1)))
    options = [
        {'w': 2.0 * math.pi * f, 's': math.pi * c / duration**2}
        for f in frequencies
        for c in _SWEEPS[:count]
    ]
    price = math.log(max(len(options), 1))
    return [Law(_SWEEP, ('time',), price, 'a sine of the time', 'clock', o) for o in options]


_SWEEP = Form('sin(w*x + s*x**2), cos(w*x + s*x**2)', ((0,), (0,)), {'w': (-1,), 's': (-2,)})
