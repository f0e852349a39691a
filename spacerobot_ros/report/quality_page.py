"""What a recording is worth: tables for page and terminal, and the page's Allan plot."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..diagnosis.quality.allan import Allan
from ..diagnosis.quality.excited import TOLD, count_told
from ..diagnosis.quality.quality import Quality
from ..diagnosis.quality.readings import Reading
from ..display import (
    Curve,
    GoodOrBad,
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
from ..formats import number


def quality_page(quality: Quality) -> Report:
    """The report of a check."""
    return Report(
        'What the recording is worth',
        quality.source,
        [Section('', [_key_figures(quality)]), *quality_sections(quality)],
    )


def quality_sections(quality: Quality, *, is_whole: bool = True) -> Iterator[Section]:
    """What is said of a recording.

    Args:
        quality: The recording's.
        is_whole: Whether unknowns that are told are listed, too.
    """
    verdict = 'findings' if quality.findings else 'good'
    yield Section('', [f'verdict: {verdict}', *quality.findings])
    yield Section('sampling', [_sampling(quality)])
    if quality.delays:
        yield Section('clocks', [_delays(quality)])
    yield Section('channels', [_channels(quality.channels)])
    if quality.allan:
        yield Section('noise of the rates', [_walks(quality.allan), *_curves(quality.allan)])
    yield Section('excitation', list(_excitation(quality, is_whole)))
    yield Section('', [f'note: {note}' for note in quality.notes])


def _key_figures(quality: Quality) -> KeyFigures:
    found = quality.excitation
    count = '-' if found is None else f'{count_told(found)} of {len(found)}'
    joints = next((s for s in quality.sensors if s.sensor == 'joints'), quality.sensors[0])
    status: GoodOrBad = 'bad' if quality.findings else 'good'
    return KeyFigures(
        [
            KeyFigure('length', f'{joints.duration:.4g}', 's', f'{joints.sensor} sampled'),
            KeyFigure('findings', str(len(quality.findings)), status=status),
            KeyFigure('unknowns told', count, remark=quality.why_not),
        ]
    )


def _sampling(quality: Quality) -> Table:
    rows = [
        {'s': s, 'jitter': 1e3 * s.jitter, 'longest': s.longest_gap if s.gaps else None}
        for s in quality.sensors
    ]
    return table_of(
        rows,
        'sensor | samples | from [s] | length [s] | rate [Hz] | jitter [ms] | gaps | '
        'longest [s] | lost',
        '{s.sensor} | {s.samples} | {s.start:.4g} | {s.duration:.4g} | {s.rate:number} | '
        '{jitter:number 2} | {s.gaps} | {longest:number 3} | {s.lost:percent .2g}',
    )


def _delays(quality: Quality) -> Table:
    return table_of(
        [{'d': d, 'delay': 1e3 * d.delay, 'std': 1e3 * d.std} for d in quality.delays],
        'sensor | against the integral of | late by [ms] | +- std | makes, rms | unit',
        '{d.late} | {d.reference} | {delay:number 3} | {std:number 2} | {d.error:number 2} | '
        '{d.unit}',
    )


def _channels(channels: tuple[Reading, ...]) -> Table:
    return table_of(
        [{'c': c, 'step': c.step or None} for c in channels],
        'channel | unit | lowest | highest | step | saturated | noise seen | stated',
        '{c.channel} | {c.unit} | {c.lowest:number} | {c.highest:number} | {step:number 3} | '
        '{c.saturated:percent .2g} | {c.noise:number 3} | {c.stated:number 3}',
        'noise: standard deviation of the white part of one sample',
    )


def _walks(curves: tuple[Allan, ...]) -> Table:
    rows = []
    for a in curves:
        seen = (
            'not seen' if x is None else number(x, 3) for x in (a.white, a.random_walk, a.angle)
        )
        white, walk, angle = seen
        rows.append((a.channel, a.unit, white, walk, number(a.most_walk, 2), angle))
    head = 'white [unit/s/sqrt(Hz)]', 'random walk [unit/s/sqrt(s)]', 'a walk that would be seen'
    return Table(('rate', 'unit', *head, 'what it is compared with, white [unit]'), rows)


def _curves(curves: tuple[Allan, ...]) -> Iterator[Plot]:
    for one in curves:
        tau = np.log10(one.tau)
        terms = {
            'white': (one.white or 0.0) / np.sqrt(one.tau),
            'random walk': (one.random_walk or 0.0) * np.sqrt(one.tau / 3.0),
            'angle': np.sqrt(3.0) * (one.angle or 0.0) / one.tau,
        }
        fitted = [Curve(name, tau, y) for name, y in terms.items() if np.any(y)]
        panel = Panel(
            f'Allan deviation of {one.channel}',
            f'({one.unit})/s' if ' ' in one.unit else f'{one.unit}/s',
            [Curve('measured', tau, one.deviation), *fitted],
            log=True,
        )
        yield Plot([panel], abscissa='averaging time, log10 [s]', height=320)


def _excitation(quality: Quality, is_whole: bool) -> Iterator[Item]:
    found = quality.excitation
    if found is None:
        yield f'not computed: {quality.why_not}'
        return
    yield (
        f'{count_told(found)} of {len(found)} numbers are told: {TOLD:g} standard deviations, '
        'beside all other unknowns, are less than their plausible size'
    )
    yield table_of(
        [one for one in found if is_whole or one.status != 'told'],
        'effect | where | number | plausible size | std alone | std beside others | unit | status',
        '{effect} | {where:or } | {parameter} | {size:number 2} | {alone:number 2} | '
        '{together:number 2} | {unit:or 1} | {status}',
        '' if is_whole else 'all others are told',
    )
