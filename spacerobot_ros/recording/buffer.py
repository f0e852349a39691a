"""Samples as they arrive: one buffer and one rule of lateness, for nodes and cores alike.

A sensor's samples may come in any order and beside those of other sensors. One is refused when it
is no sample (wrong length, not finite), the second with its stamp, further behind the newest of
its sensor than the lateness, of a time that has been used already, or far ahead of all others.
One thread may read a `SampleBuffer` while another fills it.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from threading import RLock

import numpy as np

from ..errors import MessageRejectedError
from ..model.robot import Robot
from ..types import Array, IntArray, Quaternion, Vector3
from .messages import finite, unit, vector
from .record import AttitudeSeries, JointSeries, RateSeries, Record, shown
from .series import InputSeries

WHEELS = 'wheels'
"""Key of a `SampleBuffer`'s input that becomes a record's `wheels` [rad/s]."""
SENSORS = ('imu', 'attitude', 'joints')  # in the order in which equal stamps are used
PATIENCE_NS = 1_000_000_000  # for a sensor that is silent, on its stamps and on the wall
MOST_SAMPLES = 100_000
"""Of a sensor in a `SampleBuffer` that is emptied as it is used: 100 s at 1 kHz, 30 MB. Where
messages come faster than that for long, the oldest are dropped."""
JUMP_NS = 1_000_000_000  # stamps that go back further are another run, not out of order


LATEST_NS = 10_000_000_000  # by which a known input may act late: `command_delay` is no longer


def sensors_of(robot: Robot) -> tuple[str, ...]:
    """Sensors that are waited for: of a fixed base its joints, of a lone base all others."""
    if not robot.is_free:
        return ('joints',)
    return SENSORS if robot.joints else SENSORS[:2]


def check_later(stamp_ns: int, newest_ns: int | None, lateness_ns: int | None = 0) -> None:
    """Refuse a stamp that is the newest again, or further behind it than the lateness [ns].

    Raises:
        MessageRejectedError: it is.
    """
    if stamp_ns == newest_ns:
        raise MessageRejectedError('duplicate stamp')
    back = 0 if newest_ns is None else newest_ns - stamp_ns
    if lateness_ns is not None and back > lateness_ns:
        raise MessageRejectedError(f'stamp goes backwards by {shown(back * 1e-9)}')


class Stream:
    """Samples of one sensor in the order of their stamps.

    Args:
        lateness_ns: How far a stamp may lie before the newest one [ns]; None: as far as it likes.
        most: Number of samples to keep, about; None: all.
    """

    def __init__(self, lateness_ns: int | None = None, most: int | None = None) -> None:
        self._lateness_ns, self._most = lateness_ns, most
        self.stamps: list[int] = []
        self.values: list[Array] = []
        self.newest_ns: int | None = None
        self._newest_seen: tuple[int | None, int] | None = (
            None  # newest stamp, and when it was so first
        )

    def add(self, stamp_ns: int, value: Array) -> None:
        """Put a sample (m,) in its place.

        Raises:
            MessageRejectedError: not finite, too late, or a second one with its stamp.
        """
        finite(value, 'sample')
        place = len(self.stamps)
        if self.newest_ns is not None and stamp_ns <= self.newest_ns:
            place = bisect_left(self.stamps, stamp_ns)
            is_known = stamp_ns in self.stamps[place : place + 1]
            check_later(stamp_ns, stamp_ns if is_known else self.newest_ns, self._lateness_ns)
        self.stamps.insert(place, stamp_ns)
        self.values.insert(place, value)
        self.note(stamp_ns)
        if self._most is not None and len(self.stamps) > self._most:
            self.forget(self.stamps[self._most // 10])

    def note(self, stamp_ns: int) -> None:
        """Hear of a sample, whether it can be used or not."""
        self.newest_ns = max(stamp_ns, stamp_ns if self.newest_ns is None else self.newest_ns)

    def silent_ns(self, now_ns: int) -> int:
        """Time since its newest stamp was first seen here [ns], on a clock that never jumps."""
        if self._newest_seen is None or self._newest_seen[0] != self.newest_ns:
            self._newest_seen = self.newest_ns, now_ns
        return now_ns - self._newest_seen[1]

    def after(self, stamp_ns: int) -> int | None:
        """The first stamp after one [ns]; None where there is none."""
        place = bisect_right(self.stamps, stamp_ns)
        return self.stamps[place] if place < len(self.stamps) else None

    def between(self, start_ns: int, end_ns: int) -> tuple[IntArray, Array]:
        """Stamps (N,) [ns] and values (N, m) from start to end, both included."""
        part = slice(bisect_left(self.stamps, start_ns), bisect_right(self.stamps, end_ns))
        return np.array(self.stamps[part], dtype=np.int64), np.array(self.values[part])

    def holding(self, stamp_ns: int) -> int:
        """Stamp of the sample that holds at a time [ns]; that time where there is none."""
        place = bisect_right(self.stamps, stamp_ns)
        return self.stamps[place - 1] if place else stamp_ns

    def forget(self, before_ns: int) -> None:
        """Drop the samples before a stamp."""
        count = bisect_left(self.stamps, before_ns)
        del self.stamps[:count], self.values[:count]


class SampleBuffer:
    """Samples of joints, gyro and star tracker of one robot, and how far they are complete.

    Args:
        joints: Names of the n joints.
        lateness: How far a sample may come behind the newest of its sensor [s]; None: any.
        ahead: How far its stamp may lie before all others [s].
        sensors: Those that are waited for.

    Attributes:
        inputs: Names and samples of known inputs by key, rates of own wheels among them.
        streams: Samples by sensor, a joint's as [q, qd, effort, whether there is an effort].
        origin_ns: First stamp of all [ns]; None before it.
        closed_ns: Stamps up to this one are used: another one there comes too late [ns].
    """

    def __init__(
        self,
        joints: tuple[str, ...],
        lateness: float | None = None,
        ahead: float = np.inf,
        sensors: tuple[str, ...] = SENSORS,
    ) -> None:
        self._joints, self._sensors, self._ahead = joints, sensors, ahead
        late = None if lateness is None else round(lateness * 1e9)
        # without a lateness it holds a record that somebody wants whole
        most = None if late is None else MOST_SAMPLES
        self.streams = {sensor: Stream(late, most) for sensor in SENSORS}
        self.inputs: dict[str, tuple[tuple[str, ...], Stream]] = {}
        self._lock = RLock()
        self.origin_ns: int | None = None
        self.closed_ns: int | None = None

    @property
    def newest_ns(self) -> int | None:
        """Newest stamp of all [ns]; None where nothing came."""
        return max(
            (s.newest_ns for s in self.streams.values() if s.newest_ns is not None), default=None
        )

    @property
    def missing(self) -> tuple[str, ...]:
        """Sensors that are waited for and never had a sample."""
        return tuple(name for name in self._sensors if self.streams[name].newest_ns is None)

    def add_joints(self, stamp_ns: int, q: Array, qd: Array, effort: Array | None = None) -> None:
        """Add positions (n,) [rad], rates (n,) [rad/s] and torques (n,) [N m]; raises as `add`."""
        n = len(self._joints)
        if not n:
            return  # the base's own samples say when
        torque = np.zeros(n) if effort is None else effort
        columns = (('position', q), ('velocity', qd), ('effort', torque))
        row = [vector(values, n, what) for what, values in columns]
        self.add('joints', stamp_ns, np.concatenate([*row, [effort is not None]]))

    def add_rate(self, stamp_ns: int, omega_WB_B: Vector3) -> None:
        """Add omega_WB_B (3,) [rad/s]; raises as `add`."""
        self.add('imu', stamp_ns, vector(omega_WB_B, 3, 'angular velocity'))

    def add_attitude(self, stamp_ns: int, q_WB_xyzw: Quaternion) -> None:
        """Add an attitude (4,); raises as `add`, and for a norm off by more than 1e-3."""
        self.add('attitude', stamp_ns, unit(q_WB_xyzw))

    def add_input(self, key: str, names: Sequence[str], stamp_ns: int, values: Array) -> None:
        """Add values (k,) of a known input, which hold from a stamp on; nobody waits for them.

        Args:
            key: Of `Record.inputs`.
            names: The k columns.
            stamp_ns: From when on [ns].
            values: In SI.

        Raises:
            MessageRejectedError: not finite, wrong length, or a second one with its stamp.
        """
        with self._lock:
            _, stream = self.inputs.setdefault(key, (tuple(names), Stream()))
            stream.add(stamp_ns, vector(values, len(names), key))

    def _inputs(self, start_ns: int, end_ns: int) -> dict[str, InputSeries]:
        """Every input up to the end, from what may still act at the start on."""
        out = {}
        for key, (names, stream) in self.inputs.items():
            stamps, values = stream.between(stream.holding(start_ns - LATEST_NS), end_ns)
            if len(stamps):
                out[key] = InputSeries(names, stamps, values)
        return out

    def add(self, sensor: str, stamp_ns: int, value: Array) -> None:
        """Add a sample that has been checked.

        Raises:
            MessageRejectedError: see the top of this file.
        """
        with self._lock:
            if self.closed_ns is not None and stamp_ns <= self.closed_ns:
                self.streams[sensor].note(stamp_ns)  # heard again, and waited for from now on
                raise MessageRejectedError('stamp goes backwards, too late to be used')
            newest = self.newest_ns
            if newest is not None and (stamp_ns - newest) * 1e-9 > self._ahead:
                raise MessageRejectedError(
                    f'stamp {shown((stamp_ns - newest) * 1e-9)} ahead of all others, at most '
                    f'{self._ahead:g} s can be bridged; check the clock, or reset'
                )
            self.streams[sensor].add(stamp_ns, value)
            times = self.streams['joints']
            if not self._joints and stamp_ns not in times.stamps:
                times.add(stamp_ns, np.ones(1))
            if self.closed_ns is None:
                first_ns = stamp_ns if self.origin_ns is None else self.origin_ns
                self.origin_ns = min(stamp_ns, first_ns)

    def settled_ns(self, now_ns: int | None = None) -> int | None:
        """Stamp up to which every sensor has come; None before the first sample.

        A sensor is not waited for when it lags by more than the patience and has been silent for
        as long on the wall: one that is merely worked off slower than others is not dead.

        Args:
            now_ns: Time of a clock that never jumps [ns], asked again with every sample; None:
                there is no wall.
        """
        newest = self.newest_ns
        if newest is None or self.origin_ns is None:
            return None
        settled = newest
        for name in self._sensors:
            stream = self.streams[name]
            reached = self.origin_ns - 1 if stream.newest_ns is None else stream.newest_ns
            is_silent = now_ns is None or stream.silent_ns(now_ns) > PATIENCE_NS
            if not (is_silent and newest - reached > PATIENCE_NS):
                settled = min(settled, reached)
        return settled

    def forget(self, keep: float) -> None:
        """Drop samples older than the newest of all by more than a time [s], used or not."""
        with self._lock:
            if self.newest_ns is not None:
                for stream in self.streams.values():
                    stream.forget(self.newest_ns - round(keep * 1e9))

    def record(self, start_ns: int | None = None, end_ns: int | None = None) -> Record:
        """The samples from start to end, both included, in seconds from the first of all."""
        ends = (
            -(2**63) if start_ns is None else start_ns,
            2**63 - 1 if end_ns is None else end_ns,
        )
        n = len(self._joints)
        joints = rates = attitudes = None
        with self._lock:
            parts = {sensor: stream.between(*ends) for sensor, stream in self.streams.items()}
        stamps, rows = parts['joints']
        if len(stamps):
            q, qd, effort, has_effort = np.split(rows, [n, 2 * n, 3 * n], axis=1)
            joints = JointSeries(self._joints, stamps, q, qd, effort if has_effort.all() else None)
        stamps, rows = parts['imu']
        if len(stamps):
            rates = RateSeries(stamps, rows)
        stamps, rows = parts['attitude']
        if len(stamps):
            attitudes = AttitudeSeries(stamps, rows)
        zero_ns = self.origin_ns or 0
        inputs = self._inputs(zero_ns if start_ns is None else start_ns, ends[1])
        wheels = None
        if (turning := inputs.pop(WHEELS, None)) is not None:
            zero = np.zeros_like(turning.values)
            wheels = JointSeries(turning.names, turning.stamp_ns, zero, turning.values)
        return Record(joints, rates, attitudes, wheels, zero_ns=zero_ns, inputs=inputs)

    def after(self, stamp_ns: int) -> int | None:
        """The first stamp after one [ns]; None where there is none."""
        with self._lock:
            first = [stream.after(stamp_ns) for stream in self.streams.values()]
        return min((ns for ns in first if ns is not None), default=None)

    def seconds(self, stamp_ns: int) -> float:
        """A stamp in seconds from the first of all."""
        return (stamp_ns - (self.origin_ns or 0)) / 1e9

    def close(self, stamp_ns: int, keep_ns: int) -> None:
        """Take stamps up to this one as used; drop what is older by more than `keep_ns`."""
        with self._lock:
            self.closed_ns = stamp_ns
            for stream in self.streams.values():
                stream.forget(stamp_ns - keep_ns)
            for _, stream in self.inputs.values():
                stream.forget(stream.holding(stamp_ns - keep_ns - LATEST_NS))
