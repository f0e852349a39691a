"""A designed identification motion: tables for page and terminal, and the page's plots."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from ..display import (
    Curve,
    Item,
    KeyFigure,
    KeyFigures,
    Panel,
    Plot,
    Report,
    Section,
    Table,
    table_of,
)
from ..estimation.trajectory.base_response import BaseMotion
from ..excitation.assessment import Summary
from ..excitation.precision import Prediction
from ..excitation.problem import Problem
from ..excitation.separation import Place, Separated
from ..formats import number, percent
from ..types import Array

_FIGURES: dict[str, Callable[[Prediction], str]] = {
    'worst AAM [N m s]': lambda p: number(p.aam_std, 3),
    'worst AAM, bodies as uncertain as stated [N m s]': lambda p: number(p.aam_std_as_stated, 3),
    'AAM valid up to [N m s]': lambda p: number(p.aam_limit, 3),
    'information [bit]': lambda p: f'{p.bits:.1f}',
    'of the AAM alone [bit]': lambda p: f'{p.aam_bits:.1f}',
    'directions told': lambda p: f'{p.told} of {p.tellable}',
    'condition of A': lambda p: f'{p.condition:.4g}',
    'condition, unit columns': lambda p: f'{p.unit_condition:.4g}',
    'worst AAM / |h|': lambda p: _percent(p.worst_aam),
    'median parameter': lambda p: _percent(p.median_parameter),
    'worst parameter': lambda p: _percent(p.worst_parameter),
    'common scale': lambda p: _percent(p.scale_std),
}
_HEADLINES = (
    'worst AAM [N m s]',
    'worst AAM, bodies as uncertain as stated [N m s]',
    'worst AAM / |h|',
    'median parameter',
)
_NESTED = 1e-3  # sine of the angle between signatures; below, one is a special case of the other


def excitation_page(summary: Summary) -> Report:
    """The report of a design."""
    problem = summary.problem
    options = problem.settings.excitation
    chosen, nodes = summary.chosen, len(problem.fine.times)
    family = chosen.family.at(np.linspace(0.0, chosen.family.duration, nodes))
    motion = problem.moves(chosen.x[None], family, chosen.start)[0]
    plots = [
        Plot(partial(_joints, problem, motion), 'Joints; dashed lines are limits.'),
        Plot(partial(_base, problem, motion), 'Base, moved by the joints alone.'),
    ]
    first = [Section('Prediction', [_key_figures(summary)]), Section('Motion', plots)]
    return Report(
        'Identification motion',
        f'{problem.robot.name}, {family.duration:g} s, {family.harmonics} harmonics, criterion '
        f'{options.criterion}, start {problem.start_kind}, seed {options.seed}',
        [*first, *excitation_sections(summary)],
    )


def excitation_sections(summary: Summary) -> list[Section]:
    """Everything that is told of a design in words and tables."""
    problem = summary.problem
    identifier = problem.settings.identifier
    omega = ', '.join(f'{w:.4g}' for w in summary.chosen.start.omega)
    tried = ', '.join(f'{a.cost:.4g}' for a in summary.found.attempts)
    first = (
        f'{problem.robot.name}: {problem.settings.excitation.criterion}, {identifier.structure} '
        f'structure; start {problem.start_kind}, base rate [{omega}] rad/s'
    )
    last = [f'advice: {summary.advice}', *(f'note: {note}' for note in summary.notes)]
    return [
        Section('', [first, f'cost of each start: {tried}', *filter(None, [summary.headline])]),
        Section('limits, the largest use of each', [_limits(summary)]),
        Section('what identify will find', [_figures(summary)]),
        Section('standard deviations', [_stds(summary)]),
        Section("servicer's own wheels, the same joint motion", [_wheels(summary)]),
        Section('', last),
    ]


def separation_section(first: Place, second: Place, found: Separated) -> Section:
    """What is told of a motion that tells two effects apart."""
    best = found.best
    head = (
        f'best of {found.tried} motions: {best.origin}, {best.motions.family.duration:g} s; '
        "told apart: noise standard deviations of the part of an effect's plausible size that "
        'the other can not imitate'
    )
    rows = [
        {'of': of.name, 'other': other.name, 'seen': seen, 'motion': name}
        for name, trial in (('this one', best), ('robot file', found.own))
        if trial is not None
        for of, other, seen in ((first, second, trial.first), (second, first, trial.second))
    ]
    heads = 'effect | from | seen | told apart | smallest told, of plausible size | motion'
    cells = '{of} | {other} | {seen.visible:.4g} | {seen.apart:.4g} | {seen.smallest:number 3}'
    items: list[Item] = [head, table_of(rows, heads, cells + ' | {motion}')]
    if min(best.first.sine, best.second.sine) < _NESTED:
        items.append(
            'note: one of them is all but a special case of the other; no motion tells it '
            'from the more general one'
        )
    return Section('', items)


def _key_figures(summary: Summary) -> KeyFigures:
    design, own = summary.design, summary.reference

    def figure(name: str, of: Callable[[Prediction], str], unit: str = '') -> KeyFigure:
        return KeyFigure(name, of(design), unit, f"file's own motion: {of(own)}" if own else '')

    margin = 1.0 - max(use.fraction for use in summary.uses)
    return KeyFigures(
        [
            figure('information', _FIGURES['information [bit]'], 'bit'),
            *(figure(name, _FIGURES[name]) for name in _HEADLINES),
            KeyFigure('smallest margin', _percent(margin)),
        ]
    )


def _limits(summary: Summary) -> Table:
    rows = []
    for u in summary.uses:
        allowed, margin = 'none', ''
        if math.isfinite(u.limit):
            allowed, margin = f'{u.limit:.4g}', percent(1.0 - u.fraction, '.2g')
        name = u.name.replace('_', ' ')
        rows.append((name, u.where, f'{u.value:.4g}', allowed, u.unit, margin))
    return Table(('limit', 'where', 'reached', 'allowed', 'unit', 'margin'), rows)


def _predictions(summary: Summary) -> dict[str, Prediction]:
    named = {
        'design': summary.design,
        'with rest': summary.with_rest,
        "file's own motion": None if summary.is_own else summary.reference,
        'search': summary.searched if summary.is_own else None,
    }
    return {name: p for name, p in named.items() if p is not None}


def _figures(summary: Summary) -> Table:
    """Key figures of every prediction."""
    shown = _predictions(summary)
    rows = [(name, *(of(p) for p in shown.values())) for name, of in _FIGURES.items()]
    return Table(('figure', *shown), rows)


def _stds(summary: Summary) -> Table:
    """Every wheel-momentum component and parameter."""
    shown, design = _predictions(summary), summary.design
    rows = []
    for i, name in enumerate(design.names):
        stds = (f'{p.std[i]:.3g}' for p in shown.values())
        rows.append((name, f'{design.values[i]:.5g}', design.units[i], *stds))
    return Table(('unknown', 'value', 'unit', *(f'+- {name}' for name in shown)), rows)


def _wheels(summary: Summary) -> Table:
    rows = []
    for o in summary.wheels:
        size, limits = float(np.linalg.norm(o.momentum)), 'kept' if o.allowed else 'broken'
        rows.append({'o': o, 'p': o.prediction, 'size': size, 'limits': limits})
    return table_of(
        rows,
        'own wheels | |h0| [N m s] | common scale | worst AAM | median x | limits',
        'x{o.factor:g} | {size:.4g} | {p.scale_std:percent .3g} | {p.worst_aam:percent .3g} | '
        '{p.median_parameter:percent .3g} | {limits}',
    )


def _percent(value: float) -> str:
    return percent(value, '.3g')


def _joints(problem: Problem, motion: BaseMotion) -> list[Panel]:
    limits = problem.limits
    of = problem.robot.unit_of
    shown = (
        ('position', of('rad'), motion.q[0], limits.upper),
        ('rate', f'{of("rad")}/s', motion.qd[0], limits.rate),
        ('torque', of('N m'), motion.torque[0], limits.torque),
    )
    return [_joint_panel(problem, motion.time, *one) for one in shown]


def _joint_panel(
    problem: Problem, time: Array, title: str, unit: str, values: Array, limits: Array
) -> Panel:
    curves = [Curve(joint, time, values[:, j]) for j, joint in enumerate(problem.robot.joints)]
    largest = float(np.min(limits))
    shown = np.isfinite(largest) and largest < 3.0 * float(np.max(np.abs(values)))
    levels = ((largest, ''), (-largest, '')) if shown else ()
    return Panel(title, unit, curves, levels=levels)


def _base(problem: Problem, motion: BaseMotion) -> list[Panel]:
    rate = problem.limits.base_rate
    size = np.linalg.norm(motion.omega[0], axis=1)
    curves = [Curve(axis, motion.time, motion.omega[0, :, i]) for i, axis in enumerate('xyz')]
    curves.append(Curve('magnitude', motion.time, size))
    levels = ((rate, 'limit'),) if np.isfinite(rate) else ()
    return [Panel('base rate', 'rad/s', curves, levels=levels)]
