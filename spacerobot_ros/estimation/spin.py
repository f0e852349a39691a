r"""Rate and axis of a spin that a magnetometer sees, without a model of the field.

A body that spins at w about the unit axis n sees a field that stands still in space as

    m(t) = a + c cos(w t) + s sin(w t),    n = s x c / |s x c|,

with the part of the field along n, and whatever iron adds, in a. So w n is measured in the
magnetometer's axes, free of offsets; w is found by trying. A window must be short beside the orbit
and hold some turns.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import chdtrc

from ..recording.record import Record
from ..types import Array, Vector3

LONGEST = 180.0  # s; in a low orbit the field turns by 20 deg meanwhile
TURNS, _SAMPLES = 1.5, 30  # at least, in a window
_PAUSE = 4.0  # periods of the gyro
_RANGE = (0.6, 1.6)  # of the rate that the gyro says: bias and scale may be that wrong
_LEAST_SHARE = 0.02  # of the spin that a nutation has
_SEEN = 0.5  # share of the field's variation that the spin must explain


@dataclass(frozen=True, slots=True, eq=False)
class SpinWindow:
    """One window of a spin.

    Args:
        recording: Number of its recording.
        time: (K,) of its gyro samples [s].
        gyro: (K, 3) what the gyro says [rad/s].
        spin: (3,) w n by the magnetometer, in its axes [rad/s].
    """

    recording: int
    time: Array
    gyro: Array
    spin: Vector3

    @property
    def mean(self) -> Vector3:
        """(3,) of what the gyro says [rad/s]."""
        return np.asarray(np.mean(self.gyro, axis=0))


def spin_windows(records: Sequence[Record]) -> list[SpinWindow]:
    """Windows of recordings in which the body spins and the magnetometer sees it."""
    return [window for i, record in enumerate(records) for window in _windows(i, record)]


def _windows(number: int, record: Record) -> list[SpinWindow]:
    time, omega = record.rate_time, record.omega
    series = record.inputs['magnetic_field']
    at, field = series.seconds(record.origin_ns), series.values
    pause = _PAUSE * float(np.median(np.diff(time)))
    out = []
    for part in np.split(np.arange(len(time)), np.flatnonzero(np.diff(time) > pause) + 1):
        length = float(time[part[-1]] - time[part[0]])
        for piece in np.array_split(part, max(1, math.ceil(length / LONGEST))):
            start, end = time[piece[0]], time[piece[-1]]
            inside = (at >= start) & (at <= end)
            rate: float = float(np.linalg.norm(np.mean(omega[piece], axis=0)))
            turns = rate * (end - start) / (2.0 * math.pi)
            fewest = min(len(piece), int(np.sum(inside)))
            if fewest < _SAMPLES or turns < TURNS:
                continue
            spin = _spin(at[inside], field[inside], rate)
            if spin is not None:
                out.append(SpinWindow(number, time[piece], omega[piece], spin))
    return out


def _spin(time: Array, field: Array, rate: float) -> Vector3 | None:
    """(3,) w n [rad/s]; None where the field does not vary as in a spin."""
    t = time - np.mean(time)

    def left(w: float) -> float:
        return float(np.sum((field - _fit(t, field, w)[0]) ** 2))

    low, high = (share * rate for share in _RANGE)
    step = math.pi / (4.0 * np.ptp(t))  # an eighth of what two lines need to be told apart
    coarse = np.arange(low, high, step)
    best = float(coarse[np.argmin([left(w) for w in coarse])])
    w = float(minimize_scalar(left, bounds=(best - step, best + step), method='bounded').x)
    total = float(np.sum((field - np.mean(field, axis=0)) ** 2))
    if total == 0.0 or left(w) > (1.0 - _SEEN) * total:
        return None
    c, s = _fit(t, field, w)[1][1:3]
    normal = np.cross(s, c)
    return np.asarray(w * normal / np.linalg.norm(normal))


def _fit(t: Array, field: Array, w: float) -> tuple[Array, Array]:
    """The fitted field, and coefficients of 1, cos, sin, a slow trend."""
    design = np.stack([np.ones_like(t), np.cos(w * t), np.sin(w * t), t], axis=1)
    coefficients = np.linalg.lstsq(design, field, rcond=None)[0]
    return design @ coefficients, coefficients


@dataclass(frozen=True, slots=True, eq=False)
class Nutation:
    """A line of the gyro at a share of the spin that all windows have in common.

    Args:
        share: kappa; kappa |w| is the rate at which the axis nutates in the body.
        std: Its standard deviation.
        p_value: Of such a line by chance, of as many shares as were tried.
        shares: (M,) of every window alone, about the common one.
        stds: (M,) of these; infinite where a window says nothing.
    """

    share: float
    std: float
    p_value: float
    shares: Array
    stds: Array

    def taken_from(self, window: SpinWindow) -> Array:
        """(K, 3) what the gyro says, without the line."""
        design = _line(window, self.share)
        fit = np.linalg.lstsq(
            np.column_stack([np.ones(len(design)), design]), window.gyro, rcond=None
        )[0]
        return np.asarray(window.gyro - design @ fit[1:])


def _line(window: SpinWindow, share: float) -> Array:
    """(K, 2) of a window, its mean about zero."""
    phase = share * np.linalg.norm(window.spin) * (window.time - np.mean(window.time))
    return np.stack([np.cos(phase), np.sin(phase)], axis=1)


def nutation(windows: Sequence[SpinWindow]) -> Nutation:
    """The clearest line; amplitude and phase are each window's own."""
    signals = []
    for window in windows:
        across = window.gyro - window.mean
        axis = window.spin / np.linalg.norm(window.spin)
        across = across - np.outer(across @ axis, axis)
        signals.append(across @ np.linalg.svd(across, full_matrices=False)[2][0])
    total = sum(float(x @ x) for x in signals)
    count = sum(len(x) for x in signals)

    def explained(kappa: float) -> Array:
        """(M,) squares."""
        out = []
        for window, x in zip(windows, signals, strict=True):
            design = _line(window, kappa)
            out.append(float(x @ (design @ np.linalg.lstsq(design, x, rcond=None)[0])))
        return np.array(out)

    turned = [np.linalg.norm(w.spin) * np.ptp(w.time) for w in windows]
    step = 0.5 / float(max(turned))
    grid = np.arange(_LEAST_SHARE, 1.0, step)
    best = float(grid[np.argmax([np.sum(explained(k)) for k in grid])])
    ends = (best - step, best + step)
    kappa = float(
        minimize_scalar(lambda k: -np.sum(explained(k)), bounds=ends, method='bounded').x
    )
    d = 0.2 * step
    before, here, after = (explained(k) for k in (kappa - d, kappa, kappa + d))
    left = max(total - float(np.sum(here)), np.finfo(float).tiny)
    variance = left / count
    bend = (2.0 * here - before - after) / (2.0 * variance * d**2)
    slope = (after - before) / (4.0 * variance * d)
    is_told = bend > 0.0
    informed = np.where(is_told, bend, 1.0)
    gain = count * math.log(total / left)
    return Nutation(
        kappa,
        float(max(np.sum(bend), np.finfo(float).tiny) ** -0.5),
        min(1.0, float(chdtrc(2 * len(windows), gain)) * len(grid)),
        kappa + np.where(is_told, slope / informed, 0.0),
        np.where(is_told, informed**-0.5, np.inf),
    )
