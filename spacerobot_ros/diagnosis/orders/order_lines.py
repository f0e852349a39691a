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
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft
from scipy.signal import butter, sosfiltfilt

from ...inference.decisive import CONFOUNDED
from ...types import Array, BoolArray, IntArray
from ..answer.result import Order

_FINE, _SHORT = 2.5, 0.02  # orders by resolution, 1 / reach; turns that tell no orders apart
_BINS = 8  # a period of the highest order: a bin's width costs 5 % of its square
_CLASS = 1.25  # of speeds: highest by lowest
_SLOW = 0.3  # of the usual speed, which has the Nyquist order
BAND = (6.0, 0.45)  # Hz; of the rate of the samples
FEWEST = 400  # samples

_CHANCE = 1e-7  # of a peak so high anywhere
_ABOVE, _NEAR = 3.0, 0.25  # times the median of neighbours, so near by order: else a broad hump
MOST, _LESSER = 3, 0.2  # lines against an angle; of the highest
_NEARLY = 0.8  # of what a line explains: angles that turn alike, but for noise of their rates
ONE = 0.02  # of its order: by which lines that are one may differ
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

    def nearest(self, white: Array, i: int, at: BoolArray) -> tuple[float, float]:
        """`power` of the order that explains most between an order's neighbours, and that order.

        Args:
            white: (N,) values.
            i: Number of the order.
            at: (N,) samples that are taken.
        """
        spacing = float(self.orders[1] - self.orders[0]) if len(self.orders) > 1 else 0.0
        near = (self.orders[i] + spacing * _TRIED).tolist()
        return max((power(white[at], k * self.angle[at]), k) for k in near)

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


def _fast_of(values: Array, step: float) -> tuple[Array, Array]:
    """(N,) the part of values, so far apart [s], above the slow band; (N,) of flat spectrum."""
    fast = values - sosfiltfilt(butter(3, BAND[0], fs=1.0 / step, output='sos'), values)
    spectrum = np.fft.rfft(fast)
    level = np.sqrt(np.convolve(np.abs(spectrum) ** 2, np.ones(_SMOOTH) / _SMOOTH, 'same'))
    level = np.maximum(level, 1e-3 * float(np.max(level)) + 1e-300)
    return fast, np.fft.irfft(spectrum / level, len(fast))


def lines_of(
    values: Array, step: float, spectra: Mapping[str, OrderSpectrum], unit: str, channel: str = ''
) -> Iterator[Order]:
    """Lines of a signal against angles, but those that another one tells as two causes do.

    Args:
        values: (N,) of the signal.
        step: Between them [s].
        spectra: Of the angles, by joint or wheel.
        unit: Of the signal.
        channel: Its name.
    """
    fast, white = _fast_of(values, step)
    for place, own in spectra.items():
        for line, explained in _highest(fast, white.copy(), own, (place, unit, channel)):
            others = (other for other in spectra.values() if other is not own)
            most = max((_rival_power(white, own, line.order, it) for it in others), default=0.0)
            if explained > most + CONFOUNDED and most < _NEARLY * explained:
                yield line


def _highest(
    fast: Array, white: Array, spectrum: OrderSpectrum, name: tuple[str, str, str]
) -> Iterator[tuple[Order, float]]:
    """The highest lines against one angle, where they are no chance and no hump, and `power`.

    Nor may a sine of the time explain as much: the two are told apart as two causes are.
    """
    (place, unit, channel), orders, highest = name, spectrum.orders, 0.0
    is_left = np.ones(len(orders), dtype=bool)
    for _ in range(MOST if len(orders) else 0):
        powers = spectrum.powers(white) * is_left
        i = int(np.argmax(powers))
        highest = max(highest, float(powers[i]))
        near = is_left & (np.abs(orders - orders[i]) < _NEAR * orders[i])
        at = spectrum.seen(float(orders[i]))
        explained, order = spectrum.nearest(white, i, at)
        sine, cosine, _ = fitted(fast[at], order * spectrum.angle[at])
        p_value = min(1.0, len(orders) * math.exp(-min(explained, 700.0)))
        is_sharp = powers[i] >= max(_ABOVE * float(np.median(powers[near])), _LESSER * highest)
        if p_value > _CHANCE or not is_sharp:
            return
        at = spectrum.seen(order)
        if explained > _power_by_time(np.where(at, white, 0.0)) + CONFOUNDED:
            size, phase = math.hypot(sine, cosine), math.atan2(cosine, sine)
            yield Order(place, unit, order, size, phase, p_value, channel), explained
        phases = order * spectrum.angle[at]
        sine, cosine, _ = fitted(white[at], phases)
        white[at] -= sine * np.sin(phases) + cosine * np.cos(phases)
        skirt = max(_SKIRT / spectrum.reach, _SKIRT_SHARE * order)
        is_left &= np.abs(orders - order) >= skirt


def _rival_power(white: Array, own: OrderSpectrum, order: float, other: OrderSpectrum) -> float:
    """Half the squares of unit noise that the best order of another angle explains in its place.

    Args:
        white: (N,) the signal, of a flat spectrum.
        own: Of the angle of the line.
        order: Of the line.
        other: Of an angle that turns at about the same time.
    """
    at = own.seen(order)
    ratio = float(np.sum(own.speed[at]) / np.sum(other.speed[at] + 1e-300))
    orders = other.orders
    a, b = np.searchsorted(orders, [order * ratio * share for share in (1.0 - ONE, 1.0 + ONE)])
    each = ((power(white[at], orders[i] * other.angle[at]), -i) for i in range(a, b))
    best = max(each, default=None)
    return 0.0 if best is None else other.nearest(white, -best[1], at)[0]


def _power_by_time(values: Array) -> float:
    """Half the squares of unit noise that the best sine of the time explains.

    Args:
        values: (N,) zero where they are not asked.
    """
    squares = np.abs(np.fft.rfft(values, _PADDED * len(values))) ** 2
    return float(np.max(squares)) / max(float(np.sum(values**2)), 1e-300)
