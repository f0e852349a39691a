"""Curves of a diagnosis: signals, prediction errors and their spectra."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import welch

from ..diagnosis.answer.result import Diagnosis, Series
from ..display import Curve, Panel
from ..types import Array

_SEGMENT = 512  # samples, of a spectrum
_COLORS = {'measured': 6, 'before': 1, 'after': 0, 'simulated before': 1, 'simulated after': 0}
Span = tuple[float, float, str]


def signal_panels(series: Series) -> list[Panel]:
    """Measured and simulated values of a channel, and its errors."""
    values = {
        'measured': series.measured,
        'simulated before': series.measured - series.before,
        'simulated after': series.measured - series.after,
    }
    curves = _curves(series.time, values)
    errors = _error_panel(series, 'measured less simulated')
    return [Panel(_title(series), series.unit, curves), errors]


def error_panels(group: Sequence[Series], spans: Sequence[Span]) -> list[Panel]:
    """Errors of the channels of a kind before and after, events shaded."""
    return [replace(_error_panel(series, _title(series)), spans=spans) for series in group]


def spans(diagnosis: Diagnosis) -> list[Span]:
    """Times of the events of the recording that is shown."""
    named = diagnosis.events.named if diagnosis.events else ()
    shown = [e for e in named if not e.recording]
    return [(e.start, e.end, '' if k else 'event') for k, e in enumerate(shown)]


def _error_panel(series: Series, title: str) -> Panel:
    band = 3.0 * series.noise_floor
    curves = _curves(series.time, {'before': series.before, 'after': series.after})
    levels = ((band, '3 noise floors'), (-band, ''))
    return Panel(title, series.unit, curves, levels=levels)


def _curves(abscissa: Array, lines: Mapping[str, Array]) -> list[Curve]:
    return [Curve(name, abscissa, y, None, _COLORS[name]) for name, y in lines.items()]


def spectra(channels: Sequence[Series]) -> list[Panel]:
    """Amplitude spectra of errors."""
    return [_spectrum_panel(series) for series in channels]


def _spectrum_panel(series: Series) -> Panel:
    step, amplitudes = float(np.median(np.diff(series.time))), {}
    for name, values in (('before', series.before), ('after', series.after)):
        size = min(_SEGMENT, len(values))
        frequency, power = welch(values, fs=1.0 / step, nperseg=size, detrend=False)
        amplitudes[name] = np.sqrt(power[1:])
    levels = ((series.noise_floor * np.sqrt(2.0 * step), 'noise floor'),)
    curves, unit = _curves(frequency[1:], amplitudes), f'{series.unit}/Hz^0.5'
    return Panel(_title(series), unit, curves, log=True, levels=levels)


def _title(series: Series) -> str:
    kind, _, place = series.channel.partition('/')
    return f'{kind.replace("_", " ")}, {place}'


def worst(channels: Sequence[Series], count: int) -> list[Series]:
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
