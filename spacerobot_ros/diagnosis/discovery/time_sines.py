"""The rival of every law: sines that follow the time alone, some of them sweeping."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...effects.laws.grammar import Form
from ...types import Array
from .possible_laws import Law

SWEEPS = (0.0, 4.0, -4.0, 8.0, -8.0, 16.0, -16.0, 32.0, -32.0)  # of 1/T^2
_LOWEST = 0.05  # Hz
_SPACING = 0.5
"""Of the resolution 1/T: between two of them a sine keeps 81 % of its square. With 0.75 (63 %) 5
of 16 slow sweeps were functions of nothing that is measured, now 1 is."""
_MOST = 1500  # sines: longer records sweep less, then have the low frequencies alone


def time_sines(duration: float, highest: float, sweeps: Sequence[float] = (0.0,)) -> list[Law]:
    """Sines and cosines of 2 pi (f t + c t^2 / 2), each priced by their number.

    Args:
        duration: T of the record [s].
        highest: Of the frequencies f [Hz].
        sweeps: c, of 1/T^2.
    """
    frequencies = np.arange(_LOWEST, highest, _SPACING / duration)[:_MOST].tolist()
    count = max(1, min(len(sweeps), _MOST // max(len(frequencies), 1)))
    options = [{'f': f, 'c': c / duration**2} for f in frequencies for c in sweeps[:count]]
    price = math.log(max(len(options), 1))
    return [Law(_SWEEP, ('time',), price, 'a sine of the time', 'clock', o) for o in options]


def _turning(t: Array, f: float, c: float) -> tuple[Array, ...]:
    angle = 2.0 * math.pi * (f * t + 0.5 * c * t**2)
    return np.sin(angle), np.cos(angle)


_SWEEP = Form('sin, cos of 2 pi (f t + c t^2 / 2)', _turning, ((0,), (0,)))
