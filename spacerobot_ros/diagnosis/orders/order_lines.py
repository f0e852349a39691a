"""Lines of a raw signal against an angle that turns, up to the Nyquist order.

A ripple of k periods a turn has the frequency k |q'| / 2 pi, which changes with the rate, so that
no spectrum in time shows it. What is fast in a signal is whitened and correlated with sin(k q) and
cos(k q), order by order, where that frequency lies above the band of slow motion and below half
the rate of the samples. A line must tell more than the best sine of the time does: along one speed
throughout nobody can tell them apart.

Samples are put into bins of the angle, whose Fourier transform is that of the samples by angle:
sum_i v_i exp(-i k q_i), all k at once (computed order tracking without resampling: Fyfe and Munck,
Mechanical Systems and Signal Processing 11, 1997). Orders are asked where the frequency k |q'|
lies within a band, so that samples are taken by classes of speed, each with the orders that it has
in the band.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft
from scipy.signal import butter, sosfiltfilt

from ...inference.decisive import CONFOUNDED
from ...types import Array, BoolArray, IntArray
from ..answer.result import Order

_FINE = 2.5  # orders by resolution, 1 / reach
_SHORT = 0.02  # turns; a shorter way tells no orders apart
_BINS = 8  # a period of the highest order: a bin's width costs 5 % of its square
_CLASS = 1.25  # of speeds: highest by lowest
_SLOW = 0.3  # of the usual speed, which has the Nyquist order
BAND = (6.0, 0.45)  # Hz; of the rate of the samples
FEWEST = 400  # samples

_CHANCE = 1e-7  # of a peak so high anywhere
_ABOVE = 3.0  # times the median of its neighbours, else it is a broad hump
_NEAR = 0.25  # of its order: neighbours
_MOST, _LESSER = 3, 0.2  # lines against an angle; of the highest
_SKIRT, _SKIRT_SHARE = 2.0, 0.02  # of the resolution; of the order: lines that are one
_SMOOTH = 31  # lines of a spectrum, over which its level is taken
_PADDED = 4  # times the samples: frequencies of these sines
_TRIED = np.linspace(-1.0, 1.0, 11)  # of the spacing of orders, about the best one


class OrderSpectrum:
    """Orders against an angle at even times.

    Args:
        angle: (N,) q [rad].
        step: Between samples [s].
        is_there: (N,) where it was measured.
        least: Lowest order that is asked, within the band [periods a turn].
        highest: Highest one.

    Attributes:
        orders: (K,) evenly spaced; none of an angle that hardly turns.
        speed: (N,) |q'| [turns/s]; zero where nothing is to be used.
        reach: Way that it goes [turns].
    """

    def __init__(
        self, angle: Array, step: float, is_there: BoolArray, least: float, highest: float
    ) -> None:
        slow = sosfiltfilt(butter(2, BAND[0], fs=1.0 / step, output='sos'), angle)
        self.angle, self.band = angle, (BAND[0], BAND[1] / step)
        self.speed: Array = np.abs(np.gradient(slow, step)) / (2.0 * math.pi) * is_there
        self.reach = float(np.ptp(angle)) / (2.0 * math.pi)
        self.orders, usual = np.zeros(0), float(np.quantile(self.speed, 0.9))
        if min(self.reach, usual) <= 0.0:
            return
        least = max(least, self.band[0] / float(np.max(self.speed)))
        top = min(self.band[1] / (_SLOW * usual), highest)
        self._slowest = self.band[0] / max(top, least)
        turns = (angle - np.min(angle)) / (2.0 * math.pi)
        length = _FINE * max(float(np.ptp(turns)), _SHORT)
        self._first = math.ceil(least * length)
        last = max(self._first, math.floor(top * length))
        self.orders = np.arange(self._first, last) / length
        self._bins = next_fast_len(math.ceil(_BINS * max(top, least) * length), real=True)
        self._bin = np.minimum((turns / length * self._bins).astype(int), self._bins - 1)

    def seen(self, order: float) -> BoolArray:
        """(N,) where an order's frequency lies within the band."""
        frequency = order * self.speed
        return (frequency > self.band[0]) & (frequency < self.band[1])

    def powers(self, values: Array) -> Array:
        """(K,) half the squares of unit noise that each order explains of (N,) white values.

        Exponential by chance, of mean one; zero where an order has few samples.
        """
        orders, first = self.orders, self._first
        along, twice = (np.zeros(len(orders), dtype=complex) for _ in range(2))
        counts, squares = np.zeros(len(orders)), np.zeros(len(orders))
        for at, speed in self._classes():
            a, b = np.searchsorted(orders, [end / speed for end in self.band]).tolist()
            if a == b:
                continue
            own = self._bin[at]
            along[a:b] += self._transformed(own, values[at])[first + a : first + b]
            double = self._transformed(own, np.ones(len(at)))
            twice[a:b] += double[2 * (first + a) : 2 * (first + b) : 2]
            counts[a:b] += len(at)
            squares[a:b] += float(np.sum(values[at] ** 2))
        cosine, sine, both = counts + twice.real, counts - twice.real, -twice.imag
        x, y = along.real, -along.imag
        determinant = np.maximum(0.25 * (cosine * sine - both**2), 1e-300)
        explained = 0.5 * (sine * x**2 - 2.0 * both * x * y + cosine * y**2) / determinant
        mean = squares / np.maximum(counts, 1.0)
        return np.asarray(np.where(counts < FEWEST, 0.0, 0.5 * explained / (mean + 1e-300)))

    def _transformed(self, where: IntArray, values: Array) -> NDArray[np.complex128]:
        """Sums of values times exp(-i k q), k in steps of the orders from zero."""
        return np.asarray(rfft(np.bincount(where, values, self._bins)))

    def _classes(self) -> list[tuple[IntArray, float]]:
        """Samples of about one speed, and this speed."""
        moving = np.flatnonzero(self.speed > self._slowest)
        level = np.floor(np.log(self.speed[moving]) / math.log(_CLASS)).astype(int)
        return [(moving[level == n], _CLASS ** (n + 0.5)) for n in np.unique(level).tolist()]


