"""Plots of a diagnosis: signals, errors, spectra, ranking."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import welch

from ..display import Curve, Panel
from ..report.plots import bars, plot, thinned

if TYPE_CHECKING:
    from ..diagnosis.answer.result import Diagnosis, Series
    from ..types import Array

_SIGNALS, _SPECTRA, _RANKED = 3, 3, 12
_POINTS = 500  # a curve: a page holds many
_SEGMENT = 512  # samples, of a spectrum
_FEWEST = 128  # samples, of the same
_BEFORE, _AFTER, _MEASURED = 1, 0, 6  # colours

_KINDS = {
    'joint_torque': 'Torque on each joint that the model does not explain, half second by half '
    'second.',
    'angular_momentum': 'Torque on the whole robot that the model does not explain: the rate at '
    'which its angular momentum seems to change.',
    'joint_position': 'Joint positions against their prediction one step ahead.',
    'joint_rate': 'Joint rates against their prediction one step ahead.',
    'gyro': 'Body rates against their prediction one step ahead.',
    'attitude': 'Attitude against its prediction from the last one.',
}


def signal_plots(diagnosis: Diagnosis) -> Iterator[tuple[str, str]]:
    """Measured and simulated values of the channels that stand out most, with captions."""
    for series in _worst([s for s in diagnosis.series if len(s.measured)], _SIGNALS):
        measured = series.measured
        signal = Panel(
            _title(series),
            series.unit,
            [
                _curve('measured', series, measured, _MEASURED),
                _curve('simulated before', series, measured - series.before, _BEFORE),
                _curve('simulated after', series, measured - series.after, _AFTER),
            ],
        )
        yield plot([signal, _error_panel(series, 'measured less simulated')]), ''


def error_plots(diagnosis: Diagnosis) -> Iterator[tuple[str, str]]:
    """Errors of every channel before and after, one plot a kind, with captions."""
    for kind, group in groupby(diagnosis.series, key=lambda s: s.channel.split('/')[0]):
        panels = [_error_panel(series, _title(series)) for series in group]
        yield plot(panels, height=1.5), _KINDS.get(kind, kind)


def spectrum_plot(diagnosis: Diagnosis) -> str:
    """Amplitude spectra of the errors that stand out most; empty where there is none."""
    sampled = [s for s in diagnosis.series if len(s.measured) >= _FEWEST]
    panels = [_spectrum_panel(series) for series in _worst(sampled, _SPECTRA)]
    return plot(panels, abscissa='frequency [Hz]', height=1.9) if panels else ''


def ranking_plot(diagnosis: Diagnosis) -> str:
    """Gains of the best single effects; empty where nothing gains."""
    named = {(c.applied.effect.id, c.applied.where) for c in diagnosis.causes}
    ranked = [r for r in diagnosis.ranking[:_RANKED] if r.log_likelihood_gain > 0.0]
    if not ranked:
        return ''
    return bars(
        [r.effect + (f' at {r.where}' if r.where else '') for r in ranked],
        [2.0 * r.log_likelihood_gain for r in ranked],
        abscissa='twice the gain in log likelihood',
        marked=[(r.effect, r.where) in named for r in ranked],
    )


def _title(series: Series) -> str:
    kind, _, place = series.channel.partition('/')
    return f'{kind.replace("_", " ")}, {place}'


def _curve(name: str, series: Series, values: Array, colour: int) -> Curve:
    return Curve(name, *thinned(series.time, values, _POINTS), None, colour)


def _error_panel(series: Series, title: str) -> Panel:
    band = 3.0 * series.noise_floor
    return Panel(
        title,
        series.unit,
        [
            _curve('before', series, series.before, _BEFORE),
            _curve('after', series, series.after, _AFTER),
        ],
        levels=((band, '3 noise floors'), (-band, '')),
    )


def _spectrum_panel(series: Series) -> Panel:
    step = float(np.median(np.diff(series.time)))
    curves = []
    for name, values, colour in (
        ('before', series.before, _BEFORE),
        ('after', series.after, _AFTER),
    ):
        size = min(_SEGMENT, len(values))
        frequency, power = welch(values, fs=1.0 / step, nperseg=size, detrend=False)
        curves.append(Curve(name, frequency[1:], np.sqrt(power[1:]), None, colour))
    floor = series.noise_floor * np.sqrt(2.0 * step)
    unit = f'{series.unit}/Hz^0.5'
    return Panel(_title(series), unit, curves, log=True, levels=((floor, 'noise floor'),))


def _worst(channels: list[Series], count: int) -> list[Series]:
    """The channel of each kind whose errors stand out most, at most so many kinds.

    The attitude comes last: as a rotation vector it jumps after half a turn.
    """
    kinds: dict[str, list[Series]] = {}
    for series in channels:
        kinds.setdefault(series.channel.split('/')[0], []).append(series)
    best = [max(group, key=_excess) for group in kinds.values()]
    best.sort(key=lambda series: (series.channel.startswith('attitude'), -_excess(series)))
    return best[:count]


def _excess(series: Series) -> float:
    """How far the slow part of an error is above its noise: a sign of a wrong model."""
    if not len(series.before) or series.noise_floor <= 0.0:
        return 0.0
    pieces = np.array_split(series.before, max(1, len(series.before) // 20))
    means = np.array([piece.sum() / np.sqrt(len(piece)) for piece in pieces])
    return float(np.sqrt(np.mean(means**2)) / series.noise_floor)
