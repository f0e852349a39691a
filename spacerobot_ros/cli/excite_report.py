"""The HTML report of `spacerobot excite`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..display import Curve, KeyFigure, KeyFigures, Panel, Plot, Report, Section, Table, Text
from ..report.plots import plot
from .excite_tables import (
    LIMIT_HEAD,
    WHEEL_HEAD,
    figure_table,
    limit_rows,
    percent,
    std_table,
    wheel_rows,
)

if TYPE_CHECKING:
    from ..excitation.design import Design
    from ..excitation.free_base import BaseMotion
    from ..excitation.problem import Problem
    from ..excitation.summary import Summary
    from ..types import Array


def report_of(problem: Problem, design: Design, summary: Summary) -> Report:
    """The report of a design."""
    options = problem.settings.excitation
    motion = problem.all_motions(design.x)[0]
    figures, stds = figure_table(summary), std_table(summary)
    return Report(
        'Identification motion',
        f'{summary.robot}, {options.duration:g} s, {options.harmonics} harmonics, criterion '
        f'{summary.criterion}, start {summary.start}, seed {options.seed}',
        (
            Section('Prediction', (_key_figures(summary), Table(*figures), Table(*stds))),
            Section(
                'Motion',
                (
                    Plot(_joint_plot(problem, motion), 'Joints; dashed lines are limits.'),
                    Plot(_base_plot(problem, motion), 'Base, moved by the joints alone.'),
                ),
            ),
            Section('Limits', (Table(LIMIT_HEAD, limit_rows(summary.uses)),)),
            Section(
                'Own wheels',
                (Table(WHEEL_HEAD, wheel_rows(summary)), Text(f'Advice: {summary.advice}.')),
            ),
            Section('Notes', tuple(Text(note) for note in summary.notes)),
        ),
    )


def _key_figures(summary: Summary) -> KeyFigures:
    p, own = summary.design, summary.reference
    against = "file's own motion: "
    return KeyFigures(
        (
            KeyFigure(
                'information', f'{p.bits:.1f}', 'bit', f'{against}{own.bits:.1f}' if own else ''
            ),
            KeyFigure(
                'worst AAM / |h|',
                percent(p.worst_aam),
                '',
                f'{against}{percent(own.worst_aam)}' if own else '',
            ),
            KeyFigure(
                'median parameter',
                percent(p.median_parameter),
                '',
                f'{against}{percent(own.median_parameter)}' if own else '',
            ),
            KeyFigure('smallest margin', percent(1.0 - max(use.fraction for use in summary.uses))),
        )
    )


def _joint_plot(problem: Problem, motion: BaseMotion) -> str:
    limits = problem.limits
    return plot(
        [
            _panel(problem, motion.time, 'position', 'rad', motion.q[0], limits.upper),
            _panel(problem, motion.time, 'rate', 'rad/s', motion.qd[0], limits.rate),
            _panel(problem, motion.time, 'torque', 'N m', motion.torque[0], limits.torque),
        ]
    )


def _panel(
    problem: Problem, time: Array, title: str, unit: str, values: Array, limits: Array
) -> Panel:
    curves = [Curve(joint, time, values[:, j]) for j, joint in enumerate(problem.robot.joints)]
    largest = float(np.min(limits))
    shown = np.isfinite(largest) and largest < 3.0 * float(np.max(np.abs(values)))
    levels = ((largest, ''), (-largest, '')) if shown else ()
    return Panel(title, unit, curves, levels=levels)


def _base_plot(problem: Problem, motion: BaseMotion) -> str:
    rate = problem.limits.base_rate
    size = np.linalg.norm(motion.omega[0], axis=1)
    curves = [Curve(axis, motion.time, motion.omega[0, :, i]) for i, axis in enumerate('xyz')]
    curves.append(Curve('magnitude', motion.time, size))
    levels = ((rate, 'limit'),) if np.isfinite(rate) else ()
    return plot([Panel('base rate', 'rad/s', curves, levels=levels)])
