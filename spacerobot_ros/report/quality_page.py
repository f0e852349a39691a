"""What a recording is worth: tables for page and terminal, and the page's Allan plot."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..diagnosis.quality.allan import Allan
from ..diagnosis.quality.excited import Excited
from ..diagnosis.quality.quality import Quality
from ..diagnosis.quality.readings import Reading
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
    table,
)
from .formats import number, percent

_DIGITS = 3


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
    told = '-' if found is None else f'{_told(found)} of {len(found)}'
    joints = next((s for s in quality.sensors if s.sensor == 'joints'), quality.sensors[0])
    return KeyFigures(
        [
            KeyFigure('length', f'{joints.duration:.4g}', 's', f'{joints.sensor} sampled'),
            KeyFigure(
                'findings',
                str(len(quality.findings)),
                status='bad' if quality.findings else 'good',
            ),
            KeyFigure('unknowns told', told, remark=quality.why_not),
        ]
    )


def _told(found: tuple[Excited, ...]) -> int:
    return sum(one.status == 'told' for one in found)


def _sampling(quality: Quality) -> Table:
    columns = {
        'sensor': lambda s: s.sensor,
        'samples': lambda s: str(s.samples),
        'from [s]': lambda s: f'{s.start:.4g}',
        'length [s]': lambda s: f'{s.duration:.4g}',
        'rate [Hz]': lambda s: number(s.rate, 4),
        'jitter [ms]': lambda s: number(1e3 * s.jitter, 2),
        'gaps': lambda s: str(s.gaps),
        'longest [s]': lambda s: number(s.longest_gap, _DIGITS) if s.gaps else '-',
        'lost': lambda s: percent(s.lost, '.2g'),
    }
    return table(quality.sensors, columns)


def _delays(quality: Quality) -> Table:
    columns = {
        'sensor': lambda d: d.late,
        'against the integral of': lambda d: d.reference,
        'late by [ms]': lambda d: number(1e3 * d.delay, _DIGITS),
        '+- std': lambda d: number(1e3 * d.std, 2),
        'makes, rms [rad]': lambda d: number(d.error, 2),
    }
    return table(quality.delays, columns)


def _channels(channels: tuple[Reading, ...]) -> Table:
    columns = {
        'channel': lambda c: c.channel,
        'unit': lambda c: c.unit,
        'lowest': lambda c: number(c.lowest, 4),
        'highest': lambda c: number(c.highest, 4),
        'step': lambda c: number(c.step, _DIGITS) if c.step else '-',
        'saturated': lambda c: percent(c.saturated, '.2g'),
        'noise seen': lambda c: number(c.noise, _DIGITS),
        'stated': lambda c: '-' if c.stated is None else number(c.stated, _DIGITS),
    }
    caption = 'noise: standard deviation of the white part of one sample'
    return table(channels, columns, caption)


def _walks(curves: tuple[Allan, ...]) -> Table:
    columns = {
        'rate': lambda a: a.channel,
        'white [rad/s/sqrt(Hz)]': lambda a: _or_unseen(a.white),
        'random walk [rad/s/sqrt(s)]': lambda a: _or_unseen(a.random_walk),
        'a walk that would be seen': lambda a: number(a.most_walk, 2),
        'angle it is compared with, white [rad]': lambda a: _or_unseen(a.angle),
    }
    return table(curves, columns)


def _or_unseen(value: float | None) -> str:
    return 'not seen' if value is None else number(value, _DIGITS)


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
            'rad/s',
            [Curve('measured', tau, one.deviation), *fitted],
            log=True,
        )
        yield Plot([panel], abscissa='averaging time, log10 [s]', height=3.0)


def _excitation(quality: Quality, is_whole: bool) -> Iterator[Item]:
    found = quality.excitation
    if found is None:
        yield f'not computed: {quality.why_not}'
        return
    yield (
        f'{_told(found)} of {len(found)} numbers are told: three standard deviations, beside all '
        'other unknowns, are less than their plausible size'
    )
    columns = {
        'effect': lambda e: e.effect,
        'where': lambda e: e.where or '',
        'number': lambda e: e.parameter,
        'plausible size': lambda e: number(e.size, 2),
        'std alone': lambda e: number(e.alone, 2),
        'std beside others': lambda e: number(e.together, 2),
        'unit': lambda e: e.unit or '1',
        'status': lambda e: e.status,
    }
    shown = [one for one in found if is_whole or one.status != 'told']
    yield table(shown, columns, '' if is_whole else 'all others are told')
