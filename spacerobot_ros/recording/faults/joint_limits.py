"""Moments at which a joint is at a limit of the URDF: a stop acts there beside its motor.

Nobody measures what a stop does. It acts between two links, so that momentum is kept, and it makes
jumps of a rate that no smooth motion has: right samples, which no screening may leave out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...formats import counted
from ...model.robot import Robot
from ...types import Array, BoolArray
from ..record import Record
from .held_readings import runs
from .thresholds import AROUND_STOP, AT_LIMIT, GIVES_WAY


def with_stops(record: Record, robot: Robot) -> Record:
    """The record with `JointSeries.stopped`, and a note for every joint that reaches a limit.

    Args:
        record: Joints in the robot's order.
        robot: Of the limits; those of a joint that goes on beyond them are no stops.
    """
    joints = record.joints
    if joints is None or joints.stopped is not None or len(joints) < 3:
        return record
    limits = robot.position_limits[: len(joints.names)]
    columns = [
        _at_limits(record.joint_time, q, low, high)
        for q, (low, high) in zip(joints.position.T, limits, strict=True)
    ]
    if not np.any(columns):
        return record
    notes = []
    for name, where in zip(joints.names, columns, strict=True):
        if where.all():
            notes.append(f'{name} rests on its limit throughout: its torque is left out')
        elif count := len(runs(where)):
            times = counted(count, 'time')
            notes.append(f'{name} reaches its limit {times}: those moments are left out')
    return record.corrected({'joints': replace(joints, stopped=np.column_stack(columns))}, *notes)


def jumps(record: Record) -> tuple[tuple[float, float], ...]:
    """Starts and ends of times [s] about which a joint comes to a limit, leaves or moves there."""
    time, stopped = record.joint_time, record.stopped(record.joint_time, record.joint_time)
    gives_way = stopped[1:] & (np.abs(np.diff(record.q, axis=0)) > 0.1 * AT_LIMIT)
    at = time[1:][np.any(np.diff(stopped, axis=0) | gives_way, axis=1)]
    return tuple((t - AROUND_STOP, t + AROUND_STOP) for t in at.tolist())


def without_steps(record: Record, time: Array, values: Array) -> Array:
    """(N, m) slow values at (N,) times less their steps while a joint is at a limit."""
    steps = np.diff(values, axis=0)
    steps[record.stopped(time[:-1], time[1:]).any(axis=1)] = 0.0
    return np.concatenate([values[:1], values[:1] + np.cumsum(steps, axis=0)])


def _at_limits(time: Array, q: Array, low: float, high: float) -> BoolArray:
    """(N,) where a joint at (N,) positions is at a limit, one sample to both sides included."""
    out = np.zeros(len(q), dtype=bool)
    inside = (q >= low) & (q <= high)
    after = int(np.argmax(inside)) if inside.any() else 0  # it may start outside
    levels = np.diff(np.unique(q))
    step = float(levels.min()) if len(levels) else 0.0  # of an encoder; of noise it is far less
    near = max(AT_LIMIT, step if step < GIVES_WAY else 0.0)
    steps = np.diff(time)
    for sign, end in ((1.0, high), (-1.0, -low)):
        way = sign * q
        if not np.isfinite(end) or np.max(way[after:]) > end + GIVES_WAY:
            continue
        out |= way >= end - near
        # between two samples it would have gone on to the limit, and turned round
        on = way[1:-1] + np.diff(way[:-1]) * steps[1:] / steps[:-1]
        met = np.concatenate([[False], (on >= end) & (way[2:] < on), [False]])
        out |= met | np.roll(met, 1)
    widened = out.copy()
    widened[1:] |= out[:-1]
    widened[:-1] |= out[1:]
    return widened
