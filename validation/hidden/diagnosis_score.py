"""Scores of a diagnosis campaign: who is taken for whom, how surely, from which strength on."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from operator import itemgetter
from typing import Any

import numpy as np

from spacerobot_ros.display import Curve, Matrix, Panel, Plot, Section
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.scaling import PROPORTIONAL
from spacerobot_ros.types import Array

from ..campaigns import Results, TrialRecord, grouped
from ..shares import Share, share_of
from .diagnosis_judge import (
    REFUSED,
    hidden,
    is_equivalent,
    is_exact,
    is_top,
    is_trial,
    outcome,
    physical_limits,
)

# figures to reach: least share by strength
_NAMED = {3.0: 0.97, 10.0: 0.99}
_SEVERAL = {('pair', 3.0): 0.85, ('pair', 10.0): 0.90, ('triple', 10.0): 0.75}  # all of them
_AT = 3.0  # of the detection limit, where confusions are counted
_FREQUENCIES = ('frequency', 'harmonic')
_TUNED = 0.01  # relative error of a frequency that is found
_SURE = 0.003  # relative standard deviation below which it is asked for
_FLOOR = 0.05  # relative distance of the held-out error from the noise floor


Scores = dict[str, Any]
"""Of a campaign; a record that the diagnosis refuses is a trial, and never right.

