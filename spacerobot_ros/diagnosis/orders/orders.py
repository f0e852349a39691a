"""Lines of raw signals against the angles of joints and wheels.

Of a joint's effort against its own angle: the ripple of its gear and motor. Of the gyro and of all
joints' efforts against the angle of each wheel, which is the integral of its measured rate:
imbalance, bearings, motors. Lines of a joint that slides are 2 pi times their periods a metre.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from ...inference.decisive import CONFOUNDED
from ...recording.record import Record
from ...types import Array, BoolArray
from ..answer.result import Order
from .order_lines import BAND, FEWEST, FastSignal, OrderLine, Turning, lines_of, rival_power

_HIGHEST = 1000.0  # periods a turn
_HIGHEST_SLIDING = 2.0 * math.pi / 1e-3  # rad/m: threads of a millimetre
_LEAST = 8.0  # periods a turn of a joint: fewer are slow enough for the balance
_COARSE = 0.2  # sample steps a period of the band: more are none
_HOLE = 3.0  # times the usual step between samples
_MOST = 3  # lines of a wheel
_NEARLY = 0.8  # of what a line explains: two wheels that turn alike, but for noise of their rates
_ONE = 0.02  # of its order: lines that are one


@dataclass(frozen=True, slots=True, eq=False)
class _Grid:
    """Evenly spaced times within several series (N,), and where all of them have samples."""

    time: Array
    step: float
    is_there: BoolArray

    @classmethod
    def of(cls, first: Array, *others: Array) -> _Grid | None:
        """As far apart as samples of the first; None where they are few, or slow."""
        if any(len(times) < 2 for times in (first, *others)):
            return None
        step = float(np.median(np.diff(first)))
        start, end = (pick(t[i] for t in (first, *others)) for pick, i in ((max, 0), (min, -1)))
        time = np.arange(start, end, step)
        if len(time) < FEWEST or BAND[0] * step > _COARSE:
            return None
        is_there = np.ones(len(time), dtype=bool)
        for times in (first, *others):
            gaps = np.diff(times)
            is_there &= np.interp(time, times[1:], gaps) <= _HOLE * float(np.median(gaps))
        return cls(time, step, is_there)


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
    if record.effort is None or np.isnan(record.effort[:, j]).any():
        return []
    time = record.joint_time
    grid = _Grid.of(time)
    if grid is None:
        return []
    q, effort = (np.interp(grid.time, time, x[:, j]) for x in (record.q, record.effort))
    highest = _HIGHEST_SLIDING if unit == 'N' else _HIGHEST
    turning = Turning(q, grid.step, grid.is_there, _LEAST, highest)
    return [_order(joint, unit, line) for line in lines_of(FastSignal(effort, grid.step), turning)]


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
        grid = _Grid.of(at, time)
        if grid is None:
            continue
        turning = {
            wheel: Turning(angle, grid.step, grid.is_there, 0.0, _HIGHEST)
            for wheel, angle in zip(wheels.names, angles(grid.time).T, strict=True)
        }
        for channel, unit, values in signals:
            signal = FastSignal(np.interp(grid.time, at, values), grid.step)
            for wheel, line in _distinguished(signal, turning):
                found[wheel].append(_order(wheel, unit, line, channel))
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


def _distinguished(
    signal: FastSignal, turning: Mapping[str, Turning]
) -> Iterator[tuple[str, OrderLine]]:
    """Lines of a signal with their wheels, but those that another wheel tells as two causes do."""
    for wheel, own in turning.items():
        others = [other for name, other in turning.items() if name != wheel]
        for line in lines_of(signal, own):
            rivals = [rival_power(signal, own, line.order, other, _ONE) for other in others]
            most = max(rivals, default=0.0)
            if line.power > most + CONFOUNDED and most < _NEARLY * line.power:
                yield wheel, line


def _clearest(orders: Sequence[Order]) -> list[Order]:
    """The clearest lines of a wheel: of those of one order in several signals the first."""
    out: list[Order] = []
    for order in sorted(orders, key=lambda it: it.p_value):
        if all(abs(order.order - known.order) > _ONE * known.order for known in out):
            out.append(order)
    return out[:_MOST]


def _order(place: str, unit: str, line: OrderLine, channel: str = '') -> Order:
    return Order(place, unit, line.order, line.amplitude, line.phase, line.p_value, channel)
