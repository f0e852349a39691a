"""What a physical effect is: an id, its places, its parameters, and what it does.

An effect acts in one or several of these ways, and each action is written once:

- `change`: the robot has other bodies or wheels than the file says;
- `force`: a generalised force that depends on the motion, and on hidden states where it has any;
- `sense`: a sensor says something else;
- `delay`: a sensor's stamps are late.

The simulator applies the actions exactly; the diagnosis differentiates the same actions by the
parameters and asks whether the data want them (`diagnosis/`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import ConfigurationError
from ..model.robot import Robot
from ..types import Array
from .hidden import driven_states
from .motion import Motion

_HEAVY = 100.0  # kg, of all that moves

Values = Mapping[str, float]
"""Parameter values by name."""

CHANNELS = ('joint_position', 'joint_velocity', 'joint_effort', 'gyro', 'attitude')
"""Sensor channels. Attitude values are small rotations of the true attitude on the base's side."""

CLOCKS = ('joints', 'effort', 'imu', 'attitude')
"""What can be late: all of /joint_states, its effort alone, the gyro, the star tracker."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One number of an effect.

    Args:
        name: Name in robot files and results.
        unit: SI unit; empty for a pure number.
        doc: One sentence.
        nominal: Value at which the effect does nothing, as far as this parameter decides that.
        default: Value where a robot file is silent; None where it must be given.
        minimum: Smallest physical value. above: Exclusive lower bound. maximum: Largest one.
        size: Plausible magnitude in space practice: the standard deviation of the fit's prior.
        relevant: Smallest magnitude worth naming, about `nominal`.
        role: How the action depends on it about `nominal`. `linear`: in proportion. `phase`: with
            the linear parameter before it a pair amplitude and phase [rad], amplitude *
            sin(... + phase). `reciprocal`: in proportion to its inverse, nothing at infinity.
            `square`: in proportion to its square. `search`: in any other way; the fit starts from
            every value of `grid`. Size and threshold are those of what the action is in proportion
            to: of the inverse, or of the square.
        grid: First guesses where the role is `search`.
    """

    name: str
    unit: str
    doc: str
    nominal: float = 0.0
    default: float | None = None
    minimum: float = -math.inf
    above: float = -math.inf
    maximum: float = math.inf
    size: float = math.inf
    relevant: float = 0.0
    role: str = 'linear'
    grid: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Effect:
    """An entry of the catalogue; subclasses override what they act on.

    Args:
        id: Name in robot files and results; never renamed.
        title: What it is, in words.
        group: joint, sensor, wheels, bodies or environment.
        parameters: In the order of results.
        needs_free_base: Whether a fixed base shows nothing of it.
        magnitude: What typical values are in space practice.
        signature: What it looks like in the data.
        source: Where its equations come from.
        hidden: Number of its own states.
        is_external: Whether its force comes from outside the system, so that it changes the
            system's momentum; the force of any other effect takes from one part what it gives to
            another, `momentum` included.
        is_timed: Whether its force depends on the time since the start, which only the simulator
            and a record know.
        excludes: Ids of what can not act at the same place beside it, its own id among them where
            two of it would contradict each other.
        is_fitted: Whether the diagnosis considers it; False for what a record can not tell from
            another effect of the catalogue.
    """

    id: str
    title: str
    group: str
    parameters: tuple[Parameter, ...]
    needs_free_base: bool = False
    magnitude: str = ''
    signature: str = ''
    source: str = ''
    hidden: int = field(default=0)
    is_external: bool = False
    is_timed: bool = False
    excludes: tuple[str, ...] = ()
    is_fitted: bool = True

    def places(self, robot: Robot) -> tuple[str | None, ...]:
        """Where it can act on a robot: joints, links, or (None,) for the system as a whole."""
        return (None,)

    def variants(self, robot: Robot, where: str | None) -> tuple[dict[str, float], ...]:
        """First guesses of the `search` parameters: every combination of their grids."""
        searched = [p for p in self.parameters if p.role == 'search']
        guesses = itertools.product(*(p.grid for p in searched))
        names = [p.name for p in searched]
        return tuple(dict(zip(names, guess, strict=True)) for guess in guesses)

    def parameters_at(self, robot: Robot, where: str | None) -> tuple[Parameter, ...]:
        """Its parameters with sizes and thresholds that fit the robot.

        Thresholds of forces, torques and masses are those of robots of `_HEAVY` and more; for a
        lighter one they are lower in proportion.
        """
        first = 0 if robot.is_free else 1
        share = float(np.sum(robot.inertial_parameters[first:, 0])) / _HEAVY
        if share >= 1.0:
            return self.parameters
        return tuple(
            replace(p, relevant=share * p.relevant) if _grows_with_mass(p) else p
            for p in self.parameters
        )

    def canonical(self, values: Values) -> Values:
        """The same effect with values in their usual form, such as an axis of unit length."""
        return values

    @property
    def nominal(self) -> dict[str, float]:
        """Parameter values that stand for no effect."""
        return {p.name: p.nominal for p in self.parameters}

    def check(self, robot: Robot, where: str | None, values: Values, place: str) -> None:
        """Refuse values that contradict each other or the robot.

        Bounds of single parameters are checked before.

        Raises:
            ConfigurationError: with the place in the file.
        """

    def change(self, robot: Robot, where: str | None, values: Values) -> Robot:
        """The robot as the effect makes it."""
        return robot

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """(N, 6 + n) generalised force [N, N m].

        Args:
            motion: N states.
            where: Its place.
            values: Its parameters.
            hidden: (N, hidden) its own states.
        """
        return motion.zeros()

    def hidden_rate(
        self, motion: Motion, where: str | None, values: Values, hidden: Array
    ) -> Array:
        """(N, hidden) time derivative of its own states; `motion.acceleration` is known."""
        return hidden

    def momentum(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """(N, 6) momentum that the effect itself holds, beyond the robot's bodies and wheels.

        Returns:
            [linear (N s); angular about the base origin (N m s)] in base coordinates. Its rate in
            the inertial frame is the opposite of what `force` does to the whole.
        """
        return np.zeros((len(motion), 6))

    def driven(self, motion: Motion, where: str | None, values: Values) -> Array:
        """(N, hidden) own states along a given motion that began at rest, for the diagnosis.

        Here the rate is taken to be affine in them; `motion.acceleration` is known.
        """
        return driven_states(
            lambda own: self.hidden_rate(motion, where, values, own), motion.time, self.hidden
        )

    def argument(self, motion: Motion, where: str | None) -> Array | None:
        """(N,) what u is where the effect goes as sin(p u + phase), p its `search` parameter.

        None where it does not go so. The diagnosis then looks at every p between the ends of the
        parameter's grid.
        """
        return None

    def fastest(self, robot: Robot, where: str | None, values: Values) -> float:
        """Its highest natural frequency or decay rate [rad/s], for the choice of a step."""
        return 0.0

    def sense(
        self,
        channel: str,
        value: Array,
        motion: Motion,
        where: str | None,
        values: Values,
        hidden: Array,
    ) -> Array:
        """What a sensor says where it would have said `value`.

        Args:
            channel: One of `CHANNELS`.
            value: (N, n) or (N, 3).
            motion: The N true states.
            where: Its place.
            values: Its parameters.
            hidden: (N, hidden) its own states.
        """
        return value

    def delay(self, clock: str, values: Values) -> float:
        """Time by which the stamps of a clock (`CLOCKS`) are late [s]."""
        return 0.0


def _grows_with_mass(parameter: Parameter) -> bool:
    """Whether a parameter is a force, a torque, a momentum, a mass or an inertia."""
    has_force = parameter.unit.split()[:1] in (['N'], ['kg'])
    return has_force and parameter.role != 'reciprocal'


@dataclass(frozen=True, slots=True, kw_only=True)
class AppliedEffect:
    """An effect at a place with values: one entry of `effects:` in a robot file.

    Args:
        name: Its free name in the file.
        effect: The catalogue's entry.
        where: Its place.
        values: Every parameter of the effect.
    """

    name: str
    effect: Effect
    where: str | None
    values: Values

    def change(self, robot: Robot) -> Robot:
        """See `Effect.change`."""
        return self.effect.change(robot, self.where, self.values)

    def force(self, motion: Motion, hidden: Array) -> Array:
        """See `Effect.force`."""
        return self.effect.force(motion, self.where, self.values, hidden)

    def hidden_rate(self, motion: Motion, hidden: Array) -> Array:
        """See `Effect.hidden_rate`."""
        return self.effect.hidden_rate(motion, self.where, self.values, hidden)

    def momentum(self, motion: Motion, hidden: Array) -> Array:
        """See `Effect.momentum`."""
        return self.effect.momentum(motion, self.where, self.values, hidden)

    def fastest(self, robot: Robot) -> float:
        """See `Effect.fastest`."""
        return self.effect.fastest(robot, self.where, self.values)

    def acts(self, action: str) -> bool:
        """Whether the effect overrides an action of `Effect`, such as 'force'."""
        return getattr(type(self.effect), action) is not getattr(Effect, action)

    def driven(self, motion: Motion) -> Array:
        """See `Effect.driven`."""
        if not self.effect.hidden:
            return np.zeros((len(motion), 0))
        return self.effect.driven(motion, self.where, self.values)

    def sense(
        self, channel: str, value: Array, motion: Motion, hidden: Array | None = None
    ) -> Array:
        """See `Effect.sense`; own states that are not given are those that the motion drives."""
        if not self.acts('sense'):
            return value
        own = self.driven(motion) if hidden is None else hidden
        return self.effect.sense(channel, value, motion, self.where, self.values, own)

    def delay(self, clock: str) -> float:
        """See `Effect.delay`."""
        return self.effect.delay(clock, self.values)


def unit_axis(values: Values) -> dict[str, float]:
    """Values whose axis x, y, z has unit length and a largest component above zero."""
    axis = [values[name] for name in 'xyz']
    length = math.copysign(math.hypot(*axis), max(axis, key=abs))
    return {**values, **{name: values[name] / length for name in 'xyz'}}


def checked_values(effect: Effect, given: Mapping[str, float], place: str) -> dict[str, float]:
    """Every parameter of an effect, defaults filled in and bounds checked.

    Raises:
        ConfigurationError: unknown, missing, non-finite or out-of-bound parameter.
    """
    known = [p.name for p in effect.parameters]
    for name in given:
        if name not in known:
            raise ConfigurationError(
                f'{place}.{name}', f'{effect.id} has no such parameter (it has {", ".join(known)})'
            )
    return {p.name: _checked(p, given.get(p.name, p.default), place) for p in effect.parameters}


def _checked(parameter: Parameter, value: float | None, place: str) -> float:
    at = f'{place}.{parameter.name}'
    unit = f' {parameter.unit}' if parameter.unit else ''
    if value is None:
        raise ConfigurationError(
            at, f'is missing: {parameter.doc}{f" [{parameter.unit}]" * bool(unit)}'
        )
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ConfigurationError(at, f'expected a finite number, got {value!r}')
    if value <= parameter.above:
        raise ConfigurationError(at, f'{value:g}{unit} must be above {parameter.above:g}')
    if value < parameter.minimum:
        raise ConfigurationError(at, f'{value:g}{unit} must be at least {parameter.minimum:g}')
    if value > parameter.maximum:
        raise ConfigurationError(at, f'{value:g}{unit} must be at most {parameter.maximum:g}')
    return float(value)


def own_states(effects: Sequence[AppliedEffect]) -> list[slice]:
    """Places of every effect's own states in the vector of all, `ForcedMotion.hidden`."""
    sizes = [effect.effect.hidden for effect in effects]
    return [slice(sum(sizes[:i]), sum(sizes[: i + 1])) for i in range(len(sizes))]
