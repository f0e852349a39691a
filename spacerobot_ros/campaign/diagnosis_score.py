"""Scores of a diagnosis campaign: who is taken for whom, how surely, from which strength on."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..effects.catalogue import CATALOGUE
from ..estimation.scaling import PROPORTIONAL
from ..types import Array
from .checks import Check
from .diagnosis_judge import (
    REFUSED,
    Line,
    hidden,
    is_exact,
    is_top,
    is_trial,
    outcome,
)
from .diagnosis_limits import Limit, physical_limits
from .shares import Share, share_of

_AT = 3.0  # of the detection limit, where the figures to reach are asked
_FREQUENCIES = ('frequency', 'harmonic')
_TUNED = 0.01  # relative error of a frequency that is found
_FLOOR = 0.05  # relative distance of the held-out error from the noise floor


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """A campaign. A record that the diagnosis refuses is a trial, and never right.

    Args:
        outcomes: Kind and strength to the number of cases by `outcome`; nothing is left out.
        refused: Kind, what was hidden, and message of what could not be diagnosed or simulated.
        top: Right first names of single effects by strength.
        pairs: Pairs with both names right, and nothing else, by strength.
        confusion: Hidden effect's id to what was found first, with counts, at 3 times the limit.
        found: Effect's id to right first names, by strength.
        limits: Effect's id to its detection limit in physical units.
        roc: False alarm share, and the share found at each strength, for falling thresholds of the
            best evidence.
        clean_named: Clean records with a name. clean_unexplained: With `unexplained`.
        clean_refused: Taken for faulty data.
        left_out_wrong: `explained` with a wrong name, the true one unknown.
        left_out_missed: `consistent`, at ten times the limit.
        within: Values within 3 standard deviations; one without a finite deviation is not.
        without_std: Number of values without a finite standard deviation.
        frequencies: Frequencies of rightly named effects within 1 %, by strength.
        held_out: Rightly explained records whose held-out error is within 5 % of the noise floor.
        wall: Median and largest time of a diagnosis [s].
    """

    outcomes: Mapping[tuple[str, float], Mapping[str, int]]
    refused: Sequence[tuple[str, str, str]]
    top: Mapping[float, Share]
    pairs: Mapping[float, Share]
    confusion: Mapping[str, Mapping[str, int]]
    found: Mapping[str, Mapping[float, Share]]
    limits: Mapping[str, Limit]
    roc: Mapping[str, Sequence[float]]
    clean_named: Share
    clean_unexplained: Share
    clean_refused: Share
    left_out_wrong: Share
    left_out_missed: Share
    within: Share
    without_std: int
    frequencies: Mapping[float, Share]
    held_out: Share
    wall: tuple[float, float]


def score(lines: Sequence[Line]) -> Scores:
    """All scores of finished cases.

    Args:
        lines: From `diagnosis_campaign.run_campaign`.
    """
    trials = [x for x in lines if is_trial(x)]
    clean, single, pair, left_out = (
        [x for x in trials if x['kind'] == kind]
        for kind in ('clean', 'single', 'pair', 'left_out')
    )
    values = [pull for x in trials for pull in _pulls(x)]
    walls = [x['wall_s'] for x in trials if x['verdict'] != REFUSED] or [0.0]
    return Scores(
        outcomes=_outcomes(lines),
        refused=[_reason(x) for x in lines if 'error' in x],
        top={m: share_of(is_top(x) for x in some) for m, some in _by_strength(single)},
        pairs={m: share_of(is_exact(x) for x in some) for m, some in _by_strength(pair)},
        confusion=_confusion([x for x in single if x['multiple'] == _AT]),
        found=_found(single),
        limits=physical_limits(lines),
        roc=_roc(clean, single),
        clean_named=_became(clean, 'named'),
        clean_unexplained=_became(clean, 'unexplained'),
        clean_refused=_became(clean, REFUSED),
        left_out_wrong=_became(left_out, 'wrong name'),
        left_out_missed=_became(left_out, 'consistent'),
        within=share_of(pull <= 3.0 for pull in values),
        without_std=sum(math.isinf(pull) for pull in values),
        frequencies={
            m: share_of(e <= _TUNED for x in some for e in _detunings(x))
            for m, some in _by_strength([*single, *pair])
        },
        held_out=share_of(
            abs(x['after'] - 1.0) <= _FLOOR
            for x in [*single, *pair]
            if x['verdict'] == 'explained' and is_exact(x)
        ),
        wall=(float(np.median(walls)), float(np.max(walls))),
    )


def _by_strength(lines: Sequence[Line]) -> Iterator[tuple[float, list[Line]]]:
    for m in sorted({x['multiple'] for x in lines}):
        yield m, [x for x in lines if x['multiple'] == m]


def _became(lines: Sequence[Line], what: str) -> Share:
    return share_of(outcome(x) == what for x in lines)


def _outcomes(lines: Sequence[Line]) -> dict[tuple[str, float], dict[str, int]]:
    counts: dict[tuple[str, float], Counter[str]] = {}
    for line in lines:
        counts.setdefault((line['kind'], line['multiple']), Counter())[outcome(line)] += 1
    return {key: dict(of.most_common()) for key, of in sorted(counts.items())}


def _reason(line: Line) -> tuple[str, str, str]:
    names = ', '.join(e if w is None else f'{e} at {w}' for e, w in hidden(line))
    return line['kind'], names, line['error']


def _confusion(lines: Sequence[Line]) -> dict[str, dict[str, int]]:
    out: dict[str, Counter[str]] = {}
    for line in lines:
        (name, _), *_ = hidden(line)
        first = next(iter([*line['causes'], *line['minor']]), None)
        said = name if is_top(line) else line['verdict'] if first is None else first['effect']
        if first is not None and first['effect'] == name and not is_top(line):
            said = f'{name} elsewhere'
        out.setdefault(name, Counter())[said] += 1
    return {name: dict(counts) for name, counts in sorted(out.items())}


def _found(lines: Sequence[Line]) -> dict[str, dict[float, Share]]:
    by: dict[str, list[Line]] = {}
    for line in lines:
        by.setdefault(hidden(line)[0][0], []).append(line)
    return {
        name: {m: share_of(is_top(x) for x in some) for m, some in _by_strength(own)}
        for name, own in sorted(by.items())
    }


def _roc(clean: Sequence[Line], singles: Sequence[Line]) -> dict[str, list[float]]:
    """Shares above every threshold that a record's best evidence gives."""
    quiet = _evidence(clean)
    loud = {m: _evidence(some) for m, some in _by_strength(singles)}
    thresholds = np.sort(np.concatenate([quiet, *loud.values(), [0.0]]))[::-1]
    out = {'threshold': thresholds.tolist(), 'false_alarm': _above(quiet, thresholds)}
    return out | {f'found_{m:g}': _above(values, thresholds) for m, values in loud.items()}


