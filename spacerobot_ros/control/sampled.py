"""Joint motions through given points."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BPoly, CubicSpline, PPoly

from ..errors import ConfigurationError
from ..types import Array
from .point import Point, rest


class Sampled:
    """A motion through given points.

    Quintic between points with accelerations, cubic Hermite between points with rates only; with
    positions alone a cubic spline at rest at both ends, so that the rate has no jumps.

    Args:
        times: (m,) increasing times since the start, not negative [s].
        q: (m, n) joint positions [rad].
        qd: (m, n) joint rates [rad/s], or None.
        qdd: (m, n) joint accelerations [rad/s^2], or None; needs rates.
        start: Point at t = 0 to come from, used where `times[0]` > 0.

    Raises:
        ConfigurationError: wrong shapes, times that do not increase, or non-finite numbers.
    """

    def __init__(
        self,
        times: Array,
        q: Array,
        qd: Array | None = None,
        qdd: Array | None = None,
        start: Point | None = None,
    ) -> None:
        times = np.asarray(times, dtype=float)
        columns = [
            np.asarray(values, dtype=float) for values in (q, qd, qdd) if values is not None
        ]
        _check_samples(times, columns)
        if qd is None:
            columns = columns[:1]
        if times[0] > 0.0 and start is not None:
            times = np.concatenate([[0.0], times])
            columns = [np.vstack([s, c]) for s, c in zip(start, columns, strict=False)]
        self._first = rest(columns[0][0])
        self._last = rest(columns[0][-1])
        self._start_time = float(times[0])
        self.duration = float(times[-1])
        self._curves = _curves(times, columns) if len(times) > 1 else ()

    def at(self, t: float) -> Point:
        """The point at time t [s]."""
        if t >= self.duration:
            return self._last
        if t < self._start_time:
            return self._first
        return Point(*(np.asarray(curve(t)) for curve in self._curves))


def _curves(times: Array, columns: list[Array]) -> tuple[PPoly | BPoly, ...]:
    if len(columns) == 1:
        curve = CubicSpline(times, columns[0], bc_type='clamped')
    else:
        curve = BPoly.from_derivatives(times, np.stack(columns, axis=1))
    return (curve, curve.derivative(1), curve.derivative(2))


def _check_samples(times: Array, columns: list[Array]) -> None:
    if times.ndim != 1 or len(times) == 0:
        raise ConfigurationError('reference', 'has no points')
    if any(c.shape != columns[0].shape or c.ndim != 2 or len(c) != len(times) for c in columns):
        raise ConfigurationError('reference', 'every point needs one number a joint and kind')
    if not all(np.all(np.isfinite(values)) for values in (times, *columns)):
        raise ConfigurationError('reference', 'is not finite')
    if times[0] < 0.0 or np.any(np.diff(times) <= 0.0):
        raise ConfigurationError('reference', 'times must start at zero or later and increase')
