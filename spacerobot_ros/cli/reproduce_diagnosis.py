"""Page, files and plain data of the diagnosis campaign (`spacerobot reproduce diagnosis`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from ..campaign.checks import Check
from ..campaign.diagnosis_score import Scores
from ..campaign.shares import Share
from ..display import Curve, Panel, Plot, Section
from ..json_values import json_value
from ..report.markdown import markdown
from ..report.plots import matrix, plot
from .reproduce_diagnosis_tables import tables
from .reproduce_report import Page

_TITLE = 'Diagnosis: hidden effects, found and named'
MARKDOWN, ROC, CONFUSION = 'diagnosis.md', 'diagnosis_roc.svg', 'diagnosis_confusion.svg'
"""Files beside the report: all tables, false alarms against detection, who is taken for whom."""


def to_dict(scores: Scores, found: Sequence[Check]) -> dict[str, Any]:
    """Plain data for JSON; a share has its hits, trials and 95 % interval."""
    checks = [{**check._asdict(), 'is_met': check.is_met} for check in found]
    plain: dict[str, Any] = json_value({'diagnosis': _plain(scores), 'checks': checks})
    return plain


def page(scores: Scores, found: Sequence[Check]) -> Page:
    """What the report shows."""
    counts: dict[str, int] = {}
    for (kind, _), of in scores.outcomes.items():
        name = kind.replace('_', ' ')
        counts[name] = counts.get(name, 0) + sum(of.values())
    shown, roc = tables(scores), _roc(scores)
    files = {MARKDOWN: markdown(_TITLE, [Section(t, [x]) for t, x in shown]), ROC: roc}
    figures = [Plot(roc, 'The threshold on the best evidence falls from left to right.')]
    if scores.confusion:
        files[CONFUSION] = _confusion(scores)
        caption = 'Who is taken for whom, at three times the detection limit.'
        figures.append(Plot(files[CONFUSION], caption))
    listed = ', '.join(f'{n} {name}' for name, n in counts.items())
    return Page(
        title=_TITLE,
        subtitle=f"Seeded records of the project's own plant: {listed}",
        headlines=list(found),
        figures=[Section('Detection and confusion', figures)],
        tables=shown,
        files=files,
    )


def _roc(s: Scores) -> str:
    alarms = np.asarray(s.roc['false_alarm'])
    curves = [
        Curve(f'{name.removeprefix("found_")} x limit', alarms, np.asarray(shares))
        for name, shares in s.roc.items()
        if name.startswith('found_')
    ]
    panel = Panel('share of effects whose evidence is above the threshold', '1', curves)
    return plot([panel], abscissa='share of clean records above it') + '\n'


def _confusion(s: Scores) -> str:
    """Hidden effects against all that was said, verdicts without a name last."""
    hidden = list(s.confusion)
    others = sorted({said for counts in s.confusion.values() for said in counts} - set(hidden))
    columns = [*hidden, *others]
    counts = np.array([[of.get(c, 0) for c in columns] for of in s.confusion.values()])
    return matrix(hidden, columns, counts, abscissa='named first') + '\n'


def _plain(value: Any) -> Any:
    """The same in dicts with text for every key, lists and numbers."""
    if isinstance(value, Share):
        low, high = value.interval
        return {**value._asdict(), 'value': value.value, 'low': low, 'high': high}
    if is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, dict):
        return {_key(key): _plain(item) for key, item in value.items()}
    return value


def _key(key: Any) -> str:
    return ' '.join(map(str, key)) if isinstance(key, tuple) else str(key)
