"""Effects that a robot file writes as formulas: a torque, a force, or what a sensor reads.

Each formula is a kind of effect of its own, as those of the catalogue are: the same object is
simulated, fed forward, fitted, and looked for at every place where its units fit.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from ...errors import ConfigurationError
from ...model.robot import Robot
from ...model.schema import parse_number
from ...types import Array
from ..effect import Effect
from ..motion import Motion, mobility
from ..parameter import Parameter
from ..sensors.sensor_errors import SensorFault
from .formula_entry import Formula
from .quantities import AXES, OF_JOINTS, READING, base_axes, is_axis, parts, quantity_along

_RATES = np.concatenate([[0.0], np.geomspace(1e-4, 10.0, 26)])  # rad/s
_ANGLES = np.linspace(-np.pi, np.pi, len(_RATES))
_STEP = 1e-6  # rad/s or rad, of its derivatives


class FormulaEffect(Effect):
    """tau = f(position, rate, effort, time), or reading = truth + f, f written in the robot file.

    Typical: what its author says of it.
    Signature: whatever the formula says.
    Source: docs/effects.md, section formula.
    """

    id = 'formula'
    group = 'own'
    title = 'an effect written as a formula'
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    is_fitted = False  # each formula is a kind of its own, which is

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Every manipulator joint, and the axes of a free base."""
        return (*robot.arm, *base_axes(robot))

    @classmethod
    def read(cls, name: str, where: str | None, given: Mapping[str, Any], place: str) -> Effect:
        """From an entry of a robot file."""
        formula = Formula.read(name, where, given, place)
        values = values_of(formula, given, place)
        return _made(formula)(name=name, where=where, values=values)


def values_of(formula: Formula, given: Mapping[str, Any], place: str) -> dict[str, float]:
    """Of a formula's parameters in an entry of a robot file; those left out do nothing."""
    known = {p.name: p for p in formula.parameters}
    values = {key: p.nominal for key, p in known.items()}
    for key, value in Formula.values(given).items():
        at = f'{place}.{key}'
        if key not in known:
            has = ', '.join(known) or 'none'
            raise ConfigurationError(at, f'no such parameter (it has {has})')
        values[key] = parse_number(value, at)
        known[key].check(values[key], at, known[key].unit)
    return values


