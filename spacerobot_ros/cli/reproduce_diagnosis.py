"""Page and plain data of the diagnosis campaign (`spacerobot reproduce diagnosis`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from ..report.html import Plot, Section, Table
from ..report.json_values import json_value
from ..report.plots import Curve, Panel, plot
from ..reproduce.checks import Check
from ..reproduce.diagnosis_score import Scores
from .reproduce_report import Page


def to_dict(scores: Scores, found: Sequence[Check]) -> dict[str, Any]:
    """Plain data for JSON."""
    checks = [{**check._asdict(), 'is_met': check.is_met} for check in found]
    plain: dict[str, Any] = json_value({'diagnosis': _named(asdict(scores)), 'checks': checks})
    return plain


def page(scores: Scores, found: Sequence[Check]) -> Page:
    """What the report shows."""
    counts = ', '.join(f'{n} {kind.replace("_", " ")}' for kind, n in scores.counts.items())
    return Page(
        title='Diagnosis: hidden effects, found and named',
        subtitle=f"Seeded records of the project's own plant: {counts}",
        headlines=list(found),
        figures=[Section('False alarm against detection', [_roc(scores)])],
        tables=[
            ('Found, by strength', _limits(scores)),
            ('Who is taken for whom', _confusion(scores)),
            ('Time of a diagnosis', _times(scores)),
        ],
    )


def _roc(s: Scores) -> Plot:
    alarms = np.asarray(s.roc['false_alarm'])
    curves = [
        Curve(f'{name.removeprefix("found_")} x limit', alarms, np.asarray(shares))
        for name, shares in s.roc.items()
        if name.startswith('found_')
    ]
    panel = Panel('share of effects whose evidence is above the threshold', '1', curves)
    return Plot(
        plot([panel], abscissa='share of clean records above it'),
        'The threshold on the best evidence falls from left to right.',
    )


def _limits(s: Scores) -> Table:
    strengths = sorted(s.top)
    rows = [['all', *(f'{s.top[m]:.2f}' for m in strengths)]]
    rows += [[name, *(f'{by[m]:.2f}' for m in strengths)] for name, by in s.limits.items()]
    return Table(
        ['effect', *(f'{m:g} x limit' for m in strengths)],
        rows,
        'share of records in which the first name is right, or can not be told from the right one',
    )


def _confusion(s: Scores) -> Table:
    rows = [
        [name, ', '.join(f'{said} {n}' for said, n in sorted(counts.items(), key=lambda x: -x[1]))]
        for name, counts in s.confusion.items()
    ]
    return Table(['hidden', 'named'], rows, 'at three times the detection limit')


def _times(s: Scores) -> Table:
    return Table(['median [s]', 'longest [s]'], [[f'{value:.1f}' for value in s.wall]], '')


def _named(value: Any) -> Any:
    """The same with text for every key."""
    if isinstance(value, dict):
        return {str(key): _named(item) for key, item in value.items()}
    return value