def fitted(values: Array, phases: Array) -> tuple[float, float, float]:
    """Sine and cosine of phases (N,) in values, by least squares, and the squares they explain."""
    sine, cosine = np.sin(phases), np.cos(phases)
    a, b, c = float(sine @ sine), float(sine @ cosine), float(cosine @ cosine)
    x, y = float(sine @ values), float(cosine @ values)
    determinant = max(a * c - b * b, 1e-300)
    in_sine, in_cosine = (c * x - b * y) / determinant, (a * y - b * x) / determinant
    return in_sine, in_cosine, in_sine * x + in_cosine * y


def power(values: Array, phases: Array) -> float:
    """Half the squares of unit noise that sine and cosine of phases (N,) explain of values."""
    if len(values) < FEWEST:
        return 0.0
    return 0.5 * fitted(values, phases)[2] / max(float(np.mean(values**2)), 1e-300)


Signal = tuple[Array, Array]
"""(N,) what is fast of one; (N,) the same with a flat spectrum."""


def fast_of(values: Array, step: float) -> Signal:
    """The part of values (N,), so far apart [s], above the band of slow motion."""
    fast = values - sosfiltfilt(butter(3, BAND[0], fs=1.0 / step, output='sos'), values)
    spectrum = np.fft.rfft(fast)
    level = np.sqrt(np.convolve(np.abs(spectrum) ** 2, np.ones(_SMOOTH) / _SMOOTH, 'same'))
    level = np.maximum(level, 1e-3 * float(np.max(level)) + 1e-300)
    return fast, np.fft.irfft(spectrum / level, len(fast))


