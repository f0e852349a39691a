"""Report of `spacerobot reproduce`: key figures, the paper's figures redrawn, all tables."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..campaign.checks import Check
from ..campaign.tracking import TrackingRun
from ..campaign.wheel_momentum import Reproduction
from ..display import (
    Curve,
    Item,
    KeyFigure,
    KeyFigures,
    Panel,
    Plot,
    Report,
    Section,
    Status,
    Table,
)
from ..errors import ConfigurationError
from ..report.html import write_report
from ..report.plots import plot
from .reproduce_tables import tables

_JOINTS = ('joint 1', 'joint 2', 'joint 3')


def prepare(folder: Path) -> None:
    """Make the folder before the work is done, not after.

    Raises:
        ConfigurationError: it can't be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / 'results.json').write_text('', encoding='utf-8')
    except OSError as error:
        raise ConfigurationError(str(folder), f'can not be written: {error.strerror}') from error


@dataclass(frozen=True, slots=True)
class Page:
    """What a report shows of one experiment.

    Args:
        title: Title of the page.
        subtitle: One line below it.
        headlines: Checks to show as key figures.
        figures: Sections with the redrawn figures.
        tables: Title and table of every experiment.
        files: Name and text of what is written beside it.
    """

    title: str
    subtitle: str
    headlines: Sequence[Check]
    figures: Sequence[Section]
    tables: Sequence[tuple[str, Table]]
    files: Mapping[str, str] = field(default_factory=dict)


def write(page: Page, found: list[Check], folder: Path, data: dict[str, Any]) -> Path:
    """Write `report.html`, `results.json` and the page's files; returns the page's path.

    Raises:
        ConfigurationError: the folder can't be written.
    """
    sections = [Section('Figures to reach', [_key_figures(page, found), _checks(found)])]
    sections += page.figures
    sections += [Section(title, [table]) for title, table in page.tables]
    path = write_report(Report(page.title, page.subtitle, sections), folder / 'report.html')
    results = json.dumps(data, indent=2, allow_nan=False) + '\n'
    for name, text in {'results.json': results, **page.files}.items():
        (folder / name).write_text(text, encoding='utf-8')
    return path


def wheel_momentum_page(results: Reproduction, found: list[Check]) -> Page:
    """The page of the wheel-momentum paper."""
    chosen = [c for c in found if 'symmetric moving' in c.what and c.what.startswith('condition')]
    chosen += [c for c in found if 'zyx, no_aam, correct' in c.what]
    return Page(
        'Wheel-momentum identification, reproduced',
        'Robot of Table I, motion of Table II; seeded, joint axes named by their letters',
        chosen,
        [_figures(results, axes) for axes in results.noisy_axes],
        tables(results),
    )


def _key_figures(page: Page, found: list[Check]) -> KeyFigures:
    met = sum(check.is_met for check in found)
    total = KeyFigure(
        'figures reached', f'{met} of {len(found)}', status='good' if met == len(found) else 'bad'
    )
    return KeyFigures([total, *(_key_figure(check) for check in page.headlines)])


def _key_figure(check: Check) -> KeyFigure:
    remark = f'wanted: {check.low:.4g} to {check.high:.4g}'
    status: Status = 'good' if check.is_met else 'bad'
    return KeyFigure(check.what, f'{check.value:.4g}', check.unit, remark, status)


def _checks(found: list[Check]) -> Table:
    rows = [
        [
            c.what,
            f'{c.value:.4g}',
            f'{c.low:.4g}',
            f'{c.high:.4g}',
            c.unit,
            'yes' if c.is_met else 'NO',
        ]
        for c in found
    ]
    return Table(['figure', 'value', 'from', 'to', 'unit', 'reached'], rows)


def _figures(results: Reproduction, axes: str) -> Section:
    knowing = results.run_of(axes, 'correct', 'corrected', 1.0)
    unknowing = results.run_of(axes, 'correct', 'no_aam', 1.0)
    items: list[Item] = [
        Plot(
            plot([_torques(knowing), _rates(knowing)]),
            'Fig. 4: joint torques and body rate, wheels known (1 rad/s, correct plant).',
        ),
        Plot(
            plot([_torques(unknowing), _rates(unknowing)]),
            'Fig. 5: the same, wheels unknown to the law.',
        ),
        Plot(
            plot([_errors(knowing, 'wheels known'), _errors(unknowing, 'wheels unknown')]),
            'Fig. 6: joint errors; what is left with the wheels known is the integrator.',
        ),
        Plot(plot([_end_effector(results, axes)]), 'Fig. 7: end-effector error, base frame.'),
    ]
    return Section(f'Figures 4 to 7, axes {axes}', items)


def _torques(run: TrackingRun) -> Panel:
    return Panel('joint torques', 'N m', _curves(run.time, run.torque, _JOINTS))


def _rates(run: TrackingRun) -> Panel:
    return Panel('body rate', 'rad/s', _curves(run.time, run.omega_WB_B, ('x', 'y', 'z')))


def _errors(run: TrackingRun, what: str) -> Panel:
    degrees = np.abs(np.rad2deg(run.joint_error))
    return Panel(f'joint errors, {what}', 'deg', _curves(run.time, degrees, _JOINTS), log=True)


def _end_effector(results: Reproduction, axes: str) -> Panel:
    laws = {'no_aam': 'wheels unknown (37)', 'paper': "paper's law (35)", 'corrected': 'corrected'}
    curves = []
    for law, label in laws.items():
        run = results.run_of(axes, 'correct', law, 1.0)
        curves.append(Curve(label, run.time, run.end_effector_error))
    for run in results.soft:
        if run.axes == axes and run.plant == 'correct':
            label = f'wheels unknown, {run.bandwidth:.2f} rad/s'
            curves.append(Curve(label, run.time, run.end_effector_error))
    return Panel('end-effector error', 'm', curves, log=True)


def _curves(time: np.ndarray, values: np.ndarray, labels: tuple[str, ...]) -> list[Curve]:
    return [Curve(label, time, values[:, i]) for i, label in enumerate(labels)]
