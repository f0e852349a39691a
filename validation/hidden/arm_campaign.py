"""Campaign of arms whose noise nobody knows: causes hidden in one recording, or between two.

Every machine is recorded as it should be, then with one cause of three times the size from which
that very record would name it; likewise two recordings of other motions, between which nothing
changed, or one thing.
"""

from __future__ import annotations

import json
import math
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from operator import itemgetter
from typing import Any, cast

import numpy as np

from spacerobot_ros.diagnosis.arms.arm_conclusion import conclude_arm
from spacerobot_ros.diagnosis.arms.arms import find_arm_causes
from spacerobot_ros.diagnosis.comparison.change_conclusion import conclude_changes
from spacerobot_ros.diagnosis.comparison.compare import changes_between
from spacerobot_ros.diagnosis.comparison.detectable import Detection
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.effect import Effect
from spacerobot_ros.estimation.columns import Candidate
from spacerobot_ros.estimation.scaling import PROPORTIONAL
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.types import Array

from ..campaigns import Results, TrialRecord, grouped, key
from ..shares import share_of
from .diagnosis_draw import point_mass
from .diagnosis_judge import cause_record
from .real_arm import HIDDEN, RealArm, arm_file

_WORDS = {
    'diagnose': {
        'title': 'Causes of one recording',
        'clean_words': 'machines without a cause with a name',
        'first_words': 'causes named first',
    },
    'compare': {
        'title': 'Changes between two',
        'clean_words': 'unchanged machines with a change',
        'first_words': 'changes named first',
    },
}


def results(records: Sequence[TrialRecord]) -> Results:
    """As `arms`, by what was asked: shares and counts of names, errors of values."""
    return {'arms': {kind: _score(own) for kind, own in grouped(records, _KIND).items()}}


_KIND = itemgetter('kind')


def _score(records: Sequence[TrialRecord]) -> dict[str, Any]:
    hidden = [r for r in records if r['hidden']]
    errors = [z for r in hidden for z in _errors(r)]
    return {
        'machines': len(records),
        'false': share_of(bool(r['clean']) for r in records),
        'false_names': _counted(c for r in records for c in r['clean']),
        'too_large': len(records) - len(hidden),
        'first': share_of(map(_is_first, hidden)),
        'alone': share_of(_is_first(r) and len(r['single']) == 1 for r in hidden),
        'within': share_of(z <= 3.0 for z in errors),
        'spread': float(np.sqrt(np.mean(np.square(errors)))) if errors else math.nan,
        'causes': [
            {'cause': cause, **_of_cause(own)}
            for cause, own in sorted(grouped(hidden, itemgetter('cause')).items())
        ],
        'wall': float(np.median([r['wall_s'] for r in records])),
    }


def _of_cause(records: Sequence[TrialRecord]) -> dict[str, Any]:
    kind = CATALOGUE[records[0]['hidden']['effect']]
    first = next(p for p in kind.parameters if p.role in PROPORTIONAL)
    sizes = [abs(r['hidden']['values'][first.name] - first.nominal) for r in records]
    wrong = [r['single'][0] for r in records if r['single'] and not _is_first(r)]
    errors = [z for r in records for z in _errors(r)]
    return {
        'first': share_of(map(_is_first, records)),
        'missed': sum(not r['single'] for r in records),
        'taken_for': _counted(wrong),
        'others': sum(len(r['single']) > 1 for r in records if _is_first(r)),
        'size': float(np.median(sizes)),
        'parameter': first.name,
        'unit': first.unit,
        'spread': float(np.sqrt(np.mean(np.square(errors)))) if errors else math.nan,
    }


def _counted(causes: Iterable[TrialRecord]) -> dict[str, int]:
    return dict(Counter(c['effect'] for c in causes).most_common())


def _is_hidden(cause: TrialRecord, hidden: TrialRecord) -> bool:
    names = [(cause['effect'], cause['where']), *map(tuple, cause['rivals'])]
    return (hidden['effect'], hidden['where']) in names


def _is_first(record: TrialRecord) -> bool:
    """Whether the first name is the right one, or says that it can not be told from it."""
    return bool(record['single']) and _is_hidden(record['single'][0], record['hidden'])


def _errors(record: TrialRecord) -> Iterator[float]:
    """Error by standard deviation of every value of what is rightly named; of a body its mass."""
    hidden = record['hidden']
    for cause in record['single']:
        if (cause['effect'], cause['where']) == (hidden['effect'], hidden['where']):
            for p in CATALOGUE[hidden['effect']].parameters:
                if p.role in PROPORTIONAL and (p.name in ('mass', 'x', 'y') or _is_single(hidden)):
                    value, std = cause['values'][p.name]
                    yield _error(record['kind'], hidden['values'][p.name], p.nominal, value) / std


def _is_single(hidden: TrialRecord) -> bool:
    return hidden['effect'] not in ('inertial_parameters', 'gravity_error')


