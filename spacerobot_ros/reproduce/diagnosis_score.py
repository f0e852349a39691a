"""Scores of a diagnosis campaign: who is taken for whom, how surely, from which strength on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..types import Array
from .checks import Check

Line = dict[str, Any]
_AT = 3.0  # of the detection limit, where the figures to reach are asked
_ALMOST = 0.5  # of the strength asked for; effects that bounds keep weaker are left out


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """A campaign.

    Args:
        counts: Number of cases by kind.
        top: Share of right first names by strength.
        confusion: Hidden effect's id to what was found first, with counts, at 3 times the limit.
        limits: Effect's id to share found, by strength.
        roc: False alarm share, and the share found at each strength, for falling thresholds of the
            best evidence.
        clean_named: Share of clean records with a name. clean_unexplained: With `unexplained`.
        left_out_wrong: Share of `explained` with a wrong name, the true one unknown.
        pairs: Share of pairs with both names right, and nothing else.
        within: Share of values within 3 standard deviations.
        wall: Median and largest time of a diagnosis [s].
    """

    counts: Mapping[str, int]
    top: Mapping[float, float]
    confusion: Mapping[str, Mapping[str, int]]
    limits: Mapping[str, Mapping[float, float]]
    roc: Mapping[str, Sequence[float]]
    clean_named: float
    clean_unexplained: float
    left_out_wrong: float
    pairs: float
    within: float
    wall: tuple[float, float]


def score(lines: Sequence[Line]) -> Scores:
    """All scores of finished cases.

    Args:
        lines: From `diagnosis_campaign.run_campaign`.
    """
    lines = [x for x in lines if x['verdict'] != 'refused']
    kinds = {k: [x for x in lines if x['kind'] == k] for k in ('clean', 'left_out', 'pair')}
    singles = [
        x
        for x in lines
        if x['kind'] == 'single' and x['hidden'] and x['strength'] > _ALMOST * x['multiple']
    ]
    strengths = sorted({x['multiple'] for x in singles})
    at = [x for x in singles if x['multiple'] == _AT]
    walls = [x['wall_s'] for x in lines] or [0.0]
    return Scores(
        counts=Counter(x['kind'] for x in lines),
        top={m: _share([is_top(x) for x in singles if x['multiple'] == m]) for m in strengths},
        confusion=_confusion(at),
        limits=_limits(singles, strengths),
        roc=_roc(kinds['clean'], singles, strengths),
        clean_named=_share([bool(x['causes']) for x in kinds['clean']]),
        clean_unexplained=_share([x['verdict'] == 'unexplained' for x in kinds['clean']]),
        left_out_wrong=_share(
            [x['verdict'] == 'explained' and bool(x['causes']) for x in kinds['left_out']]
        ),
        pairs=_share([is_exact(x) for x in kinds['pair'] if x['hidden']]),
        within=_share([v for x in lines for v in _within(x)]),
        wall=(float(np.median(walls)), float(np.max(walls))),
    )


def found(line: Line) -> list[set[tuple[str, str | None]]]:
    """Everything fitted, named or too small to matter, with what it can't be told from."""
    return [
        {(c['effect'], c['where']), *((e, w) for e, w in c['rivals'])}
        for c in [*line['causes'], *line['minor']]
    ]


def is_top(line: Line) -> bool:
    """Whether the first of all found is one that was hidden."""
    groups, names = found(line), _hidden(line)
    return bool(groups) and any(name in groups[0] for name in names)


def is_exact(line: Line) -> bool:
    """Whether everything hidden was found, and nothing else."""
    groups, names = found(line), _hidden(line)
    return len(groups) == len(names) and all(any(n in g for g in groups) for n in names)


def _hidden(line: Line) -> list[tuple[str, str | None]]:
    return [(h['effect'], h['where']) for h in line['hidden']]


def _share(values: Sequence[bool]) -> float:
    return float(np.mean(values)) if values else float('nan')


def _confusion(lines: Sequence[Line]) -> dict[str, dict[str, int]]:
    out: dict[str, Counter[str]] = {}
    for line in lines:
        (name, _), *_ = _hidden(line)
        first = next(iter([*line['causes'], *line['minor']]), None)
        said = name if is_top(line) else line['verdict'] if first is None else first['effect']
        out.setdefault(name, Counter())[said] += 1
    return {name: dict(counts) for name, counts in sorted(out.items())}


def _limits(lines: Sequence[Line], strengths: Sequence[float]) -> dict[str, dict[float, float]]:
    names = sorted({_hidden(x)[0][0] for x in lines})
    return {
        name: {
            m: _share(
                [is_top(x) for x in lines if x['multiple'] == m and _hidden(x)[0][0] == name]
            )
            for m in strengths
        }
        for name in names
    }


def _roc(
    clean: Sequence[Line], singles: Sequence[Line], strengths: Sequence[float]
) -> dict[str, list[float]]:
    """Shares above every threshold that a record's best evidence gives."""
    quiet = _evidence(clean)
    loud = {m: _evidence([x for x in singles if x['multiple'] == m]) for m in strengths}
    thresholds = np.sort(np.concatenate([quiet, *loud.values(), [0.0]]))[::-1]
    out = {'threshold': thresholds.tolist(), 'false_alarm': _above(quiet, thresholds)}
    return out | {f'found_{m:g}': _above(values, thresholds) for m, values in loud.items()}


def _evidence(lines: Sequence[Line]) -> Array:
    return np.array([x['evidence'] for x in lines if 'evidence' in x], dtype=float)


def _above(values: Array, thresholds: Array) -> list[float]:
    if not len(values):
        return [0.0] * len(thresholds)
    return [float(np.mean(values >= t)) for t in thresholds]


def _within(line: Line) -> list[bool]:
    """Whether each value of a rightly named cause is within 3 standard deviations."""
    truth = {(h['effect'], h['where']): h['values'] for h in line['hidden']}
    return [
        abs(value - truth[c['effect'], c['where']][name]) <= 3.0 * std
        for c in [*line['causes'], *line['minor']]
        if (c['effect'], c['where']) in truth
        for name, (value, std) in c['values'].items()
        if value is not None and std is not None
    ]


def campaign_checks(s: Scores) -> list[Check]:
    """The figures to reach."""
    wanted = [
        (f'first name right at {_AT:g} times the limit', s.top.get(_AT, float('nan')), 0.95, 1.0),
        ('pairs exactly right', s.pairs, 0.85, 1.0),
        ('values within 3 standard deviations', s.within, 0.95, 1.0),
        ('clean records with a name', s.clean_named, 0.0, 0.01),
        ('clean records called unexplained', s.clean_unexplained, 0.0, 0.01),
        ('wrong names under explained, the effect unknown', s.left_out_wrong, 0.0, 0.0),
    ]
    return [Check(what, v, low, high) for what, v, low, high in wanted if np.isfinite(v)]