outcomes: kind and strength to the number of cases by `outcome`; nothing is left out.
refused: kind, what was hidden, and message of what could not be diagnosed or simulated.
top: right first names of single effects by strength, declared equivalents among them.
pairs, triples: all names right, and nothing else, by strength; likewise.
confusion: hidden effect's id to what was found first, with counts, at 3 times the limit.
found: effect's id to right first names, by strength.
limits: effect's id to its detection limit in physical units.
roc: false alarm share, and the share found at each strength, for falling thresholds of the best
evidence.
clean_named: clean records with a name; clean_unexplained: with `unexplained`; clean_refused: taken
for faulty data.
left_out_wrong: `explained` with a wrong name, the true one unknown; left_out_missed: `consistent`,
at ten times the limit.
within: values within 3 standard deviations; one without a finite deviation is not; without_std:
number of these.
frequencies: frequencies of rightly named effects that are known to 0.3 % and right within 1 %, by
strength.
held_out: rightly explained records whose held-out error is within 5 % of the noise floor; where
what was found is too small to matter it is not in the model whose error that is.
wall: median and largest time of a diagnosis [s].
"""


def score(lines: Sequence[TrialRecord]) -> Scores:
    """All scores of finished cases.

    Args:
        lines: Records of `diagnosis_campaign`.
    """
    trials = [x for x in lines if is_trial(x)]
    clean, single, pair, triple, left_out = (
        [x for x in trials if x['kind'] == kind]
        for kind in ('clean', 'single', 'pair', 'triple', 'left_out')
    )
    values = [pull for x in trials for pull in _pulls(x)]
    walls = [x['wall_s'] for x in trials if x['verdict'] != REFUSED] or [0.0]
    return {
        'outcomes': _outcomes(lines),
        'refused': [_reason(x) for x in lines if 'error' in x],
        'top': _right(single, is_top),
        'pairs': _right(pair, is_exact),
        'triples': _right(triple, is_exact),
        'confusion': _confusion([x for x in single if x['multiple'] == _AT]),
        'found': _found(single),
        'limits': physical_limits(lines),
        'roc': _roc(clean, single),
        'clean_named': _became(clean, 'named'),
        'clean_unexplained': _became(clean, 'unexplained'),
        'clean_refused': _became(clean, REFUSED),
        'left_out_wrong': _became(left_out, 'wrong name'),
        'left_out_missed': _became(left_out, 'consistent'),
        'within': share_of(pull <= 3.0 for pull in values),
        'without_std': sum(math.isinf(pull) for pull in values),
        'frequencies': {
            m: share_of(e <= _TUNED for x in some for e in _detunings(x))
            for m, some in _by([*single, *pair, *triple])
        },
        'held_out': share_of(
            abs(x['after'] - 1.0) <= _FLOOR
            for x in [*single, *pair, *triple]
            if x['verdict'] == 'explained' and is_exact(x) and not x['minor']
        ),
        'wall': (float(np.median(walls)), float(np.max(walls))),
    }


def _by(
    lines: Sequence[TrialRecord], of: Callable[[TrialRecord], Any] = itemgetter('multiple')
) -> list[tuple[Any, list[TrialRecord]]]:
    """Cases in groups, sorted; by strength if nothing else is said."""
    return sorted(grouped(lines, of).items())


def _right(lines: Sequence[TrialRecord], is_right: Callable[..., bool]) -> dict[float, Share]:
    """By strength; a declared equivalent is no error."""
    return {m: share_of(is_right(x, is_equivalent) for x in some) for m, some in _by(lines)}


def _became(lines: Sequence[TrialRecord], what: str) -> Share:
    return share_of(outcome(x) == what for x in lines)


def _outcomes(lines: Sequence[TrialRecord]) -> dict[str, dict[str, int]]:
    return {
        f'{kind} {multiple}': dict(Counter(map(outcome, some)).most_common())
        for (kind, multiple), some in _by(lines, itemgetter('kind', 'multiple'))
    }


def _reason(line: TrialRecord) -> tuple[str, str, str]:
    names = ', '.join(e if w is None else f'{e} at {w}' for e, w in hidden(line))
    return line['kind'], names, line['error']


def _confusion(lines: Sequence[TrialRecord]) -> dict[str, dict[str, int]]:
    return {name: dict(Counter(map(_named_first, some))) for name, some in _by(lines, _hidden_id)}


def _named_first(line: TrialRecord) -> str:
    """What was found first, or the verdict; a right effect at a wrong place is `elsewhere`."""
    name, first = _hidden_id(line), next(iter([*line['causes'], *line['minor']]), None)
    if is_top(line) or first is None:
        return name if is_top(line) else str(line['verdict'])
    return f'{name} elsewhere' if first['effect'] == name else str(first['effect'])


def _found(lines: Sequence[TrialRecord]) -> dict[str, dict[float, Share]]:
    return {name: _right(own, is_top) for name, own in _by(lines, _hidden_id)}


def _hidden_id(line: TrialRecord) -> str:
    return hidden(line)[0][0]


def _roc(clean: Sequence[TrialRecord], singles: Sequence[TrialRecord]) -> dict[str, list[float]]:
    """Shares above every threshold that a record's best evidence gives."""
    quiet = _evidence(clean)
    loud = {m: _evidence(some) for m, some in _by(singles)}
    thresholds = np.sort(np.concatenate([quiet, *loud.values(), [0.0]]))[::-1]
    out = {'threshold': thresholds.tolist(), 'false_alarm': _above(quiet, thresholds)}
    return out | {f'found_{m:g}': _above(values, thresholds) for m, values in loud.items()}


def _evidence(lines: Sequence[TrialRecord]) -> Array:
    """What is refused has none."""
    return np.array([x.get('evidence', 0.0) for x in lines], dtype=float)


def _above(values: Array, thresholds: Array) -> list[float]:
    above = np.count_nonzero(values >= thresholds[:, None], axis=1)
    return list((above / max(len(values), 1)).tolist())


def _compared(line: TrialRecord) -> Iterator[tuple[str, str, float | None, float | None, float]]:
    """Effect, parameter, value and standard deviation of what is rightly named, and the truth."""
    truth = {(h['effect'], h['where']): h['values'] for h in line['hidden']}
    for cause in [*line['causes'], *line['minor']]:
        known = truth.get((cause['effect'], cause['where']))
        if known is not None:
            for name, (value, std) in cause['values'].items():
                yield cause['effect'], name, value, std, known[name]


def _pulls(line: TrialRecord) -> Iterator[float]:
    """Error of every value in proportion by its standard deviation; infinite without one."""
    for effect, name, value, std, truth in _compared(line):
        role = next(p.role for p in CATALOGUE[effect].parameters if p.name == name)
        if role in PROPORTIONAL:
            if value is None or truth is None or not std:
                yield math.inf
            else:
                yield abs(value - truth) / std


