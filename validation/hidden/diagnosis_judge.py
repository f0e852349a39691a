"""What became of one case of a diagnosis campaign; detection limits in physical units."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import eq
from typing import Any

import numpy as np

from spacerobot_ros.diagnosis.answer.cause import Estimated, Rival
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.effect import Effect, Key
from spacerobot_ros.effects.equivalents import EQUIVALENTS, made_of
from spacerobot_ros.effects.parameter import Parameter
from spacerobot_ros.estimation.scaling import PROPORTIONAL, coordinate_of, origin_of, value_of

from ..campaigns import TrialRecord, grouped
from .diagnosis_scenario import truth_of

REFUSED = 'refused'
"""Verdict of a record that the diagnosis took for unusable: never right."""
NOT_SIMULATED = 'not simulated'
"""Verdict where the effect or the controller under it could not be simulated: no trial."""
TOO_WEAK = 'too weak'
"""Outcome where bounds, robot or motion allow less than the strength asked for: no trial."""
NO_TRIAL = (NOT_SIMULATED, TOO_WEAK)
_ALMOST = 0.5  # of the strength asked for

_PAIRS = {frozenset(entry[:2]) for entry in EQUIVALENTS}

Alike = Callable[[Key, Key], bool]
"""Whether a name that was found counts as one that was hidden."""


def cause_record(
    effect: str, where: str | None, parameters: Mapping[str, Estimated], rivals: Iterable[Rival]
) -> TrialRecord:
    """A cause as records have it: its rivals, its values with their standard deviations."""
    return {
        'effect': effect,
        'where': where,
        'rivals': [[rival.effect, rival.where] for rival in rivals],
        'values': {name: [e.value, e.std] for name, e in parameters.items()},
    }


def is_equivalent(one: Key, other: Key) -> bool:
    """Whether two effects with their places are the same, or declared equivalents there."""
    return one[1] == other[1] and (one[0] == other[0] or {one[0], other[0]} in _PAIRS)


def hidden(line: TrialRecord) -> list[Key]:
    """Effects and places that were hidden."""
    return [(h['effect'], h['where']) for h in line['hidden']]


def found(line: TrialRecord) -> list[set[Key]]:
    """Everything fitted, named or too small to matter, with what it can't be told from."""
    return [_with_rivals(c) for c in [*line['causes'], *line['minor']]]


def _with_rivals(cause: TrialRecord) -> set[Key]:
    return {(cause['effect'], cause['where']), *((e, w) for e, w in cause['rivals'])}


def is_top(line: TrialRecord, alike: Alike = eq) -> bool:
    """Whether the first of all found is one that was hidden.

    Args:
        line: A finished case.
        alike: What counts as the same: `is_equivalent`, declared equivalents as well.
    """
    groups, names = found(line), hidden(line)
    return bool(groups) and any(_has(groups[0], name, alike) for name in names)


def is_exact(line: TrialRecord, alike: Alike = eq) -> bool:
    """Whether everything hidden was found, and nothing else; as above."""
    groups, names = found(line), hidden(line)
    return len(groups) == len(names) and all(any(_has(g, n, alike) for g in groups) for n in names)


def _has(group: set[Key], name: Key, alike: Alike) -> bool:
    return any(alike(other, name) for other in group)


def outcome(line: TrialRecord) -> str:
    """A case in two words.

    Returns:
        `NOT_SIMULATED`, `TOO_WEAK` or `REFUSED` (by the diagnosis, as faulty data); of clean
        records `consistent`, `unexplained` or `named`; of hidden effects `right`, `wrong name` or
        the verdict where nothing was found; of effects out of the catalogue the verdict, but for
        `explained`: `equivalent` where all names are declared equivalents, or say that they can
        not be told from one, else `wrong name`.
    """
    verdict: str = line['verdict']
    if verdict == NOT_SIMULATED:
        return NOT_SIMULATED
    if line['kind'] != 'clean' and line['strength'] <= _ALMOST * line['multiple']:
        return TOO_WEAK
    if verdict == REFUSED:
        return REFUSED
    return _OF[line['kind']](line)


def is_trial(line: TrialRecord) -> bool:
    """Whether a case can count as right or wrong."""
    return outcome(line) not in NO_TRIAL


def _clean(line: TrialRecord) -> str:
    return 'named' if line['causes'] else str(line['verdict'])


def _single(line: TrialRecord) -> str:
    if is_top(line):
        return 'right'
    if is_top(line, is_equivalent):
        return 'equivalent'
    return 'wrong name' if found(line) else str(line['verdict'])


def _several(line: TrialRecord) -> str:
    if is_exact(line):
        return 'right'
    if is_exact(line, is_equivalent):
        return 'equivalent'
    groups, names = found(line), hidden(line)
    if groups and all(any(n in g for n in names) for g in groups):
        return 'some of them'
    return 'wrong name' if groups else str(line['verdict'])


def _left_out(line: TrialRecord) -> str:
    if line['verdict'] != 'explained':
        return str(line['verdict'])
    (truth,) = hidden(line)
    named, minor = ({(c['effect'], c['where']) for c in line[of]} for of in ('causes', 'minor'))
    robot = truth_of(line['truth']).robot_file(line['robot']).robot
    needed, further = made_of(robot, *truth)
    is_made = bool(needed) and needed <= named | minor and named <= needed | further
    groups = map(_with_rivals, line['causes'])
    is_same = all(any(is_equivalent(name, truth) for name in group) for group in groups)
    return 'equivalent' if is_same or is_made else 'wrong name'


_OF = {
    'clean': _clean,
    'single': _single,
    'pair': _several,
    'triple': _several,
    'left_out': _left_out,
}


def physical_limits(lines: Sequence[TrialRecord]) -> dict[str, dict[str, Any]]:
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


def _size(effect: type[Effect], line: TrialRecord) -> float:
    """Length of the main coordinates about no effect, at the detection limit."""
    values = line['hidden'][0]['values']
    found = [coordinate_of(p, values[p.name]) - origin_of(p) for p in main_parameters(effect)]
    return math.hypot(*found) / float(line['strength'])


def _relevant(effect: type[Effect], line: TrialRecord) -> float:
    """From where on the first main parameter matters at its place."""
    robot = truth_of(line['truth']).robot_file(line['robot']).robot
    where = line['hidden'][0]['where']
    first = effect.parameters.index(main_parameters(effect)[0])
    return effect.parameters_at(robot, where)[first].relevant


def _limit(effect: type[Effect], lines: Sequence[TrialRecord]) -> dict[str, Any]:
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
