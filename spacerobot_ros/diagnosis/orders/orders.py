"""Lines of raw signals against the angles of joints and wheels.

Of a joint's effort against its own angle: the ripple of its gear and motor. Of the gyro and of all
joints' efforts against the angle of each wheel, which is the integral of its measured rate:
imbalance, bearings, motors. Lines of a joint that slides are 2 pi times their periods a metre.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from ...recording.record import Record
from ...types import Array, BoolArray
from ..answer.result import Order
from .order_lines import BAND, FEWEST, MOST, ONE, OrderSpectrum, lines_of

_HIGHEST = 1000.0  # periods a turn
_HIGHEST_SLIDING = 2.0 * math.pi / 1e-3  # rad/m: threads of a millimetre
_LEAST = 8.0  # periods a turn of a joint: fewer are slow enough for the balance
_COARSE, _HOLE = 0.2, 3.0  # most sample steps a period of the band; times a usual step


def _grid(*every: Array) -> tuple[Array, float, BoolArray] | None:
    """Evenly spaced times (N,) within several series, as far apart as samples of the first.

    Beside them their step [s] and where all series have samples; None where they are few or slow.
    """
    if any(len(times) < 2 for times in every):
        return None
    step = float(np.median(np.diff(every[0])))
    time = np.arange(max(t[0] for t in every), min(t[-1] for t in every), step)
    if len(time) < FEWEST or BAND[0] * step > _COARSE:
        return None
    is_there = np.ones(len(time), dtype=bool)
    for times in every:
        gaps = np.diff(times)
        is_there &= np.interp(time, times[1:], gaps) <= _HOLE * float(np.median(gaps))
    return time, step, is_there


def find_orders(records: Sequence[Record], units: Mapping[str, str]) -> tuple[Order, ...]:
    """The highest lines of every joint and wheel that turns, where they are no chance and no hump.

    Of several recordings the one that shows a joint or a wheel best is taken.

    Args:
        records: Of the same joints.
        units: Of their efforts, by joint in the order of the records.
    """
    best: dict[str, list[Order]] = {joint: [] for joint in units}
    for record in records:
        joints = {name: _of_joint(record, j, name, units[name]) for j, name in enumerate(units)}
        for name, found in (joints | wheel_orders(record, units)).items():
            known = best.get(name)
            if not known or (found and found[0].p_value <= known[0].p_value):
                best[name] = found
    return tuple(order for found in best.values() for order in found)


def _of_joint(record: Record, j: int, joint: str, unit: str) -> list[Order]:
    grid = _grid(record.joint_time)
    if grid is None or record.effort is None or np.isnan(record.effort[:, j]).any():
        return []
    q, effort = (np.interp(grid[0], record.joint_time, x[:, j]) for x in (record.q, record.effort))
    highest = _HIGHEST_SLIDING if unit == 'N' else _HIGHEST
    spectra = {joint: OrderSpectrum(q, *grid[1:], _LEAST, highest)}
    return [*lines_of(effort, grid[1], spectra, unit)]


def wheel_orders(record: Record, units: Mapping[str, str]) -> dict[str, list[Order]]:
    """Lines against the angle of each wheel whose rate was measured, the clearest first.

    Args:
        record: Of one run.
        units: Of the joints' efforts, by joint in the order of the record.
    """
    wheels = record.wheels
    if wheels is None or wheels.velocity is None or len(wheels) < FEWEST:
        return {}
    time = wheels.seconds(record.origin_ns)
    angles = CubicSpline(time, wheels.velocity).antiderivative()
    found: dict[str, list[Order]] = {wheel: [] for wheel in wheels.names}
    for at, signals in _signals(record, units):
        if (grid := _grid(at, time)) is None:
            continue
        spectra = {
            wheel: OrderSpectrum(angle, *grid[1:], 0.0, _HIGHEST)
            for wheel, angle in zip(wheels.names, angles(grid[0]).T, strict=True)
        }
        for channel, unit, values in signals:
            own = np.interp(grid[0], at, values)
            for line in lines_of(own, grid[1], spectra, unit, channel):
                found[line.joint].append(line)
    return {wheel: _clearest(own) for wheel, own in found.items()}


def _signals(
    record: Record, units: Mapping[str, str]
) -> Iterator[tuple[Array, list[tuple[str, str, Array]]]]:
    """Times of a sensor's samples, with channel, unit and values (N,) of each signal."""
    axes = [(f'gyro/{"xyz"[i]}', 'rad/s', record.omega[:, i]) for i in record.gyro_axes]
    yield record.rate_time, axes
    if record.effort is not None:
        pairs = zip(units.items(), record.effort.T, strict=True)
        efforts = [(f'joint_torque/{joint}', unit, own) for (joint, unit), own in pairs]
        yield record.effort_time, [it for it in efforts if not np.isnan(it[2]).any()]


def _clearest(orders: Sequence[Order]) -> list[Order]:
    """The clearest lines of a wheel: of those of one order in several signals the first."""
    out: list[Order] = []
    for order in sorted(orders, key=lambda it: it.p_value):
        if all(abs(order.order - known.order) > ONE * known.order for known in out):
            out.append(order)
    return out[:MOST]
