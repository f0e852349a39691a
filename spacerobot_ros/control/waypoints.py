"""A sampled motion of joints as a reference, with as many derivatives as its samples give.

With tolerances it is a goal, as an action asks for it: going on, reached or failed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy

from ..errors import ConfigurationError, MessageRejectedError
from ..types import Array
from .command import Command
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


def _curves(
    times: Array, columns: list[Array]
) -> tuple[scipy.interpolate.PPoly | scipy.interpolate.BPoly, ...]:
    if len(columns) == 1:
        curve = scipy.interpolate.CubicSpline(times, columns[0], bc_type='clamped')
    else:
        curve = scipy.interpolate.BPoly.from_derivatives(times, np.stack(columns, axis=1))
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


SUCCESSFUL, INVALID_GOAL, INVALID_JOINTS = 0, -1, -2
PATH_TOLERANCE_VIOLATED, GOAL_TOLERANCE_VIOLATED = -4, -5


class GoalEnd(NamedTuple):
    """How a goal ended: a code of control_msgs/FollowJointTrajectory, and in words."""

    code: int
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Tolerances:
    """Largest errors of each joint: position (n,) [rad] and rate (n,) [rad/s]; may be infinite."""

    position: Array
    rate: Array

    @classmethod
    def of(cls, given: Any, names: list[str]) -> Tolerances:
        """From control_msgs/JointTolerance messages; what is not above zero is no limit.

        Raises:
            MessageRejectedError: a joint that is unknown.
        """
        asked: Mapping[str, Any] = {t.name: t for t in given}
        if unknown := sorted(set(asked) - set(names)):
            raise MessageRejectedError(f'tolerance of unknown joints: {", ".join(unknown)}')

        def column(kind: str) -> Array:
            values = [getattr(asked[name], kind) if name in asked else 0.0 for name in names]
            return np.array([value if value > 0.0 else np.inf for value in values])

        return cls(column('position'), column('velocity'))

    def broken(self, command: Command, units: Mapping[str, str]) -> str:
        """Which joint is how far beyond; empty where none is.

        Args:
            command: With the errors.
            units: Of the joints' positions, by their names.
        """
        for what, per, error, limit in (
            ('position', '', command.error, self.position),
            ('rate', '/s', command.error_rate, self.rate),
        ):
            every = zip(units.items(), np.abs(error), limit, strict=True)
            for (name, unit), value, most in every:
                if value > most:
                    return f'{name}: {what} off by {value:.4g} {unit}{per}, at most {most:.4g}'
        return ''


class TrajectoryGoal:
    """Judges commands on the way to the end of a trajectory and after it.

    Args:
        units: Of the n joints' positions, by their names.
        path: Tolerances on the way.
        goal: Tolerances at the end.
        patience: Time after the end by which those must hold [s]; zero: any.
    """

    def __init__(
        self, units: Mapping[str, str], path: Tolerances, goal: Tolerances, patience: float
    ) -> None:
        self._units, self._path, self._goal, self._patience = units, path, goal, patience

    def judge(self, command: Command, time_left: float) -> GoalEnd | None:
        """How the goal ended at a command; None while it goes on.

        Args:
            command: The newest.
            time_left: Time to the end of the trajectory [s]; negative after it.
        """
        if time_left > 0.0:
            broken = self._path.broken(command, self._units)
            return GoalEnd(PATH_TOLERANCE_VIOLATED, broken) if broken else None
        broken = self._goal.broken(command, self._units)
        if not broken:
            return GoalEnd(SUCCESSFUL, '')
        is_late = self._patience > 0.0 and -time_left > self._patience
        return GoalEnd(GOAL_TOLERANCE_VIOLATED, broken) if is_late else None
