"""The numbers of an effect: bounds, plausible sizes, and what is worth naming."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import partial

from ..errors import ConfigurationError
from ..model.schema import Bounds, parse_number


@dataclass(frozen=True, slots=True)
class Parameter(Bounds):
    """One number of an effect.

    Args:
        name: Name in robot files and results.
        unit: SI unit; empty for a pure number.
        doc: One sentence.
        size: Plausible magnitude in space practice: the standard deviation of the fit's prior.
        relevant: Smallest magnitude worth naming, about `nominal`.
        nominal: Value at which the effect does nothing, as far as this parameter decides that.
        default: Value where a robot file is silent; None where it must be given.
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
    size: float = math.inf
    relevant: float = 0.0
    _: KW_ONLY
    nominal: float = 0.0
    default: float | None = None
    role: str = 'linear'
    grid: tuple[float, ...] = ()

    @property
    def grows_with_mass(self) -> bool:
        """Whether it is a force, a torque, a momentum, a mass or an inertia."""
        has_force = self.unit.split()[:1] in (['N'], ['kg'])
        return has_force and self.role != 'reciprocal'

    def checked(self, value: object, place: str) -> float:
        """A value of a robot file within the bounds.

        Raises:
            ConfigurationError: missing, not a finite number, or out of bounds.
        """
        at = f'{place}.{self.name}'
        if value is None:
            unit = f' [{self.unit}]' if self.unit else ''
            raise ConfigurationError(at, f'is missing: {self.doc}{unit}')
        number = float(parse_number(value, at))
        self.check(number, at, self.unit)
        return number


def checked_values(
    parameters: Sequence[Parameter], given: Mapping[str, float], owner: str, place: str
) -> dict[str, float]:
    """Every parameter of an effect, defaults filled in and bounds checked.

    Args:
        parameters: What there is.
        given: What a file gives.
        owner: Id of the effect, for messages.
        place: The effect's place in the file.

    Raises:
        ConfigurationError: unknown, missing, non-finite or out-of-bound parameter.
    """
    known = [p.name for p in parameters]
    for name in given:
        if name not in known:
            raise ConfigurationError(
                f'{place}.{name}', f'{owner} has no such parameter (it has {", ".join(known)})'
            )
    return {p.name: p.checked(given.get(p.name, p.default), place) for p in parameters}


amount = partial(Parameter, minimum=0.0)
"""A parameter that is never below zero."""


def guess(
    name: str,
    unit: str,
    doc: str,
    size: float = math.inf,
    *,
    grid: Sequence[float] = (),
    **rest: float,
) -> Parameter:
    """A parameter that the fit starts from every value of a grid."""
    return Parameter(name, unit, doc, size, role='search', grid=tuple(grid), **rest)


def phase(doc: str) -> Parameter:
    """Phase of the amplitude before it."""
    return Parameter('phase', 'rad', doc, default=0.0, role='phase')


def xyz(
    unit: str, doc: str, size: float, relevant: float, prefix: str = ''
) -> tuple[Parameter, ...]:
    """Three parameters x, y, z of a vector; `doc` ends before the axis."""
    return tuple(
        Parameter(prefix + axis, unit, f'{doc} {axis}.', size, relevant, default=0.0)
        for axis in 'xyz'
    )
