"""Lines of raw signals against angles that turn, up to the Nyquist order.

A ripple of k periods a turn has the frequency k |q'| / 2 pi, which is above the band of a balance
of torques and changes with the rate, so that no spectrum in time shows it. What is fast in an
effort is whitened and correlated with sin(k q) and cos(k q), order by order, where that frequency
lies above the band and below half the rate of the samples. Of a joint that slides k is 2 pi times
its periods a metre. A line must tell more than the best sine of the time does: along one speed
throughout nobody can tell them apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from ...recording.record import Record
from ...types import Array, BoolArray
from ..answer.result import Order

_BAND = (6.0, 0.45)  # Hz; of the rate of the samples
_CHANCE = 1e-7  # of a peak so high anywhere
_ABOVE = 3.0  # times the median of its neighbours, else it is a broad hump
_NEAR = 0.25  # of its order: neighbours
_FINE = 2.5  # orders tried per resolution
_SHORT = 0.02  # turns; a shorter way tells no orders apart
_MOST, _LESSER = 3, 0.2  # lines of a joint; of the highest
_SKIRT, _SKIRT_SHARE = 2.0, 0.02  # of the resolution; of the order: lines that are one
_SLOW, _HIGHEST = 0.3, 1000.0  # of the usual speed, which has the Nyquist order; periods a turn
_HIGHEST_SLIDING = 2.0 * math.pi / 1e-3  # rad/m: threads of a millimetre
_FEWEST = 400  # samples
_SMOOTH = 31  # lines of a spectrum, over which its level is taken
_LEAST = 8.0  # periods a turn: fewer are slow enough for the balance
_TIMED = 6.0  # nats ahead of the best sine of the time, as two causes are told apart
_PADDED = 4  # times the samples: frequencies of these sines


def find_orders(records: Sequence[Record], units: Mapping[str, str]) -> tuple[Order, ...]:
    """The highest lines of every joint that moves, where they are no chance and no hump.

    Of several recordings the one that shows a joint best is taken.

    Args:
        records: Of the same joints.
        units: Of their efforts, by joint in the order of the records.
    """
    best: dict[str, list[Order]] = {}
    for record in records:
        for j, joint in enumerate(units):
            found = _of_joint(record, j, joint, units[joint])
            if not found or (best.get(joint) and best[joint][0].p_value < found[0].p_value):
                continue
            best[joint] = found
    return tuple(order for joint in units for order in best.get(joint, []))


def _of_joint(record: Record, j: int, joint: str, unit: str) -> list[Order]:
    if record.effort is None or np.isnan(record.effort[:, j]).any():
        return []
    step = float(np.median(np.diff(record.joint_time)))
    time = np.arange(record.joint_time[0], record.joint_time[-1], step)
    if len(time) < _FEWEST or _BAND[0] * step > 0.2:
        return []
    q, effort = (np.interp(time, record.joint_time, x[:, j]) for x in (record.q, record.effort))
    gap = np.interp(time, record.joint_time[1:], np.diff(record.joint_time))
    highest = _HIGHEST_SLIDING if unit == 'N' else _HIGHEST
    lines = _lines(q, effort, step, gap <= 3.0 * step, highest)
    return [Order(joint, unit, *line) for line in lines]


def _lines(
    q: Array, values: Array, step: float, is_there: BoolArray, highest: float
) -> Iterator[tuple[float, float, float, float]]:
    """Order, amplitude, phase and p of the highest lines of values against an angle, (N,) each."""
    sections = butter(2, _BAND[0], fs=1.0 / step, output='sos')
    speed = np.abs(np.gradient(sosfiltfilt(sections, q), step)) / (2.0 * math.pi)  # turns a second
    speed[~is_there] = 0.0
    reach, usual = float(np.ptp(q)) / (2.0 * math.pi), float(np.quantile(speed, 0.9))
    if min(reach, usual) <= 0.0:
        return
    fast, white = _fast(values, step)
    top = min(_BAND[1] / step / (_SLOW * usual), highest)
    orders = np.arange(_LEAST, max(top, _LEAST), 1.0 / (_FINE * max(reach, _SHORT)))

    def seen(k: float) -> BoolArray:
        return (k * speed > _BAND[0]) & (k * speed < _BAND[1] / step)

    # orders are evenly spaced: from one to the next every sample's phase turns by the same angle
    turned, by = np.exp(1j * _LEAST * q), np.exp(1j * q / (_FINE * max(reach, _SHORT)))
    powers = np.empty(len(orders))
    for i, k in enumerate(orders):
        powers[i] = _power(white[at := seen(k)], turned[at])
        turned *= by
    highest_power = float(np.max(powers, initial=0.0))
    for _ in range(_MOST if len(powers) else 0):
        i = int(np.argmax(powers))
        near = np.abs(orders - orders[i]) < _NEAR * orders[i]
        p_value = min(1.0, len(orders) * math.exp(-min(float(powers[i]), 700.0)))
        if p_value > _CHANCE or powers[i] < _ABOVE * np.median(powers[near]):
            return
        if powers[i] < _LESSER * highest_power:
            return
        at = seen(float(orders[i]))
        if powers[i] > _power_by_time(np.where(at, white, 0.0)) + _TIMED:
            sine, cosine, _ = _fit(fast[at], np.exp(1j * orders[i] * q[at]))
            size, phase = math.hypot(sine, cosine), math.atan2(cosine, sine)
            yield float(orders[i]), size, phase, p_value
        powers[np.abs(orders - orders[i]) < max(_SKIRT / reach, _SKIRT_SHARE * orders[i])] = 0.0


def _power_by_time(values: Array) -> float:
    """Half the squares of unit noise that the best sine of the time explains.

    Args:
        values: (N,) zero where they are not asked.
    """
    squares = np.abs(np.fft.rfft(values, _PADDED * len(values))) ** 2
    return float(np.max(squares)) / max(float(np.sum(values**2)), 1e-300)


def _fit(values: Array, turned: NDArray[np.complex128]) -> tuple[float, float, float]:
    """Sine and cosine of phases in values, by least squares, and the squares they explain."""
    sine, cosine = turned.imag, turned.real
    a, b, c = float(sine @ sine), float(sine @ cosine), float(cosine @ cosine)
    x, y = float(sine @ values), float(cosine @ values)
    determinant = max(a * c - b * b, 1e-300)
    in_sine, in_cosine = (c * x - b * y) / determinant, (a * y - b * x) / determinant
    return in_sine, in_cosine, in_sine * x + in_cosine * y


def _power(values: Array, turned: NDArray[np.complex128]) -> float:
    """Half the explained squares of unit noise: exponential by chance, of mean one."""
    if len(values) < _FEWEST:
        return 0.0
    explained = _fit(values, turned)[2]
    return 0.5 * explained / max(float(np.mean(values**2)), 1e-300)


def _fast(effort: Array, step: float) -> tuple[Array, Array]:
    """(N,) the fast part of an effort; and white."""
    sections = butter(3, _BAND[0], fs=1.0 / step, output='sos')
    fast = effort - sosfiltfilt(sections, effort)
    spectrum = np.fft.rfft(fast)
    level = np.sqrt(np.convolve(np.abs(spectrum) ** 2, np.ones(_SMOOTH) / _SMOOTH, mode='same'))
    level = np.maximum(level, 1e-3 * float(np.max(level)) + 1e-300)
    return fast, np.fft.irfft(spectrum / level, len(fast))
