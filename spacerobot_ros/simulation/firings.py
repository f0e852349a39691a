"""Commands to thrusters in a simulated run: as scheduled, and as they act through faults."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..effects.effect import Effect
from ..effects.surroundings.thrusters import CommandDelay
from ..errors import ConfigurationError
from ..model.robot import Robot
from ..types import Array, Vector6

THRUSTERS = '/thruster_commands'
_DEFAULTS = {'thruster': None, 'start': 0.0, 'width': None, 'share': 1.0, 'period': math.inf}


class Firings:
    """The schedule of `firings` of a robot file.

    A command is held over a control period: the share of it in which a firing is on.

    Args:
        section: Free name to {thruster, start, width, share, period}.
        robot: What the file believes; gives the thrusters.
        plant: What it really is.
        effects: Of the plant.
        period: Control period [s].
    """

    def __init__(
        self,
        section: Mapping[str, Mapping[str, Any]],
        robot: Robot,
        plant: Robot,
        effects: tuple[Effect, ...],
        period: float,
    ) -> None:
        self.names = tuple(thruster.name for thruster in robot.thrusters)
        self._firings = [_firing(name, entry, self.names) for name, entry in section.items()]
        self._wrenches = np.array([thruster.wrench for thruster in plant.thrusters])
        self._late = sum(e['delay'] for e in effects if isinstance(e, CommandDelay)) / period
        self._period = period

    def __bool__(self) -> bool:
        """Whether anything fires."""
        return bool(self._firings)

    def commands(self, step: int) -> Array:
        """(k,) shares commanded at a control step, held until the next one."""
        out = np.zeros(len(self.names))
        start, end = step * self._period, (step + 1) * self._period
        for k, share, first, width, period in self._firings:
            if step >= 0:
                on = _time_on(end - first, width, period) - _time_on(start - first, width, period)
                out[k] += share * on / self._period
        return np.clip(out, 0.0, 1.0)

    def wrench(self, step: int) -> Vector6:
        """(6,) mean wrench of all thrusters over a control step, late as they are."""
        whole = math.floor(self._late)
        part = self._late - whole
        acting = (1.0 - part) * self.commands(step - whole)
        acting = acting + part * self.commands(step - whole - 1)
        return np.asarray(acting @ self._wrenches)


def _time_on(since: float, width: float, period: float) -> float:
    """Time for which a firing has been on [s]."""
    if since <= 0.0:
        return 0.0
    if math.isinf(period):
        return min(since, width)
    whole = math.floor(since / period)
    return whole * width + min(since - whole * period, width)


def _firing(
    name: str, entry: Mapping[str, Any], names: tuple[str, ...]
) -> tuple[int, float, float, float, float]:
    place = f'firings.{name}'
    for key in entry:
        if key not in _DEFAULTS:
            why = f'unknown: {", ".join(_DEFAULTS)} are known'
            raise ConfigurationError(f'{place}.{key}', why)
    given = {**_DEFAULTS, **entry}
    if given['thruster'] not in names:
        known = ', '.join(names) or 'none'
        why = f'{given["thruster"]!r} is no thruster of the robot (it has {known})'
        raise ConfigurationError(f'{place}.thruster', why)
    numbers = [given[key] for key in ('share', 'start', 'width', 'period')]
    if not all(isinstance(number, int | float) and number >= 0.0 for number in numbers):
        raise ConfigurationError(place, 'start, width, share, period are numbers from 0 on')
    share, start, width, period = (float(number) for number in numbers)
    if share > 1.0 or not 0.0 < width <= period:
        raise ConfigurationError(place, 'share is at most 1, width above 0 and within the period')
    return names.index(given['thruster']), share, start, width, period
