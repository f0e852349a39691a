"""A record without what the believed sensor effects did to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import make_interp_spline

from ..effects.effect import Effect
from ..model.robot import Robot
from ..recording.record import JointSeries, Record
from ..types import Array, IntArray
from .faults import SensorFaults


def corrected_record(
    record: Record, robot: Robot, effects: Sequence[Effect], is_held: bool = False
) -> Record:
    """Samples as right sensors with punctual clocks would have taken them.

    Efforts that are later than the rest stay where they are, and say so (`effort_time`).

    Args:
        record: As measured.
        robot: The robot that the effects act on.
        effects: Believed effects; only those of sensors matter here.
        is_held: Whether torques are held between the stamps. A sample that is somewhat late shows
            the same hold, so that late joint states make no torque later.
    """
    faults = SensorFaults(robot, effects)
    if faults.are_none and not (any(faults.delay.values()) or faults.joint_delays):
        return record

    def earlier(stamp_ns: IntArray, clock: str) -> IntArray:
        return stamp_ns - round(faults.delay[clock] * 1e9)

    joints, rates, attitudes = record.joints, record.rates, record.attitudes
    if joints is not None and joints.names:
        stamps = earlier(joints.stamp_ns, 'joints')
        right = _joints(joints, record.joint_time, faults, is_held)
        joints = replace(right, stamp_ns=stamps)
    if rates is not None:
        omega = faults.undo_rate(rates.omega, record.rate_time)
        rates = replace(rates, stamp_ns=earlier(rates.stamp_ns, 'imu'), omega=omega)
    if attitudes is not None:
        q_xyzw = faults.undo_attitude(attitudes.q_xyzw, record.attitude_time)
        stamps = earlier(attitudes.stamp_ns, 'attitude')
        attitudes = replace(attitudes, stamp_ns=stamps, q_xyzw=q_xyzw)
    origin = record.origin_ns
    return replace(record, joints=joints, rates=rates, attitudes=attitudes, zero_ns=origin)


def _joints(series: JointSeries, time: Array, faults: SensorFaults, is_held: bool) -> JointSeries:
    zeros = np.zeros_like(series.position)
    rates = zeros if series.velocity is None else series.velocity
    efforts = zeros if series.effort is None else series.effort
    late = [faults.joint_delays.get(j, 0.0) for j in range(len(series.names))]
    q, qd = (_earlier(time, x, late) for x in (series.position, rates))
    if not is_held:
        efforts = _earlier(time, efforts, late)
    q, qd, effort = faults.undo_joints(q, qd, efforts, time)
    return replace(
        series,
        position=q,
        velocity=None if series.velocity is None else qd,
        effort=None if series.effort is None else effort,
        effort_delay=series.effort_delay
        + faults.delay['effort']
        - (faults.delay['joints'] if is_held else 0.0),
    )


def _earlier(time: Array, values: Array, delays: Sequence[float]) -> Array:
    """(N, n) samples that were so late, column by column, at their own times; the last is held."""
    out = np.array(values)
    for j, delay in enumerate(delays):
        if delay and not np.isnan(values[:, j]).any():
            spline = make_interp_spline(time, values[:, j])
            out[:, j] = spline(np.minimum(time + delay, time[-1]))
    return out
