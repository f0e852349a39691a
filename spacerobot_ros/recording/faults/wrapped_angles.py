"""Angles that begin anew after a turn, or at the ends of another range.

Encoders of continuous joints begin anew after a turn, drivers that send whole numbers at the ends
of what these can say (+-12.5 rad of many), encoders before a gear after a turn of the motor.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...model.robot import Robot
from ...types import Array, BoolArray
from ..record import Record
from .gaps import longest_pause

_TURN = 2.0 * np.pi
_WHOLE = 1.001  # turns that all readings lie within, rounding included
_AMBIGUOUS = 0.25  # turns from sample to sample: twice as far either way round would be as near
_BAD = 0.01  # of the samples, that may be so by a fault
_LIKE = 0.02  # of a range: how near its ends readings jump, and how much jumps may differ
_STEADY = 3.0  # times that a joint may go as far after a jump as before it, or the other way


def with_turns_counted(record: Record, robot: Robot) -> Record:
    """The record with angles that go on where a joint goes round, which its notes say.

    An angle begins anew where its readings lie within one turn and some follow each other by
    almost a turn, or where they jump from one end of all readings to the other while the joint
    goes on; hardly any may follow by much with these taken back: a joint that goes a quarter of
    the way and more between samples stays as it was logged.

    Args:
        record: Joints in the robot's order.
        robot: Tells joints that turn from those that slide.
    """
    joints = record.joints
    if joints is None or len(joints) < 2:
        return record
    time, position, notes = record.joint_time, joints.position.copy(), []
    for j, name in enumerate(joints.names):
        if robot.unit_of('N m', name) != 'N m':
            continue
        after = _begins_anew_after(time, position[:, j])
        if after:
            position[:, j] = np.unwrap(position[:, j], period=after)
            way = 'a turn' if after == _TURN else f'{after:.4g} rad'
            notes.append(f'{name}: angles begin anew after {way}: turns counted')
    if not notes:
        return record
    return record.corrected({'joints': replace(joints, position=position)}, *notes)


def _begins_anew_after(time: Array, angle: Array) -> float | None:
    """What an angle (N,) at times (N,) [s] has lost where it jumps [rad]; None: it does not."""
    is_near = np.diff(time) <= longest_pause(time)
    for period in (_TURN, _range_of(time, angle, is_near)):
        if period and _is_of_one(period, angle, is_near):
            return period
    return None


def _range_of(time: Array, angle: Array, is_near: BoolArray) -> float | None:
    """By how much readings (N,) jump from one of their ends to the other [rad].

    The joint must go on meanwhile, as it did before and does after: then a jump and the way that
    the joint went in it are the range.
    """
    lowest, highest = np.quantile(angle, (0.5 * _BAD, 1.0 - 0.5 * _BAD))
    step, pause = np.diff(angle), np.diff(time)
    at = np.flatnonzero(is_near & (np.abs(step) > 0.5 * (highest - lowest)))
    at = at[(at > 0) & (at < len(step) - 1)]
    before, after = (step[k] / pause[k] * pause[at] for k in (at - 1, at + 1))
    goes, sign = 0.5 * (before + after), np.sign(step[at])
    both = np.sort(np.abs([before, after]), axis=0)
    goes_on = (sign * before < 0.0) & (sign * after < 0.0) & (both[1] < _STEADY * both[0])
    near = _LIKE * (highest - lowest) + 2.0 * np.abs(goes)
    ends = np.where(sign > 0.0, [angle[at], -angle[at + 1]], [angle[at + 1], -angle[at]])
    at_ends = np.all(ends < np.array([[lowest], [-highest]]) + near, axis=0)
    jumps = np.abs(step[at] - goes)[goes_on & at_ends]
    if not len(jumps):
        return None
    period = float(np.median(jumps))
    return period if np.all(np.abs(jumps - period) < _LIKE * period) else None


def _is_of_one(period: float, angle: Array, is_near: BoolArray) -> bool:
    """Whether an angle (N,) is what is left of another one without whole periods."""
    lowest, highest = np.quantile(angle, (0.5 * _BAD, 1.0 - 0.5 * _BAD))
    began_anew = is_near & (np.abs(np.diff(angle)) > 0.5 * period)
    if highest - lowest > _WHOLE * period or not began_anew.any():
        return False
    is_far = np.abs(np.diff(np.unwrap(angle, period=period))) > _AMBIGUOUS * period
    return bool(np.mean(is_far[is_near]) < _BAD and np.mean(is_far[began_anew]) < 0.5)
