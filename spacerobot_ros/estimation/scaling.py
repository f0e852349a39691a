"""The number that a fit moves for a parameter: the one that the effect is in proportion to."""

from __future__ import annotations

import math

from ..effects.parameter import Parameter

PROPORTIONAL = ('linear', 'reciprocal', 'square')
"""Roles of parameters in whose coordinate an effect is linear."""


def coordinate_of(parameter: Parameter, value: float) -> float:
    """The value itself, its inverse or its square."""
    if parameter.role == 'reciprocal':
        return 1.0 / value
    return value**2 if parameter.role == 'square' else value


def value_of(parameter: Parameter, coordinate: float) -> float:
    """Value of a coordinate, within the parameter's bounds."""
    if parameter.role == 'reciprocal':
        return 1.0 / coordinate if coordinate > 0.0 else math.inf
    if parameter.role == 'square':
        return min(math.sqrt(max(coordinate, 0.0)), parameter.maximum)
    if parameter.role == 'phase':
        return math.remainder(coordinate, 2.0 * math.pi)
    margin = 1e-12 if math.isfinite(parameter.above) else 0.0
    low = max(parameter.minimum, parameter.above + margin)
    return min(max(coordinate, low), parameter.maximum)


def origin_of(parameter: Parameter) -> float:
    """Coordinate of no effect."""
    return 0.0 if parameter.role in ('reciprocal', 'square') else parameter.nominal


def bounds_of(parameter: Parameter) -> tuple[float, float]:
    """Least and largest coordinate, from no effect."""
    if parameter.role in ('reciprocal', 'square'):
        return 0.0, math.inf
    low, high = max(parameter.minimum, parameter.above), parameter.maximum
    return low - parameter.nominal, high - parameter.nominal


def size_of(parameter: Parameter) -> float:
    """Plausible size of the coordinate; one where the catalogue knows none."""
    return parameter.size if math.isfinite(parameter.size) else 1.0


def has_prior(parameter: Parameter) -> bool:
    """Whether the catalogue says how large it may plausibly be."""
    return parameter.role in PROPORTIONAL and math.isfinite(parameter.size)


def spread_of(parameter: Parameter) -> float:
    """Width of what was thought possible of a coordinate, for the evidence."""
    if parameter.role == 'phase':
        return math.pi
    if parameter.role == 'search' and len(parameter.guesses) > 1:
        return max(parameter.guesses) - min(parameter.guesses)
    return size_of(parameter)


def value_std(parameter: Parameter, value: float, std: float) -> float:
    """Standard deviation of a value whose coordinate has the given one."""
    if parameter.role == 'reciprocal':
        return std * value**2
    if parameter.role == 'square':
        return std / (2.0 * value) if value else math.sqrt(std)
    return std


def is_relevant(parameter: Parameter, value: float) -> bool:
    """Whether a value is far enough from no effect to be worth a name."""
    if parameter.role not in PROPORTIONAL:
        return False
    return abs(coordinate_of(parameter, value) - origin_of(parameter)) > parameter.relevant
