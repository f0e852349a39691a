"""What a physical effect is: an id, its places, its parameters, and what it does.

An effect acts in one or several of these ways, and each action is written once:

- `change`: the robot has other bodies or wheels than the file says;
- `force`: a generalized force that depends on the motion, and on hidden states where it has any;
- `sense`: a sensor says something else;
- `delay`: a sensor's stamps are late.

The classes are the entries of the catalogue; an instance is bound to a place and to values. The
simulator applies the actions exactly; the diagnosis differentiates the same actions by the
parameters and asks whether the data want them (`diagnosis/`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from ..errors import ConfigurationError
from ..model.robot import Robot
from ..model.schema import meanings, parse_number
from ..types import Array
from .motion import Motion
from .own_states import driven_states
from .parameter import Parameter
from .prior import Prior, Scale

_HEAVY = 100.0  # kg, of all that moves

Values = Mapping[str, float]
"""Parameter values by name."""

Key = tuple[str, str | None]
"""Id and place of an effect."""

CHANNELS = ('joint_position', 'joint_velocity', 'joint_effort', 'gyro', 'attitude')
"""Sensor channels. Attitude values are small rotations of the true attitude on the base's side."""

CLOCKS = ('joints', 'effort', 'imu', 'attitude')
"""What can be late: all of /joint_states, its effort alone, the gyro, the star tracker."""


