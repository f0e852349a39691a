"""How much of a signal follows sin(k q) and cos(k q) of an angle q, for very many orders k.

Samples are put into bins of the angle, whose Fourier transform is that of the samples by angle:
sum_i v_i exp(-i k q_i), all k at once (computed order tracking without resampling: Fyfe and Munck,
Mechanical Systems and Signal Processing 11, 1997). Orders are asked where the frequency k |q'|
lies within a band, so that samples are taken by classes of speed, each with the orders that it has
in the band.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft

from ...types import Array, BoolArray, IntArray

_FINE = 2.5  # orders by resolution, 1 / reach
_SHORT = 0.02  # turns; a shorter way tells no orders apart
_BINS = 8  # a period of the highest order: a bin's width costs 5 % of its square
_CLASS = 1.25  # of speeds: highest by lowest
_FEWEST = 400  # samples


class OrderSpectrum:
    """Orders against one angle.

    Args:
        angle: (N,) q [rad].
        speed: (N,) |q'| [turns/s]; zero where nothing is to be used.
        band: Lowest and highest frequency [Hz].
        least, top: Of the orders [periods a turn].

    Attributes:
        orders: (K,) evenly spaced.
    """

    def __init__(
        self, angle: Array, speed: Array, band: tuple[float, float], least: float, top: float
    ) -> None:
        self.angle, self.speed, self.band = angle, speed, band
        self._slowest = band[0] / max(top, least)
        turns = (angle - np.min(angle)) / (2.0 * math.pi)
        length = _FINE * max(float(np.ptp(turns)), _SHORT)
        self._first = math.ceil(least * length)
        last = max(self._first, math.floor(top * length))
        self.orders: Array = np.arange(self._first, last) / length
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
        explained = _explained(0.5 * cosine, 0.5 * sine, 0.5 * both, along)
        mean = squares / np.maximum(counts, 1.0)
        return np.asarray(np.where(counts < _FEWEST, 0.0, 0.5 * explained / (mean + 1e-300)))

    def _transformed(self, where: IntArray, values: Array) -> NDArray[np.complex128]:
        """Sums of values times exp(-i k q), k in steps of the orders from zero."""
        return np.asarray(rfft(np.bincount(where, values, self._bins)))

    def _classes(self) -> list[tuple[IntArray, float]]:
        """Samples of about one speed, and this speed."""
        moving = np.flatnonzero(self.speed > self._slowest)
        level = np.floor(np.log(self.speed[moving]) / math.log(_CLASS)).astype(int)
        return [(moving[level == n], _CLASS ** (n + 0.5)) for n in np.unique(level).tolist()]


def _explained(cosine: Array, sine: Array, both: Array, along: NDArray[np.complex128]) -> Array:
    """(K,) squares that cosine and sine explain, of their own squares and sums with the data."""
    determinant = np.maximum(cosine * sine - both**2, 1e-300)
    x, y = along.real, -along.imag
    return np.asarray((sine * x**2 - 2.0 * both * x * y + cosine * y**2) / determinant)


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
    if len(values) < _FEWEST:
        return 0.0
    return 0.5 * fitted(values, phases)[2] / max(float(np.mean(values**2)), 1e-300)
