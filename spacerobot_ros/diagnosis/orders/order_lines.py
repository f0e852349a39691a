"""Lines of a raw signal against an angle that turns, up to the Nyquist order.

A ripple of k periods a turn has the frequency k |q'| / 2 pi, which changes with the rate, so that
no spectrum in time shows it. What is fast in a signal is whitened and correlated with sin(k q) and
cos(k q), order by order, where that frequency lies above the band of slow motion and below half
the rate of the samples. A line must tell more than the best sine of the time does: along one speed
throughout nobody can tell them apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import butter, sosfiltfilt

from ...inference.decisive import CONFOUNDED
from ...types import Array, BoolArray
from .order_spectrum import OrderSpectrum, fitted, power

BAND = (6.0, 0.45)  # Hz; of the rate of the samples
FEWEST = 400  # samples
_CHANCE = 1e-7  # of a peak so high anywhere
_ABOVE = 3.0  # times the median of its neighbours, else it is a broad hump
_NEAR = 0.25  # of its order: neighbours
_MOST, _LESSER = 3, 0.2  # lines against an angle; of the highest
_SKIRT, _SKIRT_SHARE = 2.0, 0.02  # of the resolution; of the order: lines that are one
_SLOW = 0.3  # of the usual speed, which has the Nyquist order
_SMOOTH = 31  # lines of a spectrum, over which its level is taken
_PADDED = 4  # times the samples: frequencies of these sines
_TRIED = np.linspace(-1.0, 1.0, 11)  # of the spacing of orders, about the best one


@dataclass(frozen=True, slots=True)
class OrderLine:
    """A line against an angle.

    Args:
        order: Periods a turn. amplitude: In the signal's unit.
        phase: At angle zero [rad]. power: Half the squares of unit noise that it explains.
        p_value: Of such a line by chance.
    """

    order: float
    amplitude: float
    phase: float
    power: float
    p_value: float


@dataclass(frozen=True, eq=False)
class Turning:
    """An angle at evenly spaced times.

    Args:
        angle: (N,) [rad]. step: Between samples [s]. is_there: (N,) where it was measured.
        least, highest: Orders that are asked, within the band [periods a turn].
    """

    angle: Array
    step: float
    is_there: BoolArray
    least: float
    highest: float

    @cached_property
    def spectrum(self) -> OrderSpectrum | None:
        """Its orders; None where it hardly turns."""
        sections = butter(2, BAND[0], fs=1.0 / self.step, output='sos')
        speed = np.abs(np.gradient(sosfiltfilt(sections, self.angle), self.step)) / (2.0 * math.pi)
        speed[~self.is_there] = 0.0
        usual = float(np.quantile(speed, 0.9))
        if min(float(np.ptp(self.angle)), usual) <= 0.0:
            return None
        band = (BAND[0], BAND[1] / self.step)
        least = max(self.least, BAND[0] / float(np.max(speed)))
        top = min(band[1] / (_SLOW * usual), self.highest)
        return OrderSpectrum(self.angle, speed, band, least, top)

    @cached_property
    def reach(self) -> float:
        """Way that it goes [turns]."""
        return float(np.ptp(self.angle)) / (2.0 * math.pi)


@dataclass(frozen=True, eq=False)
class FastSignal:
    """What is fast in a signal at evenly spaced times.

    Args:
        values: (N,). step: Between samples [s].
    """

    values: Array
    step: float

    @cached_property
    def fast(self) -> Array:
        """(N,) the part above the band of slow motion."""
        sections = butter(3, BAND[0], fs=1.0 / self.step, output='sos')
        return np.asarray(self.values - sosfiltfilt(sections, self.values))

    @cached_property
    def white(self) -> Array:
        """(N,) the same with a flat spectrum."""
        spectrum = np.fft.rfft(self.fast)
        level = np.sqrt(np.convolve(np.abs(spectrum) ** 2, np.ones(_SMOOTH) / _SMOOTH, 'same'))
        level = np.maximum(level, 1e-3 * float(np.max(level)) + 1e-300)
        return np.fft.irfft(spectrum / level, len(self.fast))


def lines_of(signal: FastSignal, turning: Turning) -> Iterator[OrderLine]:
    """The highest lines of a signal against an angle, where they are no chance and no hump.

    Nor may a sine of the time explain as much: the two are told apart as two causes are.
    """
    spectrum = turning.spectrum
    if spectrum is None or not len(spectrum.orders):
        return
    orders, white, highest = spectrum.orders, signal.white.copy(), 0.0
    is_left = np.ones(len(orders), dtype=bool)
    for _ in range(_MOST):
        powers = spectrum.powers(white) * is_left
        i = int(np.argmax(powers))
        highest = max(highest, float(powers[i]))
        near = is_left & (np.abs(orders - orders[i]) < _NEAR * orders[i])
        line = _line(signal, white, spectrum, i)
        is_sharp = powers[i] >= max(_ABOVE * float(np.median(powers[near])), _LESSER * highest)
        if line.p_value > _CHANCE or not is_sharp:
            return
        at = spectrum.seen(line.order)
        if line.power > _power_by_time(np.where(at, white, 0.0)) + CONFOUNDED:
            yield line
        white[at] -= _of_phase(white[at], line.order * spectrum.angle[at])
        skirt = max(_SKIRT / turning.reach, _SKIRT_SHARE * line.order)
        is_left &= np.abs(orders - line.order) >= skirt


def rival_power(
    signal: FastSignal, own: Turning, order: float, other: Turning, width: float
) -> float:
    """Half the squares of unit noise that the best order of another angle explains in its place.

    Args:
        signal: Of both.
        own: Angle of the line.
        order: Of the line.
        other: Angle that turns at about the same time.
        width: Of the frequency, by which the line in its place may differ.
    """
    if own.spectrum is None or other.spectrum is None:
        return 0.0
    at = own.spectrum.seen(order)
    ratio = float(np.sum(own.spectrum.speed[at]) / np.sum(other.spectrum.speed[at] + 1e-300))
    orders, angle, white = other.spectrum.orders, other.angle[at], signal.white[at]
    a, b = np.searchsorted(orders, [order * ratio * share for share in (1.0 - width, 1.0 + width)])
    best = max(range(a, b), key=lambda i: power(white, orders[i] * angle), default=None)
    if best is None:
        return 0.0
    return max(power(white, k * angle) for k in _about(orders, best))


def _line(signal: FastSignal, white: Array, spectrum: OrderSpectrum, i: int) -> OrderLine:
    """The line about an order, at the order between its neighbours that explains most.

    Args:
        signal: Of the amplitude.
        white: (N,) what other lines leave of it, of a flat spectrum.
        spectrum: Of the angle.
        i: Number of the order.
    """
    orders, at = spectrum.orders, spectrum.seen(float(spectrum.orders[i]))
    angle = spectrum.angle[at]
    best, order = max((power(white[at], k * angle), k) for k in _about(orders, i))
    sine, cosine, _ = fitted(signal.fast[at], order * angle)
    p_value = min(1.0, len(orders) * math.exp(-min(best, 700.0)))
    return OrderLine(order, math.hypot(sine, cosine), math.atan2(cosine, sine), best, p_value)


def _about(orders: Array, i: int) -> list[float]:
    """Orders from the one before to the one behind."""
    spacing = float(orders[1] - orders[0]) if len(orders) > 1 else 0.0
    return (orders[i] + spacing * _TRIED).tolist()


def _of_phase(values: Array, phases: Array) -> Array:
    """(N,) what sine and cosine of phases explain of values."""
    sine, cosine, _ = fitted(values, phases)
    return np.asarray(sine * np.sin(phases) + cosine * np.cos(phases))


def _power_by_time(values: Array) -> float:
    """Half the squares of unit noise that the best sine of the time explains.

    Args:
        values: (N,) zero where they are not asked.
    """
    squares = np.abs(np.fft.rfft(values, _PADDED * len(values))) ** 2
    return float(np.max(squares)) / max(float(np.sum(values**2)), 1e-300)
