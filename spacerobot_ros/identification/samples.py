"""Samples of all sensors as they arrive: checked, in order of their stamps, forgotten in time."""

from __future__ import annotations

import numpy as np

from ..errors import MessageRejectedError
from ..estimation.smoothing import SensorData
from ..estimation.time_base import LONGEST_GAP
from ..estimation.torque_hold import find_holds
from ..types import Array
from .streams import Stream


class SampleBuffer:
    """Samples of joints, gyro and attitude whose stretch is not solved yet, and some before.

    Args:
        n: Number of joints.
        lateness: How late a sample may come within its own stream [s].
        hold_period: Period over which torques are held; zero where not stated [s].

    Attributes:
        origin_ns: First stamp, from which seconds count; None before it.
        solved: Up to where stretches are solved; samples before it come too late [s].
    """

    def __init__(self, n: int, lateness: float, hold_period: float) -> None:
        self._n, self._hold_period = n, hold_period
        late = round(lateness * 1e9)
        self.streams = {
            'joint states': Stream('joint states', late),
            'gyro': Stream('gyro', late),
            'attitude': Stream('attitude', late),
        }
        self.origin_ns: int | None = None
        self.solved = 0.0
        self._newest_ns = 0
        self._first_joints: float | None = None

    @property
    def newest_ns(self) -> int:
        """Newest stamp of all; zero where nothing came [ns]."""
        return self._newest_ns

    @property
    def missing(self) -> tuple[str, ...]:
        """Sensors without any sample."""
        return tuple(name for name, stream in self.streams.items() if not stream.stamps)

    def add_joints(self, stamp_ns: int, q: Array, qd: Array) -> None:
        """Add q (n,) [rad], qd (n,) [rad/s]; raise MessageRejectedError as `add`."""
        if q.shape != (self._n,) or qd.shape != (self._n,):
            raise MessageRejectedError(
                f'joint states: expected {self._n} joints, got {len(q)} positions and '
                f'{len(qd)} rates'
            )
        self.add('joint states', stamp_ns, np.concatenate([q, qd]))

    def add_rate(self, stamp_ns: int, omega_WB_B: Array) -> None:
        """Add omega_WB_B (3,) [rad/s]; raise MessageRejectedError as `add`."""
        _check_length(omega_WB_B, 3, 'gyro')
        self.add('gyro', stamp_ns, np.asarray(omega_WB_B, dtype=float))

    def add_attitude(self, stamp_ns: int, q_WB_xyzw: Array) -> None:
        """Add an attitude (4,); raise as `add`, and for a norm off by more than 1e-3."""
        _check_length(q_WB_xyzw, 4, 'attitude')
        norm = float(np.linalg.norm(q_WB_xyzw))
        if not abs(norm - 1.0) <= 1e-3:
            raise MessageRejectedError(f'attitude: quaternion norm is {norm:.6g}')
        self.add('attitude', stamp_ns, np.asarray(q_WB_xyzw, dtype=float) / norm)

    def add(self, what: str, stamp_ns: int, value: Array) -> None:
        """Add a sample.

        Raises:
            MessageRejectedError: not finite, a stamp seen before, one so late that its stretch is
                solved, or one so far ahead of all others that no motion can be followed there.
        """
        if self.origin_ns is not None:
            if self.solved > 0.0 and (stamp_ns - self.origin_ns) * 1e-9 <= self.solved:
                raise MessageRejectedError(
                    f'{what}: stamp too late, that stretch is already solved'
                )
            ahead = (stamp_ns - self._newest_ns) * 1e-9
            if ahead > LONGEST_GAP:
                raise MessageRejectedError(
                    f'{what}: stamp {ahead:.6g} s ahead of all others, at most {LONGEST_GAP:g} s '
                    'can be bridged; check the clock, or reset'
                )
        self.streams[what].add(stamp_ns, value)
        if self.origin_ns is None:
            self.origin_ns = self._newest_ns = stamp_ns
        self._newest_ns = max(self._newest_ns, stamp_ns)

    def data(self) -> SensorData | None:
        """All samples, in seconds from the first stamp; None while a sensor is missing."""
        if self.origin_ns is None or self.missing:
            return None
        origin, streams = self.origin_ns, self.streams
        time, joints = streams['joint states'].arrays(origin, 2 * self._n)
        q, qd = np.hsplit(joints, 2)
        rates = streams['gyro'].arrays(origin, 3)
        attitudes = streams['attitude'].arrays(origin, 4)
        # Holds count from the run's first joint sample, which may be forgotten by now.
        if self._first_joints is None:
            self._first_joints = float(time[0])
        since_first = np.concatenate([[self._first_joints], time])
        period = self._hold_period
        holds = find_holds(since_first if period > 0.0 else time, None, period)
        return SensorData(time, q, qd, *rates, *attitudes, holds)

    def forget(self, before: float) -> None:
        """Drop the samples before a time [s]."""
        for stream in self.streams.values():
            stream.forget((self.origin_ns or 0) + int(before * 1e9))


def _check_length(values: Array, length: int, what: str) -> None:
    if np.shape(values) != (length,):
        raise MessageRejectedError(f'{what}: expected {length} numbers, got {np.shape(values)}')
