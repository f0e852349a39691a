"""Wall time of a simulation: its pace, and for how long a node waited."""

from __future__ import annotations

import time
from collections.abc import Callable


class Pace:
    """Steps that are due at a pace, and how far the simulation keeps up.

    Args:
        period_ns: Simulated time of a step [ns].
        factor: Simulated time per wall time.
        catch_up: Largest number of steps to do at once; beyond, the simulation falls behind.
    """

    def __init__(self, period_ns: int, factor: float, catch_up: int) -> None:
        self._period_ns, self._factor, self._catch_up = period_ns, factor, catch_up
        self._slips = 0
        self.anchor(0)

    def now(self) -> int:
        """Wall time [ns]."""
        return time.monotonic_ns()

    def anchor(self, step: int) -> None:
        """Count from now and from this step on."""
        self._since, self._step = self.now(), step

    def due(self, step: int) -> int:
        """Number of steps to do now; after too long a delay what is missed is let go."""
        behind = self._step - step
        behind += int((self.now() - self._since) * self._factor / self._period_ns)
        if behind > self._catch_up:
            self._slips += 1
            self.anchor(step + self._catch_up)
        return min(behind, self._catch_up)

    def reached(self, step: int) -> float:
        """Simulated time per wall time since the anchor."""
        return (step - self._step) * self._period_ns / max(self.now() - self._since, 1)

    def take_slips(self) -> int:
        """How often it fell behind since this was last asked."""
        slips, self._slips = self._slips, 0
        return slips


class IdleTime:
    """Wall time without an event, as a timer of the node sees it.

    An executor that was busy, or a machine that stood still, brings the timer late while what it
    waits for lies in the queue: of each period of the timer at most that period counts.

    Args:
        period: Of the timer [s].
        now: Gives wall time [ns].
    """

    def __init__(self, period: float, now: Callable[[], int]) -> None:
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
