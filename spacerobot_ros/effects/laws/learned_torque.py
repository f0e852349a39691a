r"""A torque that nobody has named: a form of the grammar with coefficients learned from data.

    tau = sum_k c_k f_k(x, y)

Outside the range of its data it is not known, and inside it is only a fit: inputs stop at the ends
of the range and a tenth beyond, the torque at a limit, and where it is friction it never pushes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...model.machine import machine_of
from ...model.robot import Robot
from ...types import Array
from ..effect import Effect
from ..joint import STICTION_RATE
from ..motion import Motion, mobility
from .grammar import DAHL, QUANTITIES, Form, quantity
from .hysteresis import fastest_share, followed, share_rate
from .law_inputs import AXES, base_axes, is_component, quantity_along
from .learned_entry import LearnedEntry
from .table_form import TableForm

KINDS = ('dissipative', 'potential', 'coupled', 'gain', 'external')
"""What a law does with energy: takes it, keeps it, moves it between joints, comes with the motor's
torque, or brings it from outside."""

_BEYOND = 0.1  # of the width of an input's range
_OWN = (
    *('effect', 'where', 'form', 'inputs', 'coefficients'),
    *('range', 'limit', 'kind', 'react', 'machine'),
)
_ELSEWHERE = 'a law that was learned on another robot does not hold here'


@dataclass(frozen=True, kw_only=True)
class LearnedTorque(Effect):
    """tau = sum of c_k f_k(inputs) at a joint, or about an axis of the free base.

    Typical: a few percent to all of the torque that a catalogue leaves unexplained.
    Signature: whatever the data had; `depends_on` of the diagnosis says which inputs.
    Source: docs/discovery.md.

    Args:
        form: Function of the inputs.
        inputs: Their names, such as `rate/joint_2`.
        coefficients: One a column of the form.
        range: Of the data, by input: smallest and largest.
        limit: Largest torque [N m].
        kind: One of `KINDS`.
        react: The joint that the same friction of a sum of rates acts on, too; empty: none.
        options: What the form is not linear in.
        machine: On which it was learned, see `machine_of`; empty: nobody says.
    """

    id = 'learned_torque'
    title = 'a torque learned from data'
    group = 'learned'
    parameters = ()
    follows_load = True  # it may
    is_fitted = False  # the catalogue's search is not how it is found

    form: Form | TableForm
    inputs: tuple[str, ...]
    coefficients: tuple[float, ...]
    range: Mapping[str, tuple[float, float]]
    limit: float
    kind: str
    react: str = ''
    options: Mapping[str, float] = field(default_factory=dict)
    machine: str = ''

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Every manipulator joint, and the axes of a free base."""
        return (*robot.arm, *base_axes(robot))

    @classmethod
    def read(
        cls, name: str, where: str | None, given: Mapping[str, Any], place: str
    ) -> LearnedTorque:
        """From an entry of a robot file."""
        entry = LearnedEntry(given, place)
        form = entry.form()
        out: dict[str, Any] = {
            'name': name,
            'where': where,
            'values': {},
            'form': form,
            'inputs': entry.texts('inputs'),
            'coefficients': entry.numbers('coefficients') if isinstance(form, Form) else (1.0,),
            'range': entry.ranges(),
            'limit': entry.number('limit'),
            'kind': str(given.get('kind', '')),
            'react': entry.one('react'),
            'options': {option: entry.number(option) for option in form.parameters},
            'machine': str(given.get('machine', '')),
        }
        entry.refuse_others((*_OWN, *form.parameters, *form.keys))
        return law_at(**out)

    def entry(self) -> dict[str, Any]:
        """As in a robot file."""
        ranges = {key: [float(low), float(high)] for key, (low, high) in self.range.items()}
        coefficients = [float(c) for c in self.coefficients]
        return {
            **self.form.entry(),
            'inputs': list(self.inputs),
            **({'coefficients': coefficients} if isinstance(self.form, Form) else {}),
            **{name: float(value) for name, value in self.options.items()},
            'range': ranges,
            'limit': float(self.limit),
            'kind': self.kind,
            **({'react': [self.react]} if self.react else {}),
            **({'machine': self.machine} if self.machine else {}),
        }

    def check(self, robot: Robot) -> None:
        """Inputs of this robot, numbers that fit the form, friction that does not push."""
        if self.machine and self.machine != machine_of(robot.urdf):
            why = f'{_ELSEWHERE}: the joints of this URDF are others (delete `machine` if not)'
            raise self.refusal(why, 'machine')
        if self.kind not in KINDS:
            raise self.refusal(f'expected one of {", ".join(KINDS)}, got {self.kind!r}', 'kind')
        if len(self.inputs) != self.form.inputs:
            why = f'{self.form.name!r} takes {self.form.inputs}, got {len(self.inputs)}'
            raise self.refusal(why, 'inputs')
        for name in self.inputs:
            self._check_input(name, robot)
        if isinstance(self.form, Form) and len(self.coefficients) != len(self.form.powers):
            why = f'{self.form.name!r} takes {len(self.form.powers)}, got {len(self.coefficients)}'
            raise self.refusal(why, 'coefficients')
        if not 0.0 < self.limit < math.inf:
            raise self.refusal(f'{self.limit:g} N m must be above 0', 'limit')
        if self.form.has_history and self.coefficients[0] > 0.0:
            raise self.refusal('friction that pushes: must be at most 0', 'coefficients')
        for option, value in self.options.items():
            if option in ('displacement', 'scale') and value <= 0.0:
                raise self.refusal(f'{value:g} must be above 0', option)
        self._check_kind()

    def _check_kind(self) -> None:
        """What a kind says of energy holds of some inputs alone."""
        own, angle = f'rate/{self.where}', f'angle/{self.where}'
        if self.form.has_history and self.inputs != (angle,):
            why = f'a history is of the angle of its own joint: expected [{angle}]'
            raise self.refusal(why, 'inputs')
        if self.kind == 'potential' and set(self.inputs) != {angle}:
            raise self.refusal(f'a potential depends on {angle} alone', 'inputs')
        both = {own, f'rate/{self.react}'}
        if self.react and (not self.form.ratio or set(self.inputs) != both or len(both) < 2):
            why = f'{self.react!r} is no joint whose rate {self.form.name!r} adds to {own}'
            raise self.refusal(why, 'react')
        if stray := next((name for name in self.range if name not in self.inputs), ''):
            raise self.refusal('no input is called so', f'range.{stray}')

    def _check_input(self, name: str, robot: Robot) -> None:
        what, whose = quantity(name)
        if what not in (*QUANTITIES, 'extra'):
            known = ', '.join((*QUANTITIES, 'extra'))
            raise self.refusal(f'{name!r}: no such quantity (known: {known})', 'inputs')
        if what in ('rate', 'angle', 'load', 'acceleration') and whose not in robot.arm:
            raise self.refusal(f'{name!r}: this robot has no such joint; {_ELSEWHERE}', 'inputs')
        if what in ('attitude', 'base_rate') and not robot.is_free:
            raise self.refusal(f'{name!r}: the base is fixed; {_ELSEWHERE}', 'inputs')
        if not is_component(what, whose):
            raise self.refusal(f'{name!r}: no such component', 'inputs')
        low, high = self.range.get(name, (math.nan, math.nan))
        if not low < high:
            why = 'expected [smallest, largest] of every input'
            raise self.refusal(why, f'range.{name}')

    @property
    def is_known_ahead(self) -> bool:
        """Whether a controller may feed it forward along a reference."""
        quantities = {quantity(name)[0] for name in self.inputs}
        is_own = self.kind != 'external' and (self.kind != 'coupled' or bool(self.react))
        return is_own and quantities <= {'rate', 'angle', 'load'}

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque at its place, and on the joint that reacts."""
        torque = self.torque(motion, hidden)
        out = motion.joint_force(self.where, torque)
        if self.react:
            out += motion.joint_force(self.react, self.form.ratio * torque)
        return out

    def torque(self, motion: Motion, hidden: Array) -> Array:
        """(N,) [N m], saturated and without what friction can not do."""
        columns = self.form(list(self._clipped(motion)), self.options)
        raw = columns @ np.array(self.coefficients)
        torque = np.clip(raw, -self.limit, self.limit)
        rate = self._dragged(motion)
        return torque if rate is None else np.where(torque * rate > 0.0, 0.0, torque)

    @cached_property
    def _sources(self) -> tuple[tuple[str, str], ...]:
        return tuple(quantity(name) for name in self.inputs)

    @cached_property
    def _bounds(self) -> tuple[Array, Array]:
        """(K, 1) each: what inputs are taken for beyond the range of their data."""
        low, high = np.array([self.range[name] for name in self.inputs], dtype=float).T[..., None]
        margin = _BEYOND * (high - low)
        return low - margin, high + margin

    def _clipped(self, motion: Motion) -> Array:
        """(K, N) inputs; of one that nobody measures here the middle of its data."""
        low, high = self._bounds
        given = np.empty((len(low), len(motion)))
        for k, source in enumerate(self._sources):
            known = quantity_along(*source, motion)
            given[k] = 0.5 * (low[k] + high[k]) if known is None else known
        return np.minimum(np.maximum(given, low), high)

    def _dragged(self, motion: Motion) -> Array | None:
        """(N,) rate against which it is friction [rad/s]; None where it is none."""
        if self.kind == 'dissipative':
            return motion.qd[:, motion.column(self.where)]
        if self.kind == 'coupled' and self.react:
            own, other = (motion.qd[:, motion.column(j)] for j in (self.where, self.react))
            return np.asarray(own + self.form.ratio * other)
        return None

    def fastest(self, robot: Robot) -> float:
        """Decay rate and natural frequency where the law is steepest."""
        easy = self._mobility(robot) * (4.0 if self.react else 1.0)  # both joints at once, at most
        steepest = {'rate': 0.0, 'angle': 0.0}
        for name in self.inputs:
            what = quantity(name)[0]
            if what in steepest:
                steepest[what] = max(steepest[what], self._slope(name))
        return max(steepest['rate'] * easy, math.sqrt(steepest['angle'] * easy))

    def _mobility(self, robot: Robot) -> float:
        return mobility(robot, 6 + robot.joints.index(str(self.where)))

    def _slope(self, name: str) -> float:
        """Steepest slope by an input, the others at their ends and in the middle."""
        low, high = self.range[name]
        fine = np.linspace(-5.0 * STICTION_RATE, 5.0 * STICTION_RATE, 101)
        inside = np.sort(np.concatenate([np.linspace(low, high, 401), fine]))
        steepest = 0.0
        for share in (0.0, 0.5, 1.0):
            inputs = [
                inside if other == name else np.full(len(inside), (1.0 - share) * a + share * b)
                for other, (a, b) in ((n, self.range[n]) for n in self.inputs)
            ]
            torque = self.form(inputs, self.options) @ np.array(self.coefficients)
            slopes = np.abs(np.diff(torque)) / np.maximum(np.diff(inside), 1e-12)
            steepest = max(steepest, float(np.max(slopes)))
        return steepest

    def of(self, coefficients: Sequence[float], limit: float | None = None) -> LearnedTorque:
        """The same law with other numbers."""
        size = self.limit if limit is None else limit
        return replace(self, coefficients=tuple(float(c) for c in coefficients), limit=size)


@dataclass(frozen=True, kw_only=True)
class LearnedHysteresis(LearnedTorque):
    """Friction with a history: its state is limited, it gives back no more than it took."""

    hidden = 1
    is_known_ahead = True

    def torque(self, motion: Motion, hidden: Array) -> Array:
        """The mobilised share of the torque."""
        size = min(abs(self.coefficients[0]), self.limit)
        return -size * np.clip(hidden[:, 0], -1.0, 1.0)

    def hidden_rate(self, motion: Motion, hidden: Array) -> Array:
        """Of the share."""
        rate = motion.qd[:, [motion.column(self.where)]]
        is_dahl = self.form.name == DAHL
        return share_rate(rate, hidden, self.options['displacement'], is_dahl=is_dahl)

    def driven(self, motion: Motion) -> Array:
        """Share along the joint's angles, exactly."""
        return self.form([motion.q[:, motion.column(self.where)]], self.options)

    def followed(self, robot: Robot, own: Array, before: Array, after: Array) -> Array:
        """The share at the end of the way."""
        column, displacement = robot.joints.index(str(self.where)), self.options['displacement']
        way = np.array([before[column], after[column]])
        is_dahl = self.form.name == DAHL
        return np.array([followed(way, displacement, is_dahl=is_dahl, start=own[0])[-1]])

    def fastest(self, robot: Robot) -> float:
        """Of the joint on its contacts, or of contacts that begin to slide."""
        displacement = self.options['displacement']
        swing = math.sqrt(abs(self.coefficients[0]) * self._mobility(robot) / displacement)
        return max(swing, fastest_share(displacement))


@dataclass(frozen=True, kw_only=True)
class LearnedBaseTorque(LearnedTorque):
    """A torque about an axis of the free base, from outside."""

    is_external = True

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque on the base."""
        out = motion.zeros()
        out[:, 3 + AXES.index(str(self.where)[-1])] = self.torque(motion, hidden)
        return out

    def check(self, robot: Robot) -> None:
        """No friction: a base has nothing to rub on."""
        super().check(robot)
        if self.kind != 'external':
            raise self.refusal(f'a torque on the base is external, got {self.kind!r}', 'kind')

    def fastest(self, robot: Robot) -> float:
        """Slow: it follows attitude and time."""
        return 0.0


def law_at(*, where: str | None, form: Form | TableForm, **entries: Any) -> LearnedTorque:
    """The law of the class that its place and form ask for; see `LearnedTorque`."""
    kind: type[LearnedTorque] = LearnedHysteresis if form.has_history else LearnedTorque
    if where is not None and '/' in where:
        kind = LearnedBaseTorque
    return kind(where=where, form=form, **entries)
