"""Page and plain data of the monitor campaign (`spacerobot reproduce monitor`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ..campaign.checks import Check
from ..campaign.monitor_campaign import MonitorScores
from ..campaign.monitor_faults import FAULTS
from ..display import Section, Table
from ..json_values import json_value
from ..report.markdown import markdown
from .reproduce_report import Page

_TITLE = 'Monitor: false alarms, and delays of detection'
MARKDOWN = 'monitor.md'
"""File beside the report: all tables."""


def to_dict(scores: MonitorScores, found: Sequence[Check]) -> dict[str, Any]:
    """Plain data for JSON."""
    faults = [
        {'robot': robot, 'fault': name, 'size': size, 'unit': FAULTS[name].unit, **own}
        for (robot, name, size), own in scores.faults.items()
    ]
    monitor = {'nominal': scores.nominal, 'faults': faults}
    checks = [{**check._asdict(), 'is_met': check.is_met} for check in found]
    plain: dict[str, Any] = json_value({'monitor': monitor, 'checks': checks})
    return plain


def page(scores: MonitorScores, found: Sequence[Check]) -> Page:
    """What the report shows."""
    tables = [('Nominal flight', _nominal(scores)), ('Faults', _faults(scores))]
    return Page(
        title=_TITLE,
        subtitle='Seeded flights in closed loop, random motions, noise of the robot files',
        headlines=[check for check in found if check.what.startswith('alarms')],
        figures=[],
        tables=tables,
        files={MARKDOWN: markdown(_TITLE, [Section(t, [x]) for t, x in tables])},
    )


def _nominal(s: MonitorScores) -> Table:
    rows = [
        [
            robot,
            str(own['flights']),
            f'{own["hours"]:.3g}',
            str(own['alarms']),
            f'{own["largest_evidence"]:.2f}',
            f'{100.0 * own["share_of_a_core"]:.0f}',
        ]
        for robot, own in s.nominal.items()
    ]
    head = ['robot', 'flights', 'hours', 'alarms', 'largest evidence', 'share of a core [%]']
    return Table(head, rows, 'evidence over threshold: an alarm is raised at 1')


def _faults(s: MonitorScores) -> Table:
    rows = [
        [
            robot,
            name.replace('_', ' '),
            f'{size:g} {FAULTS[name].unit}',
            f'{own["raised"]} of {own["flights"]}',
            _seconds(own['delay']),
            _seconds(own['cleared']),
            ', '.join(own['first']),
        ]
        for (robot, name, size), own in s.faults.items()
    ]
    head = ['robot', 'fault', 'size', 'raised', 'delay [s]', 'ended after [s]', 'spoke first']
    return Table(head, rows, 'medians, from onset and end of the fault, by the time of the data')


def _seconds(value: float) -> str:
    return f'{value:.0f}' if math.isfinite(value) else '-'
