"""A sampled motion of joints as a reference, with as many derivatives as its samples give."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BPoly, CubicSpline, PPoly

from ..errors import ConfigurationError
from ..types import Array
from .joint_reference import Setpoint, rest


class Waypoints:
    """A motion through given setpoints.

    Quintic between setpoints with accelerations, cubic Hermite between those with rates only;
    with positions alone a cubic spline at rest at both ends, so that the rate has no jumps.

    Args:
        times: (m,) increasing times since the start, not negative [s].
        q: (m, n) joint positions [rad].
        qd: (m, n) joint rates [rad/s], or None.
        qdd: (m, n) joint accelerations [rad/s^2], or None; needs rates.
        start: Setpoint at t = 0 to come from, used where `times[0]` > 0.

    Raises:
        ConfigurationError: wrong shapes, times that do not increase, or non-finite numbers.
    """

    def __init__(
        self,
        times: Array,
        q: Array,
        qd: Array | None = None,
        qdd: Array | None = None,
        start: Setpoint | None = None,
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
        with np.errstate(all='ignore'):  # what overflows is refused by whoever knows the limits
            self._curves = _curves(times, columns) if len(times) > 1 else ()

    def at(self, t: float) -> Setpoint:
        """The setpoint at time t [s]."""
        if t >= self.duration:
            return self._last
        if t < self._start_time:
            return self._first
        return Setpoint(*(np.asarray(curve(t)) for curve in self._curves))

    def sampled(self) -> tuple[Array, Array]:
        """Positions (T, n) [rad] and rates (T, n) [rad/s] along the motion, 32 a piece.

        A quintic has at most two extrema of its rate in a piece: between two samples it can be
        missed by some 0.1 % of its change in the piece.
        """
        if not self._curves:
            return self._last.q[None], self._last.qd[None]
        breaks = self._curves[0].x
        times = breaks[:-1, None] + np.linspace(0.0, 1.0, 32) * np.diff(breaks)[:, None]
        q, qd = (np.asarray(curve(times.ravel())) for curve in self._curves[:2])
        return q, qd


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
