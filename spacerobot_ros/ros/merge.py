"""Samples of several streams in the order of their stamps, whatever order they came in."""

from __future__ import annotations

from typing import Any

from ..errors import MessageRejectedError

Sample = tuple[int, int, Any]
"""Stamp [ns], index of the stream, content."""


class Merger:
    """Releases samples in the order of (stamp, stream), once nothing older can come.

    A sample is released when every stream has gone on to its stamp or further, so the outcome does
    not depend on which message was handled first. A stream that lags by more than `patience`
    behind the furthest is not waited for.

    Args:
        n_streams: Number of streams.
        patience_ns: Longest wait for a stream, in the time of the stamps [ns].
    """

    def __init__(self, n_streams: int, patience_ns: int) -> None:
        self._patience = patience_ns
        self._newest: list[int | None] = [None] * n_streams
        self._pending: dict[tuple[int, int], Any] = {}
        self._released_ns = -1
        self._first_ns = 0

    @property
    def newest(self) -> tuple[int | None, ...]:
        """Newest stamp of each stream [ns]; None where nothing came yet."""
        return tuple(self._newest)

    def add(self, stream: int, stamp_ns: int, content: Any) -> list[Sample]:
        """Take a sample; return what is released by it, in order.

        Raises:
            MessageRejectedError: a second sample with its stamp, or one too late for its place.
        """
        if (stamp_ns, stream) in self._pending or stamp_ns == self._newest[stream]:
            raise MessageRejectedError('duplicate stamp')
        if stamp_ns < self._released_ns:
            raise MessageRejectedError('stamp goes backwards, too late to be put in order')
        if all(newest is None for newest in self._newest):
            self._first_ns = stamp_ns
        self._pending[stamp_ns, stream] = content
        self._newest[stream] = max(stamp_ns, self._newest[stream] or 0)
        return self._release()

    def flush(self) -> list[Sample]:
        """Release all that is pending."""
        return self._take(max((stamp for stamp, _ in self._pending), default=-1))

    def _release(self) -> list[Sample]:
        furthest = max(newest for newest in self._newest if newest is not None)
        limit = furthest
        for newest in self._newest:
            lag = furthest - (self._first_ns if newest is None else newest)
            if lag <= self._patience:
                limit = min(limit, self._first_ns - 1 if newest is None else newest)
        return self._take(limit)

    def _take(self, limit: int) -> list[Sample]:
        keys = sorted(key for key in self._pending if key[0] <= limit)
        if keys:
            self._released_ns = keys[-1][0]
        return [(*key, self._pending.pop(key)) for key in keys]
