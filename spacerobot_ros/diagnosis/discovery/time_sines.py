"""The rival of every law: sines that follow the time alone, some of them sweeping."""

from __future__ import annotations

import math

import numpy as np

from ...types import Array, IntArray

_LOW, _HIGH = 0.05, 2.0  # Hz
_SPACING = 0.75  # of the resolution 1/T
_SWEEPS = (0.0, 4.0, -4.0, 8.0, -8.0, 16.0, -16.0, 32.0, -32.0)  # of 1/T^2
_MOST = 1500  # sines: longer records sweep less, then have the low frequencies alone


class TimeSines:
    """Sines and cosines of 2 pi (f t + c t^2 / 2) along rows.

    Args:
        times: (M,) since the start [s].
    """

    def __init__(self, times: Array) -> None:
        duration = max(float(times[-1] - times[0]), 1e-9)
        frequencies = np.arange(_LOW, _HIGH, _SPACING / duration)[:_MOST]
        count = max(1, min(len(_SWEEPS), _MOST // max(len(frequencies), 1)))
        sweeps = np.array(_SWEEPS[:count]) / duration**2
        self.frequency = np.repeat(frequencies, count)
        self.sweep = np.tile(sweeps, len(frequencies))
        t = times - times[0]
        angle = 2.0 * math.pi * (np.outer(t, self.frequency) + np.outer(0.5 * t**2, self.sweep))
        self.columns = np.concatenate([np.sin(angle), np.cos(angle)], axis=1)
        """(M, 2 S)."""
        self.price = math.log(len(self.frequency)) if len(self.frequency) else 0.0
        """Of each, by their number [nats]."""

    @property
    def groups(self) -> IntArray:
        """(S, 2) columns of each sine."""
        count = len(self.frequency)
        return np.column_stack([np.arange(count), count + np.arange(count)])

    def in_words(self, number: int) -> str:
        """A sine as a form."""
        f, c = float(self.frequency[number]), float(self.sweep[number])
        return f'sin, cos of 2 pi ({f:.3g} Hz t{f" {c:+.2g} Hz/s t^2/2" if c else ""})'