@dataclass(frozen=True, kw_only=True)
class Effect:
    """An effect at a place with values; subclasses are its kinds and override what they act on.

    The docstring of a kind also says what values are typical in space practice (`Typical:`), what
    it looks like in the data (`Signature:`), and where its equations come from (`Source:`).

    Args:
        name: Its free name in a robot file.
        where: Its place.
        values: Every parameter of its kind.
        recordings: Numbers, from 0, of the recordings of a machine that it is of; None: of the
            machine, and of all.

    Attributes of the kinds:
        id: Name in robot files and results; never renamed.
        title: What it is, in words.
        group: joint, sensor, wheels, bodies, environment, learned or events.
        parameters: In the order of results.
        needs_free_base: Whether a fixed base shows nothing of it.
        hidden: Number of its own states.
        is_external: Whether its force comes from outside the system, so that it changes the
            system's momentum; the force of any other effect takes from one part what it gives to
            another, `momentum` included.
        is_timed: Whether its force depends on the time since the start, which only the simulator
            and a record know.
        excludes: Ids of what can not act at the same place beside it, its own id among them where
            two of it would contradict each other.
        refines: Ids of simpler laws that are special cases of it.
        is_rare: Whether the diagnosis looks for it only where a test of whiteness asks for more
            than common causes: beside an unknown leftover it would take what is theirs.
        follows_load: Whether its force goes with the torque of its joint's motor, so that whatever
            else is found there changes it, too.
        is_own: Whether a user wrote it: its sizes are taken as they are on an arm, too.
        is_fitted: Whether the diagnosis considers it as a cause; False for what a record can not
            tell from another effect of the catalogue, and for events, which have a scan of their
            own.
    """

    id: ClassVar[str]
    title: ClassVar[str]
    group: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    needs_free_base: ClassVar[bool] = False
    hidden: ClassVar[int] = 0
    is_external: ClassVar[bool] = False
    is_timed: ClassVar[bool] = False
    excludes: ClassVar[tuple[str, ...]] = ()
    is_rare: ClassVar[bool] = False
    is_fitted: ClassVar[bool] = True
    follows_load: ClassVar[bool] = False
    is_own: ClassVar[bool] = False
    refines: ClassVar[tuple[str, ...]] = ()

    name: str
    where: str | None
    values: Values
    recordings: tuple[int, ...] | None = None

    def __getitem__(self, parameter: str) -> float:
        """Value of a parameter."""
        return self.values[parameter]

    @property
    def key(self) -> Key:
        """Its id and place."""
        return self.id, self.where

    def is_of(self, recording: int) -> bool:
        """Whether it acts in a recording."""
        return self.recordings is None or recording in self.recordings

    def vector(self, *names: str) -> Array:
        """Values of some parameters; without names, (3,) of x, y, z."""
        return np.array([self.values[name] for name in names or 'xyz'])

    @classmethod
    def read(cls, name: str, where: str | None, given: Mapping[str, Any], place: str) -> Effect:
        """From an entry of a robot file, without `effect` and `where`.

        Raises:
            ConfigurationError: an unknown, missing or impossible value, with its place.
        """
        known = [p.name for p in cls.parameters]
        for key in given:
            if key not in known:
                why = f'{cls.id} has no such parameter (it has {", ".join(known)})'
                raise ConfigurationError(f'{place}.{key}', why)
        values = {}
        for p in cls.parameters:
            at, value = f'{place}.{p.name}', given.get(p.name, p.default)
            if value is None:
                unit = f' [{p.unit}]' if p.unit else ''
                raise ConfigurationError(at, f'is missing: {meanings(cls)[p.name]}{unit}')
            values[p.name] = parse_number(value, at)
            p.check(values[p.name], at, p.unit)
        return cls(name=name, where=where, values=values)

    def entry(self) -> dict[str, Any]:
        """As in a robot file, without `effect` and `where`."""
        return dict(self.values)

    @property
    def is_known_ahead(self) -> bool:
        """Whether its force follows from a motion, so that a controller can make up for it."""
        return self.acts('force') and not (self.is_external or self.is_timed or self.hidden)

    @classmethod
    def acts(cls, action: str) -> bool:
        """Whether this kind overrides an action of `Effect`, such as 'force'."""
        return next(kind for kind in cls.__mro__ if action in vars(kind)) is not Effect

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Where it can act on a robot: joints, links, or (None,) for the system as a whole."""
        return (None,)

    @classmethod
    def fitted_places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Where the diagnosis looks for it: where no other effect is the same."""
        return cls.places(robot)

    @classmethod
    def variants(cls, robot: Robot, where: str | None) -> tuple[dict[str, float], ...]:
        """First guesses of the `search` parameters: every combination of their guesses."""
        searched = {p.name: p.guesses for p in cls.parameters if p.role == 'search'}
        guesses = itertools.product(*searched.values())
        return tuple(dict(zip(searched, guess, strict=True)) for guess in guesses)

    @classmethod
    def parameters_at(cls, robot: Robot, where: str | None) -> tuple[Parameter, ...]:
        """Its parameters with sizes and thresholds that fit the robot.

        Those of forces, torques and masses are of robots of `_HEAVY` and more; for a lighter one
        they are smaller in proportion.
        """
        first = 0 if robot.is_free else 1
        share = float(np.sum(robot.inertial_parameters[first:, 0])) / _HEAVY
        if share >= 1.0:
            return cls.parameters
        return tuple(
            replace(p, size=share * p.size, relevant=share * p.relevant)
            if p.grows_with_mass
            else p
            for p in cls.parameters
        )

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """What its coefficients are on an arm where it is a cause, and where it is none.

        A user's own has its parameters' sizes, and is not there unless it is a cause. None:
        nothing of it shows in a balance of torques.

        Args:
            scale: The machine at its place.
        """
        return scale.alike(scale.sizes)

    @classmethod
    def unit_at(cls, robot: Robot, where: str | None, parameter: Parameter) -> str:
        """Unit of one of its parameters at a place."""
        return parameter.unit

    @classmethod
    def nominal(cls) -> dict[str, float]:
        """Parameter values that stand for no effect."""
        return {p.name: p.nominal for p in cls.parameters}

    @classmethod
    def argument(cls, motion: Motion, where: str | None) -> Array | None:
        """(N,) what u is where the effect goes as sin(p u + phase), p its `search` parameter.

        None where it does not go so. The diagnosis then looks at every p between the ends of the
        parameter's guesses.
        """
        return None

    def canonical(self) -> Effect:
        """The same effect with values in their usual form, such as an axis of unit length."""
        return self

    def check(self, robot: Robot) -> None:
        """Refuse values that contradict each other or the robot.

        Bounds of single parameters are checked before.

        Raises:
            ConfigurationError: with the place in the file.
        """
        self.change(robot)

    def refusal(self, why: str, parameter: str = '') -> ConfigurationError:
        """What to raise where values contradict each other or the robot."""
        return ConfigurationError(f'effects.{self.name}{"." * bool(parameter)}{parameter}', why)

    def change(self, robot: Robot) -> Robot:
        """The robot as the effect makes it.

        Raises:
            ConfigurationError: no physical robot is left.
        """
        return robot

    def force(self, motion: Motion, hidden: Array) -> Array:
        """(N, 6 + n) generalized force [N, N m].

        Args:
            motion: N states.
            hidden: (N, hidden) its own states.
        """
        return motion.zeros()

    @property
    def follows_acceleration(self) -> bool:
        """Whether its force is affine in the accelerations of the motion, which it then needs.

        The integrator solves for both together.
        """
        return False

    def hidden_rate(self, motion: Motion, hidden: Array) -> Array:
        """(N, hidden) time derivative of its own states; `motion.acceleration` is known."""
        return hidden

    def momentum(self, motion: Motion, hidden: Array) -> Array:
        """(N, 6) momentum that the effect itself holds, beyond the robot's bodies and wheels.

        Returns:
            [linear (N s); angular about the base origin (N m s)] in base coordinates. Its rate in
            the inertial frame is the opposite of what `force` does to the whole.
        """
        return np.zeros((len(motion), 6))

    def driven(self, motion: Motion) -> Array:
        """(N, hidden) own states along a given motion that began at rest, for the diagnosis.

        Here the rate is taken to be affine in them; `motion.acceleration` is known.
        """
        if not self.hidden:
            return np.zeros((len(motion), 0))
        return driven_states(lambda own: self.hidden_rate(motion, own), motion.time, self.hidden)

    def followed(self, robot: Robot, own: Array, before: Array, after: Array) -> Array:
        """(hidden,) own states after joint angles (n,) of a robot went from one place to the next.

        Only an effect that `is_known_ahead` is asked: for it they are a function of that way.
        """
        return own

    def fastest(self, robot: Robot) -> float:
        """Its highest natural frequency or decay rate [rad/s], for the choice of a step."""
        return 0.0

    def sense(
        self, channel: str, value: Array, motion: Motion, hidden: Array | None = None
    ) -> Array:
        """What a sensor says where it would have said `value`.

        Args:
            channel: One of `CHANNELS`.
            value: (N, n) or (N, 3).
            motion: The N true states.
            hidden: (N, hidden) its own states; None: those that the motion drives.
        """
        return value

    def delay(self, clock: str) -> float:
        """Time by which the stamps of a clock (`CLOCKS`) are late [s]."""
        return 0.0

    def joint_delays(self, robot: Robot) -> Array:
        """(n,) time by which all samples of a joint are later than the stamps say [s]."""
        return np.zeros(robot.n_joints)

    def with_unit_axis(self) -> Effect:
        """The effect with an axis x, y, z of unit length, its largest component above zero."""
        axis = self.vector()
        axis /= math.copysign(float(np.linalg.norm(axis)), max(axis, key=abs))
        return self.changed(**dict(zip('xyz', axis.tolist(), strict=True)))

    def changed(self, **values: float) -> Effect:
        """The same with other values of some parameters."""
        return replace(self, values={**self.values, **values})


def own_states(effects: Sequence[Effect]) -> list[slice]:
    """Places of every effect's own states in the vector of all, `ForcedMotion.hidden`."""
    sizes = [effect.hidden for effect in effects]
    return [slice(sum(sizes[:i]), sum(sizes[: i + 1])) for i in range(len(sizes))]