def _detunings(line: TrialRecord) -> Iterator[float]:
    """Relative error of every frequency that is rightly named and known well."""
    for _, name, value, std, truth in _compared(line):
        if name in _FREQUENCIES and value and std is not None and std <= _SURE * abs(value):
            yield abs(value / truth - 1.0)


def results(records: Sequence[TrialRecord]) -> Results:
    """All scores, as `diagnosis`."""
    return {'diagnosis': score(records)}


def _sum(shares: Iterable[Share]) -> Share:
    every = list(shares)
    return Share(sum(s.hits for s in every), sum(s.total for s in every))


_LONGEST = 160  # characters of a message
_NONE = Share(0, 0)
_SHARES = {
    'clean records with a name': 'clean_named',
    'clean records called unexplained': 'clean_unexplained',
    'clean records refused': 'clean_refused',
    'effect unknown: explained with a wrong name': 'left_out_wrong',
    'effect unknown: called consistent': 'left_out_missed',
    'values within 3 standard deviations': 'within',
    'rightly explained: held-out error within 5 % of the noise floor': 'held_out',
}
_ROWS = {
    'all': 'top',
    'pairs, exactly': 'pairs',
    'triples, exactly': 'triples',
    'frequencies known to 0.3 % within 1 %': 'frequencies',
}


def shown(results: Results) -> Results:
    """With rows of the tables."""
    s = results['diagnosis']
    outcomes = [(*name.split(), of) for name, of in s['outcomes'].items()]
    named = {name: s[of] for name, of in _ROWS.items()} | s['found']
    strengths = sorted({m for of in _ROWS.values() for m in s[of]})
    refused = Counter(s['refused']).most_common()
    return {
        **results,
        'outcomes': [
            {'kind': kind, 'multiple': float(m), 'records': sum(of.values()), 'outcomes': of}
            for kind, m, of in outcomes
        ],
        'several': [
            {'kind': kind, 'multiple': m, 'least': least, 'found': s[f'{kind}s'].get(m, _NONE)}
            for (kind, m), least in _SEVERAL.items()
        ],
        'top': [
            {'multiple': m, 'least': least, 'found': s['top'].get(m, _NONE)}
            for m, least in _NAMED.items()
        ],
        'frequencies': _sum(s['frequencies'].values()),
        'shares': {what: s[name] for what, name in _SHARES.items()},
        'found': [
            {'effect': e, 'cells': {f'{m:g} x limit': by.get(m, _NONE) for m in strengths}}
            for e, by in named.items()
        ],
        'confusion': {
            name: ', '.join(f'{as_} {n}' for as_, n in Counter(counts).most_common())
            for name, counts in s['confusion'].items()
        },
        'refused': [
            {'kind': kind, 'names': names or 'nothing', 'records': n, 'message': why[:_LONGEST]}
            for (kind, names, why), n in refused
        ],
    }


def drawings(records: Sequence[TrialRecord], results: Results) -> list[Section]:
    """False alarms against detection, and who is taken for whom."""
    s = results['diagnosis']
    alarms = np.asarray(s['roc']['false_alarm'])
    curves = [
        Curve(f'{name.removeprefix("found_")} x limit', alarms, np.asarray(shares))
        for name, shares in s['roc'].items()
        if name.startswith('found_')
    ]
    what = 'share of effects whose evidence is above the threshold'
    plots = [
        Plot(
            [Panel(what, '1', curves)],
            'The threshold on the best evidence falls from left to right.',
            'share of clean records above it',
        )
    ]
    if s['confusion']:
        caption = 'Who is taken for whom, at three times the detection limit.'
        plots.append(Plot(_matrix(s['confusion']), caption))
    return [Section('Detection and confusion', plots)]


def _matrix(confusion: Mapping[str, Mapping[str, int]]) -> Matrix:
    """Hidden effects against all that was named, verdicts without a name last."""
    hidden = list(confusion)
    others = sorted({name for counts in confusion.values() for name in counts} - set(hidden))
    columns = [*hidden, *others]
    counts = np.array([[of.get(c, 0) for c in columns] for of in confusion.values()])
    return Matrix(hidden, columns, counts, 'named first')