class WrittenFormula(FormulaEffect):
    """One formula of a robot file."""

    formula: Formula

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Joints, or axes, where its units fit; all where each of its kind has another formula."""
        if not hasattr(cls, 'formula'):
            return super().places(robot)
        places = robot.arm if cls.formula.is_at_joint else base_axes(robot)
        return tuple(place for place in places if cls._fits(robot, place))

    @classmethod
    def _fits(cls, robot: Robot, place: str) -> bool:
        try:
            cls.formula.check_robot(robot, place, '')
        except ConfigurationError:
            return False
        return True

    def entry(self) -> dict[str, Any]:
        """As in a robot file; `effect` says that it is a formula."""
        return {'effect': FormulaEffect.id, **self.formula.entry(), **self.values}

    def check(self, robot: Robot) -> None:
        """Quantities of this robot, units that fit, and finite values at rest and elsewhere."""
        law = self.formula
        law.check_robot(robot, self.where, f'effects.{self.name}.{law.key}')
        for is_random in (False, True):
            self._evaluated(law.states(is_random))

    def value(self, motion: Motion, reading: Array | None = None) -> Array:
        """(N,) of the formula at its place along a motion."""
        state = {
            name: self._quantity(what, whose, motion, reading)
            for name, what, whose in self.formula.sources
        }
        return np.broadcast_to(self._evaluated(state), motion.time.shape)

    def _evaluated(self, state: Mapping[str, Array]) -> Array:
        """The formula, refused where it is not finite."""
        out = self._law(state)
        if not np.isfinite(out).all():
            bad = np.flatnonzero(~np.isfinite(out))
            at = ', '.join(f'{name} {np.ravel(x)[bad[0]]:g}' for name, x in state.items())
            why = f'is not finite at {at or "any state"}: does it divide by zero?'
            raise self.refusal(f'{self.formula.text!r} {why}', self.formula.key)
        return out

    def _law(self, state: Mapping[str, Array]) -> Array:
        """The formula at some states."""
        return self.formula(state, self.values)

    def _quantity(self, what: str, whose: str, motion: Motion, reading: Array | None) -> Array:
        if what == 'extra':
            return self._extra(whose, motion)
        if what == READING and reading is not None:
            return reading
        return np.asarray(quantity_along(what, whose or str(self.where), motion))

    def _extra(self, name: str, motion: Motion) -> Array:
        """What else was measured, as there; its typical value where it was not."""
        declared, inputs = dict(self.formula.extra)[name], motion.robot.inputs
        signal = inputs.extra.get(name) if inputs else None
        if signal is None and declared.typical is None:
            why = f'nobody measures extra[{name}] here: give its typical value'
            raise self.refusal(why, f'extra.{name}')
        if signal is None:
            return np.full(len(motion), declared.typical)
        if declared.unit not in ('', signal.unit):
            why = f'is in {declared.unit!r} here and in {signal.unit!r} in the mapping'
            raise self.refusal(why, f'extra.{name}.unit')
        return motion.extra[name]


class FormulaForce(WrittenFormula):
    """A formula that is a torque on its joint; or on the base about, or a force along, an axis.

    What acts on the base comes from outside.
    """

    @property
    def is_known_ahead(self) -> bool:
        """Whether its quantities follow from a motion that is planned."""
        return not self.is_external and self.formula.kinds <= {*OF_JOINTS, 'base_rate'}

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque or force at its place."""
        out = motion.zeros()
        out[:, self._column(motion.robot)] = self.value(motion)
        return out

    def fastest(self, robot: Robot) -> float:
        """Rate at which it settles by what it makes of rates, or swings by its stiffness."""
        law, easy = self.formula, mobility(robot, self._column(robot))
        slopes = {'rate': 0.0, 'position': 0.0}
        for name in law.quantities:
            what = parts(name)[0]
            kind = {'rate': 'rate', 'base_rate': 'rate'}.get(what, 'position')
            if what in ('rate', 'base_rate', 'position', 'attitude'):
                grid = _RATES if kind == 'rate' else _ANGLES
                slopes[kind] = max(slopes[kind], self._slope(name, grid))
        return max(slopes['rate'] * easy, float(np.sqrt(slopes['position'] * easy)))

    def _slope(self, name: str, grid: Array) -> float:
        """Steepest slope by a quantity, the others at rest or anywhere."""
        others = self._trials()
        state = {n: np.repeat(x, len(grid)) for n, x in others.items()}
        at = np.tile(grid, len(others[name]))
        ends = [self._law({**state, name: at + side}) for side in (-_STEP, _STEP)]
        slope = np.abs(ends[1] - ends[0]) / (2.0 * _STEP)
        return float(np.max(slope[np.isfinite(slope)], initial=0.0))

    def _trials(self) -> dict[str, Array]:
        """States at which slopes are asked: at rest, and random ones."""
        rest, others = (self.formula.states(is_random) for is_random in (False, True))
        return {name: np.concatenate([rest[name], others[name]]) for name in rest}

    def _column(self, robot: Robot) -> int:
        """Its component of a generalized force."""
        law = self.formula
        if law.is_at_joint:
            return 6 + robot.joints.index(str(self.where))
        return (0 if law.key == 'force' else 3) + AXES.index(str(self.where)[-1])


class FormulaReading(WrittenFormula, SensorFault):
    """A formula that is added to what a sensor says of its joint, or about its axis."""

    group = 'sensor'

    def faulty(self, value: Array, motion: Motion) -> Array:
        """The column of its channel changed."""
        where, out = str(self.where), np.array(value)
        column = AXES.index(where[-1]) if is_axis(where) else motion.column(where)
        out[:, column] += self.value(motion, out[:, column])
        return out


@lru_cache(maxsize=256)  # one formula is one kind, however often it is read
def _made(formula: Formula) -> type[WrittenFormula]:
    """The kind of effect that a formula is."""
    content = {
        'id': f'{FormulaEffect.id}_{formula.law}',
        'title': formula.title,
        'parameters': formula.parameters,
        'is_fitted': bool(formula.parameters),
        'is_own': True,
        'is_timed': 'time' in formula.kinds,
        'needs_free_base': not formula.is_at_joint,
        'is_external': not (formula.is_at_joint or formula.channel),
        'formula': formula,
        'channel': formula.channel,
        '__doc__': f'{formula.text}, by the robot file.',
    }
    base = FormulaReading if formula.channel else FormulaForce
    return type(f'Formula_{formula.law}', (base,), content)
