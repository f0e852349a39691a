"""The numbers of an effect: bounds, plausible sizes, and what is worth naming."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from functools import partial
from typing import Any

from ..model.schema import Bounds


@dataclass(frozen=True, slots=True)
class Parameter(Bounds):
    """One number of an effect; what it means stands in the docstring of the effect's class.

    Args:
        name: Name in robot files and results.
        unit: SI unit; empty for a pure number.
        size: Plausible magnitude in space practice: the standard deviation of the fit's prior.
        relevant: Smallest magnitude worth naming, about `nominal`.
        nominal: Value at which the effect does nothing, as far as this parameter decides that.
        default: Value where a robot file is silent; None where it must be given.
        role: How the action depends on it about `nominal`. `linear`: in proportion. `phase`: with
            the linear parameter before it a pair amplitude and phase [rad], amplitude *
            sin(... + phase). `reciprocal`: in proportion to its inverse, nothing at infinity.
            `square`: in proportion to its square. `search`: in any other way; the fit starts from
            every one of `guesses`. Size and threshold are those of what the action is in
            proportion to: of the inverse, or of the square.
        guesses: First guesses where the role is `search`.
        beyond: Another linear parameter, which it is not below where an effect is estimated.
    """

    name: str
    unit: str
    size: float = math.inf
    relevant: float = 0.0
    _: KW_ONLY
    nominal: float = 0.0
    default: float | None = None
    role: str = 'linear'
    guesses: tuple[float, ...] = ()
    beyond: str = ''

    @property
    def grows_with_mass(self) -> bool:
        """Whether it is a force, a torque, a momentum, a mass or an inertia."""
        has_force = self.unit.split()[:1] in (['N'], ['kg'])
        return has_force and self.role != 'reciprocal'


amount = partial(Parameter, minimum=0.0)
"""A parameter that is never below zero."""


def searched(
    name: str, unit: str, size: float = math.inf, *, guesses: Sequence[float] = (), **rest: Any
) -> Parameter:
    """A parameter that the fit starts from every one of some guesses."""
    return Parameter(name, unit, size, role='search', guesses=tuple(guesses), **rest)


def phase() -> Parameter:
    """Phase of the amplitude before it."""
    return Parameter('phase', 'rad', default=0.0, role='phase')


def xyz(unit: str, size: float, relevant: float, prefix: str = '') -> tuple[Parameter, ...]:
    """Three parameters x, y, z of a vector."""
    return tuple(Parameter(prefix + axis, unit, size, relevant, default=0.0) for axis in 'xyz')
