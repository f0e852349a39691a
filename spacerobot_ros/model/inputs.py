r"""What acts on the base from outside and is known: thrusters under their commands, a wrench.

A command u_k in 0..1 holds from its time until the next one; thruster k then gives the force
u_k F_k d_k at its place p_k, in base coordinates, so that the base takes

    f = sum_k u_k F_k d_k,    m = sum_k p_k x u_k F_k d_k    about its origin.

An effect on commands or thrusters is a change of these; nothing else of the robot needs to know.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..errors import ConfigurationError
from ..types import Array, Vector3, Vector6

_INSTANT = 1e-6  # s, over which a mean is the value; times of records are right to 1e-9 s


@dataclass(frozen=True, eq=False)
class MountedThruster:
    """A thruster fixed to the base.

    Args:
        name: Its name.
        at: (3,) where it acts, from the base's origin in base coordinates [m].
        direction: (3,) unit vector of the force on the base.
        force: At a command of 1 [N].
    """

    name: str
    at: Vector3
    direction: Vector3
    force: float

    @cached_property
    def wrench(self) -> Vector6:
        """(6,) [force; torque] on the base at its origin, at a command of 1 [N, N m]."""
        force = self.force * self.direction
        return np.concatenate([force, np.cross(self.at, force)])


@dataclass(frozen=True, eq=False)
class HeldSignal:
    """Values that hold from their times on; zero before the first.

    Args:
        time: (N,) increasing [s].
        values: (N, k).
    """

    time: Array
    values: Array

    def mean(self, start: Array, end: Array) -> Array:
        """(M, k) means between times start <= end, (M,) each: its integral is exact."""

        def integral(t: Array) -> Array:
            k = np.clip(np.searchsorted(self.time, t, side='right') - 1, 0, None)
            since = np.maximum(t - self.time[k], 0.0)
            return np.asarray(self._sums[k] + self.values[k] * since[:, None])

        width = np.maximum(end - start, _INSTANT)
        return np.asarray((integral(start + width) - integral(start)) / width[:, None])

    @cached_property
    def _sums(self) -> Array:
        """(N, k) integrals up to every time."""
        steps = np.diff(self.time)[:, None]
        return np.vstack([np.zeros_like(self.values[:1]), np.cumsum(self.values[:-1] * steps, 0)])

    def delayed(self, by: float) -> HeldSignal:
        """The same, later."""
        return replace(self, time=self.time + by)


@dataclass(frozen=True, eq=False)
class MeasuredSignal:
    """Values that go straight from sample to sample.

    Args:
        time: (N,) increasing [s].
        values: (N, k).
        unit: Of all of them.
    """

    time: Array
    values: Array
    unit: str

    def at(self, times: Array) -> Array:
        """(M, k) at times (M,); before and after the samples as at their ends."""
        return np.stack([np.interp(times, self.time, x) for x in self.values.T], axis=1)


@dataclass(frozen=True, eq=False)
class Inputs:
    """Known inputs of one run, in seconds from its start.

    Args:
        commands: Of the robot's thrusters, in their order; None where there are none.
        wrench: (N, 6) on the base at its origin; None where there is none.
        is_located: Whether the base's position is measured, too.
        wheels: Momentum (N, 3) of the own wheels by their measured rates, relative to the base and
            in its coordinates; None: constant, as the robot has it.
        extra: (N, 1) what else was measured, by a name of the user's.
    """

    commands: HeldSignal | None = None
    wrench: HeldSignal | None = None
    is_located: bool = False
    wheels: MeasuredSignal | None = None
    extra: Mapping[str, MeasuredSignal] = field(default_factory=dict)

    @property
    def times(self) -> Array:
        """All times at which something changes [s]."""
        every = (self.commands, self.wrench, self.wheels)
        signals = [s.time for s in every if s is not None]
        return np.unique(np.concatenate(signals)) if signals else np.zeros(0)

    def delayed(self, by: float) -> Inputs:
        """All commands later."""
        return self if self.commands is None else replace(self, commands=self.commands.delayed(by))

    def force(self, thrusters: Sequence[MountedThruster], start: Array, end: Array) -> Array:
        """(M, 6) mean [force; torque] on the base at its origin, between times (M,) each."""
        total = np.zeros((len(start), 6))
        if self.commands is not None:
            wrenches = np.array([thruster.wrench for thruster in thrusters])
            total += self.commands.mean(start, end) @ wrenches
        if self.wrench is not None:
            total += self.wrench.mean(start, end)
        return total


def read_thrusters(section: Mapping[str, Mapping[str, object]]) -> tuple[MountedThruster, ...]:
    """`robot.thrusters` of a robot file: free name to {at, direction, force}.

    Raises:
        ConfigurationError: with the place in the file.
    """
    return tuple(_thruster(name, entry) for name, entry in section.items())


def _thruster(name: str, entry: Mapping[str, object]) -> MountedThruster:
    place = f'robot.thrusters.{name}'
    for key in entry:
        if key not in ('at', 'direction', 'force'):
            raise ConfigurationError(f'{place}.{key}', 'unknown: at, direction, force are known')
    vectors = {key: _vector(entry.get(key), f'{place}.{key}') for key in ('at', 'direction')}
    force, length = entry.get('force'), float(np.linalg.norm(vectors['direction']))
    if not isinstance(force, int | float) or not 0.0 < force < np.inf:
        raise ConfigurationError(f'{place}.force', f'expected newtons above zero, got {force!r}')
    if length == 0.0:
        raise ConfigurationError(f'{place}.direction', 'has no length')
    return MountedThruster(name, vectors['at'], vectors['direction'] / length, float(force))


def _vector(given: object, place: str) -> Vector3:
    try:
        vector = np.array(given, dtype=float)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise ConfigurationError(place, f'expected three numbers, got {given!r}')
    return vector
