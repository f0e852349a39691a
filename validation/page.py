"""What a campaign shows: its page, its tables, which figures are reached."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from spacerobot_ros.batch.runner import Finished
from spacerobot_ros.display import (
    GoodOrBad,
    KeyFigure,
    KeyFigures,
    Report,
    Section,
    Table,
    markdown,
    table_of,
)
from spacerobot_ros.model.files import write_text
from spacerobot_ros.report.html import write_report

from .campaigns import Campaign, Check


def write_page(
    campaign: Campaign,
    checks: Sequence[Check],
    plots: Sequence[Section],
    tables: Sequence[Section],
    folder: Path,
) -> Path:
    """Write `report.html`, and tables that are kept beside it; returns its path."""
    if campaign.markdown:
        write_text(folder / campaign.markdown, markdown(campaign.title, tables))
    asked = Section('Figures to reach', [_key_figures(campaign, checks), _checks(checks)])
    report = Report(campaign.title, campaign.subtitle, [asked, *plots, *tables])
    return write_report(report, folder / 'report.html')


def _key_figures(campaign: Campaign, checks: Sequence[Check]) -> KeyFigures:
    met = sum(check.is_met for check in checks)
    total = f'{met} of {len(checks)}'
    figures = [KeyFigure('figures reached', total, status=_status(met == len(checks)))]
    for c in checks:
        if re.search(campaign.headlines, c.what):
            wanted = f'wanted: {c.low:.4g} to {c.high:.4g}'
            figures.append(KeyFigure(c.what, f'{c.value:.4g}', c.unit, wanted, _status(c.is_met)))
    return KeyFigures(figures)


def _status(is_good: bool) -> GoodOrBad:
    return 'good' if is_good else 'bad'


def _checks(checks: Sequence[Check]) -> Table:
    return table_of(
        [{'c': c, 'reached': 'yes' if c.is_met else 'NO'} for c in checks],
        'figure | value | from | to | unit | reached',
        '{c.what} | {c.value:.4g} | {c.low:.4g} | {c.high:.4g} | {c.unit} | {reached}',
    )


def missed(checks: Sequence[Check]) -> list[str]:
    """How many figures are reached, and which are not."""
    missed = [check for check in checks if not check.is_met]
    return [
        f'{len(checks) - len(missed)} of {len(checks)} figures are reached',
        *(
            f'missed: {c.what}: {c.value:.4g} (wanted: {c.low:g} to {c.high:g} {c.unit})'
            for c in missed
        ),
    ]


def failed(found: Finished) -> list[str]:
    """Trials that gave no record, and why."""
    return [f'failed: {key}: {why}' for key, why in found.failures.items()]