def lines_of(
    signal: Signal, spectrum: OrderSpectrum, name: tuple[str, str, str]
) -> Iterator[tuple[Order, float]]:
    """The highest lines of a signal against an angle, where they are no chance and no hump.

    Nor may a sine of the time explain as much: the two are told apart as two causes are.

    Args:
        signal: See `fast_of`.
        spectrum: Of the angle.
        name: Joint or wheel that turns, unit and channel of the signal.

    Returns:
        Each with half the squares of unit noise that it explains.
    """
    orders, white, highest = spectrum.orders, signal[1].copy(), 0.0
    is_left = np.ones(len(orders), dtype=bool)
    for _ in range(_MOST if len(orders) else 0):
        powers = spectrum.powers(white) * is_left
        i = int(np.argmax(powers))
        highest = max(highest, float(powers[i]))
        near = is_left & (np.abs(orders - orders[i]) < _NEAR * orders[i])
        line, explained = _line(signal[0], white, spectrum, i, name)
        is_sharp = powers[i] >= max(_ABOVE * float(np.median(powers[near])), _LESSER * highest)
        if line.p_value > _CHANCE or not is_sharp:
            return
        at = spectrum.seen(line.order)
        if explained > _power_by_time(np.where(at, white, 0.0)) + CONFOUNDED:
            yield line, explained
        phases = line.order * spectrum.angle[at]
        sine, cosine, _ = fitted(white[at], phases)
        white[at] -= sine * np.sin(phases) + cosine * np.cos(phases)
        skirt = max(_SKIRT / spectrum.reach, _SKIRT_SHARE * line.order)
        is_left &= np.abs(orders - line.order) >= skirt


def rival_power(
    white: Array, own: OrderSpectrum, order: float, other: OrderSpectrum, width: float
) -> float:
    """Half the squares of unit noise that the best order of another angle explains in its place.

    Args:
        white: (N,) the signal, of a flat spectrum.
        own: Of the angle of the line.
        order: Of the line.
        other: Of an angle that turns at about the same time.
        width: Of the frequency, by which the line in its place may differ.
    """
    at = own.seen(order)
    ratio = float(np.sum(own.speed[at]) / np.sum(other.speed[at] + 1e-300))
    orders, angle = other.orders, other.angle[at]
    a, b = np.searchsorted(orders, [order * ratio * share for share in (1.0 - width, 1.0 + width)])
    best = max(range(a, b), key=lambda i: power(white[at], orders[i] * angle), default=None)
    near = [] if best is None else _about(orders, best)
    return max((power(white[at], k * angle) for k in near), default=0.0)


def _line(
    fast: Array, white: Array, spectrum: OrderSpectrum, i: int, name: tuple[str, str, str]
) -> tuple[Order, float]:
    """The line about an order, at the order between its neighbours that explains most.

    Args:
        fast: (N,) the signal, of the amplitude.
        white: (N,) what other lines leave of it, of a flat spectrum.
        spectrum: Of the angle.
        i: Number of the order.
        name: See `lines_of`.
    """
    orders, at = spectrum.orders, spectrum.seen(float(spectrum.orders[i]))
    angle, (place, unit, channel) = spectrum.angle[at], name
    best, order = max((power(white[at], k * angle), k) for k in _about(orders, i))
    sine, cosine, _ = fitted(fast[at], order * angle)
    p_value = min(1.0, len(orders) * math.exp(-min(best, 700.0)))
    amplitude, phase = math.hypot(sine, cosine), math.atan2(cosine, sine)
    return Order(place, unit, order, amplitude, phase, p_value, channel), best


def _about(orders: Array, i: int) -> list[float]:
    """Orders from the one before to the one behind."""
    spacing = float(orders[1] - orders[0]) if len(orders) > 1 else 0.0
    return (orders[i] + spacing * _TRIED).tolist()


def _power_by_time(values: Array) -> float:
    """Half the squares of unit noise that the best sine of the time explains.

    Args:
        values: (N,) zero where they are not asked.
    """
    squares = np.abs(np.fft.rfft(values, _PADDED * len(values))) ** 2
    return float(np.max(squares)) / max(float(np.sum(values**2)), 1e-300)
