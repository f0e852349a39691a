r"""A torque that nobody has named: a formula with coefficients learned from data, and a guard.

Outside the range of its data it is not known, and inside it is only a fit: quantities stop at the
ends of the range and a tenth beyond, the torque at a limit, and where it is friction it never
pushes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from ...errors import ConfigurationError
from ...model.machine import machine_of
from ...model.robot import Robot
from ...model.schema import entry, param, parse_number, parse_section
from ...types import Array
from ..joint import STICTION_RATE
from ..motion import Motion
from .formula import FormulaForce, values_of
from .formula_entry import Formula
from .quantities import OF_JOINTS

KINDS = ('dissipative', 'potential', 'coupled', 'gain', 'external')
"""What a law does with energy: takes it, keeps it, moves it between joints, comes with the motor's
torque, or brings it from outside."""

_BEYOND = 0.1  # of the width of a quantity's range
_ROUNDING, _TRIALS = 1e-9, 16


def _ranges(given: Any, place: str) -> dict[str, tuple[float, float]]:
    """Smallest and largest, by quantity."""
    if not isinstance(given, Mapping):
        raise ConfigurationError(place, 'expected {quantity: [smallest, largest]}')
    out = {}
    for name, ends in given.items():
        at = f'{place}.{name}'
        if not isinstance(ends, list | tuple) or len(ends) != 2:
            raise ConfigurationError(at, f'expected two numbers, got {ends!r}')
        low, high = (float(parse_number(end, at)) for end in ends)
        if not low < high:
            raise ConfigurationError(at, f'expected [smallest, largest], got {list(ends)}')
        out[str(name)] = (low, high)
    return out


def _ratios(given: Any, place: str) -> dict[str, float]:
    if not isinstance(given, Mapping) or len(given) > 1:
        raise ConfigurationError(place, 'expected {joint: ratio} of one joint')
    return {str(joint): parse_number(r, f'{place}.{joint}') for joint, r in given.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Guard:
    """What keeps a learned law within its data.

    Args:
        range: Of the data, by quantity of the formula: smallest and largest.
        limit: Largest torque [N m].
        kind: One of `KINDS`.
        react: A joint and r, where it is friction of rate + r rate[joint] that acts on that joint,
            too, with r times its torque.
        machine: On which it was learned, see `machine_of`; empty: nobody says.
    """

    range: Mapping[str, tuple[float, float]] = entry(_ranges)
    limit: float = param(above=0.0)
    kind: str = param(choices=KINDS)
    react: Mapping[str, float] = field(default_factory=dict, metadata={'parse': _ratios})
    machine: str = param('')

    def entry(self) -> dict[str, Any]:
        """As in a robot file."""
        ranges = {name: [low, high] for name, (low, high) in self.range.items()}
        own = {'range': ranges, 'react': dict(self.react)}
        every = {f.name: own.get(f.name, getattr(self, f.name)) for f in fields(self)}
        return {key: value for key, value in every.items() if value}


@dataclass(frozen=True, kw_only=True)
class LearnedTorque(FormulaForce):
    """tau = f(quantities) at a joint, or about an axis of the free base, within a guard.

    Typical: a few percent to all of the torque that a catalogue leaves unexplained.
    Signature: whatever the data had; `depends_on` of the diagnosis says which quantities.
    Source: docs/discovery.md.

    Args:
        formula: Of quantities; its values are coefficients.
        guard: What keeps it within its data.
    """

    id = 'learned_torque'
    title = 'a torque learned from data'
    group = 'learned'
    follows_load = True  # it may
    is_fitted = False  # the catalogue's search is not how it is found

    formula: Formula
    guard: Guard

    @classmethod
    def read(
        cls, name: str, where: str | None, given: Mapping[str, Any], place: str
    ) -> LearnedTorque:
        """From an entry of a robot file."""
        own = {key: value for key, value in given.items() if key != 'guard'}
        formula = Formula.read(cls.id, where, own, place)
        if formula.key != 'torque':
            raise ConfigurationError(f'{place}.{formula.key}', 'a learned law is a torque')
        guard = parse_section(Guard, given.get('guard', {}), f'{place}.guard')
        values = values_of(formula, own, place)
        return law_at(name=name, where=where, values=values, formula=formula, guard=guard)

    def entry(self) -> dict[str, Any]:
        """As in a robot file."""
        formula = {key: value for key, value in self.formula.entry().items() if key != 'law'}
        return {**formula, **self.values, 'guard': self.guard.entry()}

    def check(self, robot: Robot) -> None:
        """Quantities of this robot, units that fit, and a kind that is true of the formula."""
        guard, names = self.guard, set(self.formula.quantities)
        if guard.machine and guard.machine != machine_of(robot.urdf):
            why = (
                'a law that was learned on another robot does not hold here: the joints of this '
                'URDF are others (delete `machine` if not)'
            )
            raise self.refusal(why, 'guard.machine')
        super().check(robot)
        for name in sorted(names ^ set(guard.range)):
            why = 'expected [smallest, largest]' if name in names else 'the formula has no such'
            raise self.refusal(why, f'guard.range.{name}')
        if guard.kind == 'potential' and names != {'position'}:
            raise self.refusal('a potential depends on its own position alone', 'guard.kind')
        if guard.react and not self._is_of_a_sum():
            joint, ratio = self._reacting
            why = f'the formula is no friction of rate + {ratio:g} rate[{joint}]'
            raise self.refusal(why, 'guard.react')

    def _is_of_a_sum(self) -> bool:
        """Whether the law is one of rate + r rate[joint] alone: f(x - r t, y + t) = f(x, y)."""
        (joint, ratio), rng = self._reacting, np.random.default_rng(0)
        other = f'rate[{joint}]'
        if joint == self.where or set(self.formula.quantities) != {'rate', other}:
            return False
        x, y, t = rng.uniform(-STICTION_RATE, STICTION_RATE, (3, _TRIALS))
        before = self.formula({'rate': x, other: y}, self.values)
        after = self.formula({'rate': x - ratio * t, other: y + t}, self.values)
        return bool(np.max(np.abs(after - before)) <= _ROUNDING * np.max(np.abs(before)))

    @property
    def _reacting(self) -> tuple[str, float]:
        return next(iter(self.guard.react.items()))

    @property
    def is_known_ahead(self) -> bool:
        """Whether a controller may feed it forward along a reference."""
        kind = self.guard.kind
        is_own = kind != 'external' and (kind != 'coupled' or bool(self.guard.react))
        return is_own and self.formula.kinds <= set(OF_JOINTS)

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque at its place, and on the joint that reacts."""
        out = super().force(motion, hidden)
        for joint, ratio in self.guard.react.items():
            out += motion.joint_force(joint, ratio * out[:, self._column(motion.robot)])
        return out

    def value(self, motion: Motion, reading: Array | None = None) -> Array:
        """(N,) [N m], saturated and without what friction can not do."""
        limit, rate = self.guard.limit, self._dragged(motion)
        torque = np.clip(super().value(motion, reading), -limit, limit)
        return torque if rate is None else np.where(torque * rate > 0.0, 0.0, torque)

    def _law(self, state: Mapping[str, Array]) -> Array:
        """The formula, its quantities held within their data."""
        ends = self.guard.range
        held = {}
        for name, values in state.items():
            low, high = ends.get(name, (-math.inf, math.inf))
            margin = _BEYOND * (high - low) if name in ends else 0.0
            held[name] = np.clip(values, low - margin, high + margin)
        return super()._law(held)

    def _dragged(self, motion: Motion) -> Array | None:
        """(N,) rate against which it is friction [rad/s]; None where it is none."""
        is_of_both = self.guard.kind == 'coupled' and bool(self.guard.react)
        if self.guard.kind != 'dissipative' and not is_of_both:
            return None
        own = motion.qd[:, motion.column(self.where)]
        others = (r * motion.qd[:, motion.column(k)] for k, r in self.guard.react.items())
        return np.asarray(sum(others, own))

    def fastest(self, robot: Robot) -> float:
        """Decay rate and natural frequency where the law is steepest; of both joints at most."""
        return super().fastest(robot) * (4.0 if self.guard.react else 1.0)

    def _trials(self) -> dict[str, Array]:
        """Both ends of the data, and their middle."""
        shares = np.array([0.0, 0.5, 1.0])
        return {n: low + shares * (high - low) for n, (low, high) in self.guard.range.items()}


class LearnedBaseTorque(LearnedTorque):
    """A torque about an axis of the free base, from outside."""

    is_external = True

    def check(self, robot: Robot) -> None:
        """No friction: a base has nothing to rub on."""
        super().check(robot)
        if self.guard.kind != 'external':
            raise self.refusal('a torque on the base is external', 'guard.kind')


def law_at(*, where: str | None, formula: Formula, **entries: Any) -> LearnedTorque:
    """The law of the class that its place asks for; see `LearnedTorque`."""
    kind = LearnedTorque if formula.is_at_joint else LearnedBaseTorque
    return kind(where=where, formula=formula, **entries)
