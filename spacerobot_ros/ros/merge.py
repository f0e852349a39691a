"""Samples of several streams in the order of their stamps, whatever order they came in."""

from __future__ import annotations

import heapq
from typing import Any

from ..errors import MessageRejectedError

Sample = tuple[int, int, Any]
"""Stamp [ns], index of the stream, content."""


class Merger:
    """Releases samples in the order of (stamp, stream), once nothing older can come.

    A sample is released when every stream has gone on to its stamp or further, so the outcome does
    not depend on which message was handled first. A stream is not waited for when it lags by more
    than the patience and has also been silent for as long on the clock on the wall: one that is
    merely worked off slower than the others is not dead.

    Args:
        n_streams: Number of streams.
        patience_ns: Longest wait for a stream [ns].
        slack_ns: How late a sample may come within its own stream [ns].
    """

    def __init__(self, n_streams: int, patience_ns: int, slack_ns: int = 0) -> None:
        self._patience, self._slack = patience_ns, slack_ns
        self._newest: list[int | None] = [None] * n_streams
        self._heard_ns: list[int | None] = [None] * n_streams
        self._queue: list[tuple[int, int]] = []
        self._content: dict[tuple[int, int], Any] = {}
        self._released_ns: int | None = None
        self._first_ns = 0

    @property
    def newest(self) -> tuple[int | None, ...]:
        """Newest stamp of each stream [ns]; None where nothing came yet."""
        return tuple(self._newest)

    def is_past(self, stamp_ns: int) -> bool:
        """Whether a sample with this stamp would come too late for its place."""
        return self._released_ns is not None and stamp_ns < self._released_ns

    def add(self, stream: int, stamp_ns: int, content: Any, now_ns: int) -> list[Sample]:
        """Take a sample; return what is released by it, in order.

        Args:
            stream: Index of its stream.
            stamp_ns: Its stamp [ns].
            content: What it holds.
            now_ns: Time of a clock that never jumps [ns].

        Raises:
            MessageRejectedError: a second sample with its stamp, or one too late for its place.
        """
        newest = self._newest[stream]
        if (stamp_ns, stream) in self._content or stamp_ns == newest:
            raise MessageRejectedError('duplicate stamp')
        if self.is_past(stamp_ns):
            raise MessageRejectedError('stamp goes backwards, too late to be put in order')
        if all(stamp is None for stamp in self._newest):
            self._first_ns = stamp_ns
            self._heard_ns = [now_ns] * len(self._newest)
        heapq.heappush(self._queue, (stamp_ns, stream))
        self._content[stamp_ns, stream] = content
        self._newest[stream] = stamp_ns if newest is None else max(stamp_ns, newest)
        self._heard_ns[stream] = now_ns
        return self._take(self._limit(now_ns) - self._slack)

    def flush(self) -> list[Sample]:
        """Release all that is pending."""
        return self._take(max(self._queue)[0]) if self._queue else []

    def _limit(self, now_ns: int) -> int:
        furthest = max(newest for newest in self._newest if newest is not None)
        limit = furthest
        for newest, heard in zip(self._newest, self._heard_ns, strict=True):
            reached = self._first_ns - 1 if newest is None else newest
            is_silent = heard is not None and now_ns - heard > self._patience
            if not (is_silent and furthest - reached > self._patience):
                limit = min(limit, reached)
        return limit

    def _take(self, limit: int) -> list[Sample]:
        released = []
        while self._queue and self._queue[0][0] <= limit:
            key = heapq.heappop(self._queue)
            self._released_ns = key[0]
            released.append((*key, self._content.pop(key)))
        return released
