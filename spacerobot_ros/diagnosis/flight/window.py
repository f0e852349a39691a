"""The newest samples of every sensor, as far back as the monitor still needs them."""

from __future__ import annotations

from bisect import bisect_left

import numpy as np

from ...errors import MessageRejectedError
from ...recording.record import AttitudeSeries, JointSeries, RateSeries, Record
from ...types import Array, IntArray

_UNIT_TOLERANCE = 1e-3


class Stream:
    """Samples of one sensor in the order of their stamps.

    Args:
        width: Numbers a sample.
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self.stamps: list[int] = []
        self._values: list[Array] = []

    @property
    def newest(self) -> int | None:
        """Its newest stamp [ns]; None where nothing came yet."""
        return self.stamps[-1] if self.stamps else None

    def add(self, stamp_ns: int, values: Array, closed_ns: int | None) -> None:
        """Put a sample in its place.

        Args:
            stamp_ns: Its stamp [ns].
            values: (width,).
            closed_ns: Stamps up to this one are judged already [ns]; None: none is.

        Raises:
            MessageRejectedError: wrong shape, not finite, a second sample with its stamp, or one
                that is too late.
        """
        values = np.asarray(values, dtype=float)
        if values.shape != (self._width,):
            raise MessageRejectedError(f'has shape {values.shape}, expected ({self._width},)')
        if not np.isfinite(values).all():
            raise MessageRejectedError('is not finite')
        if closed_ns is not None and stamp_ns <= closed_ns:
            raise MessageRejectedError('stamp goes backwards, too late to be used')
        place = bisect_left(self.stamps, stamp_ns)
        if place < len(self.stamps) and self.stamps[place] == stamp_ns:
            raise MessageRejectedError('duplicate stamp')
        self.stamps.insert(place, stamp_ns)
        self._values.insert(place, values)

    def between(self, start_ns: int, end_ns: int) -> tuple[IntArray, Array]:
        """Stamps (N,) [ns] and values (N, width) from start to end, both included."""
        part = slice(bisect_left(self.stamps, start_ns), bisect_left(self.stamps, end_ns + 1))
        values = np.array(self._values[part]).reshape(-1, self._width)
        return np.array(self.stamps[part], dtype=np.int64), values

    def forget(self, before_ns: int) -> None:
        """Drop what is older."""
        place = bisect_left(self.stamps, before_ns)
        del self.stamps[:place], self._values[:place]


class Window:
    """Samples of all sensors of one robot.

    Args:
        names: Of the n joints.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self._names = names
        self._n = n = len(names)
        self.joints = Stream(3 * n + 1)
        self.rates = Stream(3)
        self.attitudes = Stream(4)
        self.origin_ns: int | None = None
        self.closed_ns: int | None = None

    @property
    def newest_ns(self) -> int | None:
        """Newest stamp of any sensor [ns]."""
        stamps = [s.newest for s in (self.joints, self.rates, self.attitudes)]
        return max((stamp for stamp in stamps if stamp is not None), default=None)

    def add_joints(self, stamp_ns: int, q: Array, qd: Array, effort: Array | None) -> None:
        """Take a joint sample; see `Stream.add`."""
        torque = np.zeros(self._n) if effort is None else effort
        for what, values in (('position', q), ('velocity', qd), ('effort', torque)):
            if np.shape(values) != (self._n,):
                raise MessageRejectedError(
                    f'{what} has {np.size(values)} entries for {self._n} joints'
                )
            if not np.isfinite(values).all():
                raise MessageRejectedError(f'{what} is not finite')
        row = np.concatenate([q, qd, torque, [effort is not None]])
        self._add(self.joints, stamp_ns, row)

    def add_rate(self, stamp_ns: int, omega: Array) -> None:
        """Take a gyro sample; see `Stream.add`."""
        self._add(self.rates, stamp_ns, omega)

    def add_attitude(self, stamp_ns: int, q_xyzw: Array) -> None:
        """Take a star tracker sample, q_WB xyzw; see `Stream.add`."""
        norm = float(np.linalg.norm(q_xyzw))
        if abs(norm - 1.0) > _UNIT_TOLERANCE:
            raise MessageRejectedError(f'quaternion has norm {norm:.6g}, not 1')
        self._add(self.attitudes, stamp_ns, np.asarray(q_xyzw) / norm)

    def observations(self, start_ns: int, end_ns: int) -> Record:
        """What was seen from start to end, times in seconds since the first sample of all."""
        n = self._n
        joint_ns, joints = self.joints.between(start_ns, end_ns)
        rate_ns, omega = self.rates.between(start_ns, end_ns)
        attitude_ns, q_xyzw = self.attitudes.between(start_ns, end_ns)
        effort = joints[:, 2 * n : 3 * n] if joints[:, -1].all() else None
        return Record(
            joints=JointSeries(self._names, joint_ns, joints[:, :n], joints[:, n : 2 * n], effort)
            if len(joint_ns)
            else None,
            rates=RateSeries(rate_ns, omega) if len(rate_ns) else None,
            attitudes=AttitudeSeries(attitude_ns, q_xyzw) if len(attitude_ns) else None,
            zero_ns=self.origin_ns or 0,
        )

    def seconds(self, stamps_ns: Array) -> Array:
        """Stamps in seconds since the first sample of all."""
        return np.asarray((stamps_ns - (self.origin_ns or 0)) / 1e9)

    def close(self, stamp_ns: int, keep_ns: int) -> None:
        """Stamps up to this one are judged; drop what is older by more than `keep_ns`."""
        self.closed_ns = stamp_ns
        for stream in (self.joints, self.rates, self.attitudes):
            stream.forget(stamp_ns - keep_ns)

    def _add(self, stream: Stream, stamp_ns: int, values: Array) -> None:
        stream.add(stamp_ns, values, self.closed_ns)
        if self.closed_ns is None:
            self.origin_ns = min(stamp_ns, stamp_ns if self.origin_ns is None else self.origin_ns)
