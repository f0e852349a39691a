"""Detection limits of a campaign in physical units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..effects.catalogue import CATALOGUE
from ..effects.effect import Effect
from ..effects.parameter import Parameter
from ..estimation.scaling import PROPORTIONAL, coordinate_of, origin_of, value_of
from .description import grouped
from .diagnosis_judge import Line
from .diagnosis_scenario import truth_of


def physical_limits(lines: Sequence[Line]) -> dict[str, dict[str, Any]]:
    """Size of every effect at its detection limit, over robots, motions and places, by its id.

    The coordinate of a hidden value is in proportion to its strength, so one case at any strength
    tells the limit of its robot, motion and place.

    Args:
        lines: Finished cases; those that hide a single effect count.

    Returns:
        Of each effect: the `parameter` that is meant (its first one, or the length of its vector)
        with its `unit`; `median`, `least` and `most` of the sizes at the detection limit; the
        `relevant` size, from which it matters (median), and the number of `records`.
    """
    single = [x for x in lines if len(x['hidden']) == 1 and x['strength'] > 0.0]
    own = grouped(single, lambda line: line['hidden'][0]['effect'])
    return {name: _limit(CATALOGUE[name], some) for name, some in sorted(own.items())}


def main_parameters(effect: type[Effect]) -> tuple[Parameter, ...]:
    """The first parameter that the effect is in proportion to, or the three of its vector."""
    listed = [p for p in effect.parameters if p.role in PROPORTIONAL]
    first = listed[0]
    stem = first.name.removesuffix('x')
    vector = tuple(p for p in listed if p.name in {stem + axis for axis in 'xyz'})
    return vector if len(vector) == 3 else (first,)


def _size(effect: type[Effect], line: Line) -> float:
    """Length of the main coordinates about no effect, at the detection limit."""
    values = line['hidden'][0]['values']
    found = [coordinate_of(p, values[p.name]) - origin_of(p) for p in main_parameters(effect)]
    return math.hypot(*found) / float(line['strength'])


def _relevant(effect: type[Effect], line: Line) -> float:
    """From where on the first main parameter matters at its place."""
    robot = truth_of(line['truth']).robot_file(line['robot']).robot
    where = line['hidden'][0]['where']
    first = effect.parameters.index(main_parameters(effect)[0])
    return effect.parameters_at(robot, where)[first].relevant


def _limit(effect: type[Effect], lines: Sequence[Line]) -> dict[str, Any]:
    first, *others = main_parameters(effect)
    shown = [_shown(first, _size(effect, line)) for line in lines]
    relevant = [_shown(first, _relevant(effect, line)) for line in lines]
    name = first.name.removesuffix('x').rstrip('_') or 'vector' if others else first.name
    away = f'{name} - {first.nominal:g}' if first.role == 'linear' and first.nominal else name
    return {
        'parameter': away,
        'unit': first.unit,
        'median': float(np.median(shown)),
        'least': min(shown),
        'most': max(shown),
        'relevant': float(np.median(relevant)),
        'records': len(shown),
    }


def _shown(parameter: Parameter, size: float) -> float:
    """A coordinate's distance from no effect as the parameter itself has it."""
    return size if parameter.role == 'linear' else value_of(parameter, size)
