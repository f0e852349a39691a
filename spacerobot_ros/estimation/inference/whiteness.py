"""Does the model explain the data? Whitened innovations must be white, channel by channel.

Every axis of every channel is scaled by its own spread, so that a noise level that is stated a
little wrong is no misfit, and then asked three things: whether its lowest 10, 40 and 120 discrete
cosine terms hold more energy than white noise has, and whether any single frequency up to
Nyquist's stands out (Fisher 1929). The smallest p-value, times the number of questions, is the
verdict.
"""

from __future__ import annotations

import numpy as np
import scipy

from ...types import Array
from ..rows import ChannelFit
from ..trajectory.time_base import CHANNELS, TimeBase
from .evidence import chi_square_tail

LOWEST_TERMS = (10, 40, 120)
"""Cosine terms whose energy is asked, for errors of three kinds of slowness: that of few terms
drowns in the energy of many."""
_SKIPPED = 5  # first samples of each channel, where the state is still found
_FEWEST = 40  # samples of a channel that is asked
_LINE = 1e-2  # p-value below which a line is worth a guess
_APART, _MOST_LINES = 0.1, 3  # of its frequency; guesses, of which each costs a fit


def whiteness(base: TimeBase, data: Array) -> tuple[float, tuple[ChannelFit, ...]]:
    """Probability that a model as good as the truth fits as badly, and each channel's part in it.

    Args:
        base: What the rows are.
        data: (R,) a model's whitened innovations.
    """
    rows, fits = base.rows, []
    row_times = np.repeat(base.times, np.diff(rows.first))
    for c, name in enumerate(CHANNELS):
        for axis in np.unique(rows.axis[rows.channel == c]).tolist():
            at = (rows.channel == c) & (rows.axis == axis)
            if np.count_nonzero(at) >= _FEWEST:
                times = row_times[at]
                fits.append(channel_fit(name, axis, data[at][_SKIPPED:], times[_SKIPPED:]))
    if not fits:
        return 1.0, ()
    return min(1.0, len(fits) * min(fit.p_value for fit in fits)), tuple(fits)


def spectral_lines(fits: tuple[ChannelFit, ...]) -> tuple[float, ...]:
    """Frequencies of the clearest lines, each once [rad/s]."""
    found: list[float] = []
    for fit in sorted(fits, key=lambda f: f.line_p):
        frequency = 2.0 * np.pi * fit.frequency
        if fit.line_p < _LINE and all(abs(frequency / f - 1.0) > _APART for f in found):
            found.append(frequency)
    return tuple(found[:_MOST_LINES])


def channel_fit(name: str, axis: int, values: Array, times: Array) -> ChannelFit:
    """How white one axis of a channel is.

    Args:
        name: Channel.
        axis: Joint or axis number.
        values: (N,) its whitened innovations.
        times: (N,) their times [s].
    """
    spread = float(np.sqrt(np.mean(values**2)))
    white = values / spread
    count = len(white)
    energy = scipy.fft.dct(white, norm='ortho') ** 2
    slow = [chi_square_tail(np.sum(energy[:k]), k) for k in LOWEST_TERMS if 2 * k < count]
    power = np.abs(scipy.fft.rfft(white)[1 : (count + 1) // 2]) ** 2 / count
    peak = int(np.argmax(power))
    line = float(-np.expm1(len(power) * np.log1p(-np.exp(-power[peak]))))
    questions = len(slow) + 1
    worst = min([*slow, 1.0])
    return ChannelFit(
        channel=name,
        axis=axis,
        spread=spread,
        p_value=min(1.0, questions * min(worst, line)),
        question='line' if line < worst else 'slow',
        frequency=(peak + 1) / float(times[-1] - times[0]),
        line_p=line,
    )
