"""A record without what the believed sensor effects did to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..effects.effect import Effect
from ..model.robot import Robot
from ..recording.record import AttitudeSeries, JointSeries, RateSeries, Record
from ..types import IntArray
from .faults import SensorFaults


def corrected_record(record: Record, robot: Robot, effects: Sequence[Effect]) -> Record:
    """Samples as right sensors with punctual clocks would have taken them.

    Args:
        record: As measured.
        robot: The robot that the effects act on.
        effects: Believed effects; only those of sensors matter here.
    """
    faults = SensorFaults(robot, effects)
    if faults.are_none and not any(faults.delay.values()):
        return record
    return replace(
        record,
        joints=None if record.joints is None else _joints(record.joints, faults),
        rates=None if record.rates is None else _rates(record.rates, faults),
        attitudes=None if record.attitudes is None else _attitudes(record.attitudes, faults),
    )


def _joints(series: JointSeries, faults: SensorFaults) -> JointSeries:
    """Efforts that are later than the rest are read that much later."""
    zeros = np.zeros_like(series.position)
    rates = zeros if series.velocity is None else series.velocity
    efforts = zeros if series.effort is None else series.effort
    q, qd, effort = faults.undo_joints(series.position, rates, efforts)
    if faults.delay['effort']:
        at = series.stamp_ns.astype(float)
        later = at + faults.delay['effort'] * 1e9
        effort = np.stack([np.interp(later, at, column) for column in effort.T], axis=1)
    return replace(
        series,
        stamp_ns=_earlier(series.stamp_ns, faults.delay['joints']),
        position=q,
        velocity=None if series.velocity is None else qd,
        effort=None if series.effort is None else effort,
    )


def _rates(series: RateSeries, faults: SensorFaults) -> RateSeries:
    stamps = _earlier(series.stamp_ns, faults.delay['imu'])
    return replace(series, stamp_ns=stamps, omega=faults.undo_rate(series.omega))


def _attitudes(series: AttitudeSeries, faults: SensorFaults) -> AttitudeSeries:
    stamps = _earlier(series.stamp_ns, faults.delay['attitude'])
    return replace(series, stamp_ns=stamps, q_xyzw=faults.undo_attitude(series.q_xyzw))


def _earlier(stamp_ns: IntArray, delay: float) -> IntArray:
    return stamp_ns - round(delay * 1e9)
