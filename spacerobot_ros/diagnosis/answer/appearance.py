"""Where in time a residual appears, and with which motion it goes: a hint for people, no evidence.

Each channel's error of the model as it stands is averaged over windows and compared with what the
robot did in the same windows: positions, rates, directions, accelerations, torques, base rates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...json_values import json_as
from ...recording.record import Record
from ...types import Array
from .result import Series

WINDOW = 0.5  # s
_FEWEST = 8  # windows
_SEEN = 1.5  # noise floors; below, there is nothing to look at


@dataclass(frozen=True, slots=True, kw_only=True)
class Appearance:
    """How a channel's error looks beside the motion.

    Args:
        time: Middle of the window in which it is largest [s].
        motion: The quantity that it goes with best, such as `rate of joint_2`.
        correlation: With that quantity, from -1 to 1.
    """

    time: float
    motion: str = json_as('with')
    correlation: float


def appearances(series: tuple[Series, ...], record: Record) -> dict[str, Appearance]:
    """Of every channel whose error stands out of the noise, by the channel's name."""
    motion = _motion(record)
    out = {}
    for channel in series:
        found = _appearance(channel, motion)
        if found is not None:
            out[channel.channel] = found
    return out


def _appearance(series: Series, motion: Mapping[str, tuple[Array, Array]]) -> Appearance | None:
    error = series.before
    if not len(error) or np.sqrt(np.mean(error**2)) < _SEEN * series.noise_floor:
        return None
    edges = np.arange(series.time[0], series.time[-1] + WINDOW, WINDOW)
    middles = 0.5 * (edges[1:] + edges[:-1])
    means = _means(series.time, error, edges)
    seen = np.isfinite(means)
    if seen.sum() < _FEWEST:
        return None
    largest = float(middles[np.nanargmax(np.abs(means))])
    best, most = '', 0.0
    for name, (time, values) in motion.items():
        r = _correlation(means, _means(time, values, edges))
        if abs(r) > abs(most):
            best, most = name, r
    return Appearance(time=largest, motion=best, correlation=most)


def _motion(record: Record) -> dict[str, tuple[Array, Array]]:
    """Quantities by name, each with its times [s] since the record's first stamp."""
    out: dict[str, tuple[Array, Array]] = {}
    origin = record.span_ns[0]
    if record.joints is not None:
        joints = record.joints
        time = (joints.stamp_ns - origin) / 1e9
        for j, name in enumerate(joints.names):
            q = joints.position[:, j]
            rate = np.gradient(q, time) if joints.velocity is None else joints.velocity[:, j]
            smooth = _smoothed(time, rate)
            out[f'position of {name}'] = time, q
            out[f'rate of {name}'] = time, rate
            out[f'direction of {name}'] = time, np.sign(smooth)
            out[f'acceleration of {name}'] = time, np.gradient(smooth, time)
            if joints.effort is not None:
                out[f'torque of {name}'] = time, joints.effort[:, j]
    if record.rates is not None:
        time = (record.rates.stamp_ns - origin) / 1e9
        for i, axis in enumerate('xyz'):
            out[f'base rate about {axis}'] = time, record.rates.omega[:, i]
    return out


def _smoothed(time: Array, values: Array) -> Array:
    """Moving average over a window."""
    count = max(1, round(WINDOW / max(float(np.median(np.diff(time))), 1e-9)))
    kernel = np.ones(count) / count
    padded = np.pad(values, (count // 2, count - 1 - count // 2), mode='edge')
    return np.convolve(padded, kernel, mode='valid')


def _means(time: Array, values: Array, edges: Array) -> Array:
    """(len(edges) - 1,) mean of each window; nan where it has no sample."""
    place = np.searchsorted(edges, time, side='right') - 1
    inside = (place >= 0) & (place < len(edges) - 1)
    total = np.bincount(place[inside], values[inside], len(edges) - 1)
    count = np.bincount(place[inside], minlength=len(edges) - 1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _correlation(a: Array, b: Array) -> float:
    both = np.isfinite(a) & np.isfinite(b)
    if both.sum() < _FEWEST:
        return 0.0
    a, b = a[both] - np.mean(a[both]), b[both] - np.mean(b[both])
    size = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / size if size > 0.0 else 0.0
