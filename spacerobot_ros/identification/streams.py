"""Samples of one sensor as they arrive, put in order of their stamps."""

from __future__ import annotations

from bisect import bisect_left

import numpy as np

from ..errors import MessageRejectedError
from ..types import Array


class Stream:
    """Samples of one sensor in order of their stamps, in whatever order they came.

    Args:
        what: The sensor's name, for messages.
        lateness_ns: How far a stamp may lie before the newest one [ns].
    """

    def __init__(self, what: str, lateness_ns: int) -> None:
        self._what, self._lateness_ns = what, lateness_ns
        self.stamps: list[int] = []
        self._values: list[Array] = []

    def add(self, stamp_ns: int, value: Array) -> None:
        """Add a sample.

        Raises:
            MessageRejectedError: not finite, too late, or a second one with its stamp.
        """
        if not np.all(np.isfinite(value)):
            raise MessageRejectedError(f'{self._what}: not finite')
        place = len(self.stamps)
        if self.stamps and stamp_ns <= self.stamps[-1]:
            if stamp_ns < self.stamps[-1] - self._lateness_ns:
                back = (self.stamps[-1] - stamp_ns) * 1e-9
                raise MessageRejectedError(f'{self._what}: stamp backwards by {back:.6g} s')
            place = bisect_left(self.stamps, stamp_ns)
            if self.stamps[place] == stamp_ns:
                raise MessageRejectedError(f'{self._what}: stamp duplicated')
        self.stamps.insert(place, stamp_ns)
        self._values.insert(place, value)

    def forget(self, before_ns: int) -> None:
        """Drop the samples before a stamp."""
        count = bisect_left(self.stamps, before_ns)
        del self.stamps[:count], self._values[:count]

    def arrays(self, origin_ns: int, width: int) -> tuple[Array, Array]:
        """Times (N,) from an origin [s] and values (N, width)."""
        time = np.asarray((np.array(self.stamps, dtype=np.int64) - origin_ns) * 1e-9, dtype=float)
        return time, np.array(self._values).reshape(len(time), width)