def _evidence(lines: Sequence[Line]) -> Array:
    """What is refused has none."""
    return np.array([x.get('evidence', 0.0) for x in lines], dtype=float)


def _above(values: Array, thresholds: Array) -> list[float]:
    if not len(values):
        return [0.0] * len(thresholds)
    return [float(np.mean(values >= t)) for t in thresholds]


def _compared(line: Line) -> Iterator[tuple[str, str, float | None, float | None, float]]:
    """Effect, parameter, value and standard deviation of what is rightly named, and the truth."""
    truth = {(h['effect'], h['where']): h['values'] for h in line['hidden']}
    for cause in [*line['causes'], *line['minor']]:
        known = truth.get((cause['effect'], cause['where']))
        if known is not None:
            for name, (value, std) in cause['values'].items():
                yield cause['effect'], name, value, std, known[name]


def _pulls(line: Line) -> Iterator[float]:
    """Error of every value in proportion by its standard deviation; infinite without one."""
    for effect, name, value, std, truth in _compared(line):
        role = next(p.role for p in CATALOGUE[effect].parameters if p.name == name)
        if role in PROPORTIONAL:
            if value is None or truth is None or not std:
                yield math.inf
            else:
                yield abs(value - truth) / std


def _detunings(line: Line) -> Iterator[float]:
    """Relative error of every frequency that is rightly named."""
    for _, name, value, _, truth in _compared(line):
        if name in _FREQUENCIES:
            yield math.inf if value is None else abs(value / truth - 1.0)


def campaign_checks(s: Scores) -> list[Check]:
    """The figures to reach."""
    none = Share(0, 0)
    tuned = [share for m, share in s.frequencies.items() if m >= _AT]
    wanted = [
        (f'first name right at {_AT:g} times the limit', s.top.get(_AT, none), 0.95, 1.0),
        (f'pairs exactly right at {_AT:g} times the limit', s.pairs.get(_AT, none), 0.85, 1.0),
        ('values within 3 standard deviations', s.within, 0.95, 1.0),
        (f'frequencies within 1 % from {_AT:g} times the limit on', _sum(tuned), 0.95, 1.0),
        ('held-out error within 5 % of the noise floor, explained', s.held_out, 0.95, 1.0),
        ('clean records with a name', s.clean_named, 0.0, 0.01),
        ('clean records called unexplained', s.clean_unexplained, 0.0, 0.01),
        ('clean records refused', s.clean_refused, 0.0, 0.01),
        ('wrong names under explained, the effect unknown', s.left_out_wrong, 0.0, 0.0),
        ('called consistent, the effect unknown', s.left_out_missed, 0.0, 0.0),
    ]
    return [Check(what, v.value, low, high) for what, v, low, high in wanted if v.total]


def _sum(shares: Sequence[Share]) -> Share:
    return Share(sum(s.hits for s in shares), sum(s.total for s in shares))