def _error(kind: str, truth: float, nominal: float, value: float) -> float:
    """A comparison tells what was added."""
    return abs(value - (truth - nominal if kind == 'compare' else truth))


def shown(results: Results) -> Results:
    """With words for what was asked."""
    return {'arms': {kind: _WORDS[kind] | s for kind, s in results['arms'].items()}}


MULTIPLE = 3.0
"""Strength of what is hidden, by its own limit."""
_REACH = 0.1  # m, of a mass that is added to a body
_LARGEST = 5.0  # plausible sizes
_LAST = 'link_6'
CAUSES = (*(name for name in HIDDEN if name != 'inertial_parameters'), 'payload', 'body')
"""What is hidden, in turn; a body's addition is a payload at the last link."""


def trials(runs: int, is_quick: bool) -> list[str]:
    """Every machine diagnosed and compared, as it should be and with one cause, in turn."""
    return [key(kind, seed, CAUSES[seed % len(CAUSES)]) for seed in range(runs) for kind in _ASKED]


def run(key: str) -> TrialRecord:
    """Ask about the machine as it should be, hide a cause, ask again."""
    kind, seed, cause = json.loads(key)
    started = time.perf_counter()
    clean, candidates, detection = _ASKED[kind](seed, ())
    wall = time.perf_counter() - started
    hidden = _drawn(candidates, detection, cause, np.random.default_rng([seed, 11]))
    single = _ASKED[kind](seed, (hidden,))[0] if hidden else None
    return {
        'kind': kind,
        'cause': cause,
        'hidden': hidden and {'effect': hidden.id, 'where': hidden.where, 'values': hidden.values},
        'clean': clean,
        'single': single,
        'wall_s': wall,
    }


_Asked = tuple[list[TrialRecord], dict[int, Candidate], Detection]
"""What is named, candidates that were asked about by the number of their hypothesis, limits."""


def _diagnosed(seed: int, hidden: tuple[Effect, ...]) -> _Asked:
    """What is named in one recording."""
    file = arm_file()
    record = observed(RealArm(seed, hidden).record(0), file.robot)
    kinds = list(CATALOGUE.values())
    found = find_arm_causes([record], file.robot, file.effects, kinds, lambda what, share: None)
    causes = conclude_arm(found, None, ()).causes
    every, candidates = found.fit.hypotheses, found.fit.rows.candidates
    return (
        [cause_record(c.applied.id, c.applied.where, c.parameters, c.rivals) for c in causes],
        {i: candidates[i] for i in sorted(every.open)},
        Detection(every, frozenset()),
    )


def _compared(seed: int, hidden: tuple[Effect, ...]) -> _Asked:
    """What is said to have changed between two recordings."""
    file = arm_file()
    before, after = [RealArm(seed).record(0)], [RealArm(seed, hidden).record(1)]
    found = changes_between(before, after, file.robot, file.effects)
    changes = conclude_changes(found).changes
    every, candidates = found.hypotheses, found.groups.rows.candidates
    return (
        [cause_record(c.effect, c.where, c.parameters, c.indistinguishable_from) for c in changes],
        {i: candidates[cast(int, every.every[i].key)] for i in sorted(every.open)},
        Detection(every, frozenset()),
    )


_ASKED = {'diagnose': _diagnosed, 'compare': _compared}


def _drawn(
    candidates: Mapping[int, Candidate],
    detection: Detection,
    cause: str,
    rng: np.random.Generator,
) -> Effect | None:
    """The cause at a place that is drawn, three times as large as its limit.

    None where that is more than an arm can have, or is not looked for.
    """
    fitting = [i for i, candidate in candidates.items() if _fits(candidate, cause)]
    if not fitting:
        return None
    i = fitting[int(rng.integers(len(fitting)))]
    candidate = candidates[i]
    direction = _direction(candidate, rng)
    size = MULTIPLE * detection.limit(i, direction) * direction
    if not np.all(np.abs(size) <= _LARGEST * candidate.sizes):
        return None
    values = candidate.values(size)
    if cause == 'joint_torque_constant':  # its coefficient is of measured torques
        values['gain'] = 1.0 / (1.0 - float(size[0]))
    return candidate.applied(values)


def _fits(candidate: Candidate, cause: str) -> bool:
    is_last = candidate.where == _LAST
    wanted = {'payload': is_last, 'body': not is_last}.get(cause)
    if wanted is None:
        return candidate.kind.id == cause
    return candidate.kind.id == 'inertial_parameters' and wanted


def _direction(candidate: Candidate, rng: np.random.Generator) -> Array:
    """Proportions of the coefficients: a mass at one point, else of the sizes that are usual."""
    if candidate.kind.id == 'inertial_parameters':
        return point_mass(rng, _REACH)
    first = candidate.kind.parameters[0]
    out = rng.standard_normal(len(candidate.sizes)) * candidate.sizes
    is_one_sided = max(first.minimum, first.above) >= first.nominal and len(out) == 1
    return np.abs(out) if is_one_sided else out
