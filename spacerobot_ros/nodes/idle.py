"""Time that a node waits: what its own callbacks take does not count."""

from __future__ import annotations

import time
from collections.abc import Callable


class IdleTime:
    """Wall time without an event, as a timer of the node sees it.

    An executor that was busy, or a machine that stood still, brings the timer late while what it
    waits for lies in the queue: of each period of the timer at most that period counts.

    Args:
        period: Of the timer [s].
        now: Gives wall time [ns].
    """

    def __init__(self, period: float, now: Callable[[], int] = time.monotonic_ns) -> None:
        self._period_ns, self._now = round(period * 1e9), now
        self.clear()

    def clear(self) -> None:
        """Count from now on."""
        self._last, self.ns = self._now(), 0

    def tick(self) -> None:
        """Count the time since the last tick; the timer calls this."""
        now = self._now()
        self.ns += min(now - self._last, self._period_ns)
        self._last = now
