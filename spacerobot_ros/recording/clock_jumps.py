"""Stamps that jump: one that is wrong is refused, a clock that jumped is followed.

A stamp far from those before is held back. It is believed once /clock agrees with it, or
once stamps that follow agree with it and with each other; a stamp of the old time refutes it.
Where /clock goes back by less, the first sample that does begins another run.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from ..errors import MessageRejectedError
from .buffer import PATIENCE_NS
from .record import shown

_RECENT = 5  # stamps of a sensor by which the next is judged
_CONFIRMED = 4  # samples that agree; of independent wrong stamps no two agree within a second
_LONGEST_LAG_NS = 10_000_000_000  # of a sensor that was not heard before; the largest `lateness`


class Sample(NamedTuple):
    """A sample of a sensor: stamp [ns] and content."""

    sensor: str
    stamp_ns: int
    content: tuple[Any, ...]


class Judgement(NamedTuple):
    """What becomes of samples.

    Attributes:
        taken: Those to be used, in the order in which they came.
        refused: Those not to be used.
        jump_ns: By how much the clock jumped before those that are taken [ns]; None: it did not.
    """

    taken: tuple[Sample, ...] = ()
    refused: tuple[Sample, ...] = ()
    jump_ns: int | None = None


class JumpDetector:
    """Follows the stamps of several sensors that share a clock.

    Args:
        largest_ns: Stamps that jump by more are suspicious [ns].
    """

    def __init__(self, largest_ns: int) -> None:
        self._largest_ns = largest_ns
        self._newest: dict[str, int] = {}
        self._recent: dict[str, deque[int]] = {}
        self._usual: dict[str, int] = {}  # their medians
        self._held: list[Sample] = []
        self._is_back = False

    def clear(self) -> tuple[Sample, ...]:
        """Begin anew, without any stamp; what was held back."""
        held, self._newest, self._recent, self._held = tuple(self._held), {}, {}, []
        self._usual = {}
        self._is_back = False
        return held

    def hear_clock(self, delta_ns: int) -> None:
        """Hear that /clock moved [ns]: back, however little, a sample may show another run."""
        self._is_back |= delta_ns < 0

    @property
    def is_doubtful(self) -> bool:
        """Whether samples are held back."""
        return bool(self._held)

    @property
    def newest_ns(self) -> int | None:
        """Newest stamp that was believed [ns]; None before the first."""
        return max(self._newest.values(), default=None)

    def judge(self, sample: Sample, clock: Callable[[], int | None] = lambda: None) -> Judgement:
        """Take a sample.

        Args:
            sample: The sample.
            clock: Gives the time of /clock [ns]; None where there is none.
        """
        refused: tuple[Sample, ...] = ()
        if self._follows(sample):
            refused, self._held = tuple(self._held), []
            jump_ns = self._gone_back(sample, clock) if self._is_back else None
            if jump_ns is not None:
                self.clear()
            self._believe(sample)
            return Judgement((sample,), refused, jump_ns)
        if any(h.sensor == sample.sensor and h.stamp_ns >= sample.stamp_ns for h in self._held):
            return Judgement(refused=(sample,))  # stuck stamps agree with nothing
        if self._held and abs(sample.stamp_ns - self._held[-1].stamp_ns) > PATIENCE_NS:
            refused, self._held = tuple(self._held), []
        self._held.append(sample)
        return self.judge_held(clock)._replace(refused=refused)

    def judge_held(self, clock: Callable[[], int | None]) -> Judgement:
        """Look again at what is held back, at another time of /clock [ns]; None: there is none."""
        newest, held = self.newest_ns, self._held
        if not held or newest is None:
            return Judgement()
        now_ns, last, largest = clock(), held[-1].stamp_ns, self._largest_ns
        is_now = now_ns is not None and abs(last - now_ns) <= largest < abs(newest - now_ns)
        if not is_now and len(held) < _CONFIRMED:
            return Judgement()
        jump_ns = held[0].stamp_ns - newest
        self.clear()
        for sample in held:
            self._believe(sample)
        return Judgement(tuple(held), jump_ns=jump_ns)

    def _gone_back(self, sample: Sample, clock: Callable[[], int | None]) -> int | None:
        """How far a sample goes back with /clock [ns]; None where it, or that, does not."""
        now_ns, newest_ns = clock(), self._newest.get(sample.sensor, sample.stamp_ns)
        self._is_back = now_ns is not None and now_ns < (self.newest_ns or 0)
        jump_ns = sample.stamp_ns - newest_ns
        return jump_ns if self._is_back and jump_ns < 0 else None

    def _follows(self, sample: Sample) -> bool:
        """Whether a stamp is as one expects.

        By the medians of the newest few, so that single stamps somewhat ahead, each believed,
        don't lead away from all others.
        """
        if not self._usual:
            return True
        newest, own = max(self._usual.values()), self._usual.get(sample.sensor)
        if own is None:
            return newest - _LONGEST_LAG_NS <= sample.stamp_ns <= newest + self._largest_ns
        stamps = self._recent[sample.sensor]
        # the median is behind the newest by half of the few
        behind = (len(stamps) - 1) // 2 * (max(stamps) - min(stamps)) // max(1, len(stamps) - 1)
        ahead = self._largest_ns + min(behind, _LONGEST_LAG_NS)
        return own - self._largest_ns <= sample.stamp_ns <= newest + ahead

    def _believe(self, sample: Sample) -> None:
        newest = self._newest.get(sample.sensor, sample.stamp_ns)
        self._newest[sample.sensor] = max(newest, sample.stamp_ns)
        recent = self._recent.setdefault(sample.sensor, deque(maxlen=_RECENT))
        recent.append(sample.stamp_ns)
        self._usual[sample.sensor] = sorted(recent)[len(recent) // 2]


def refusal(sample: Sample, newest_ns: int | None) -> MessageRejectedError:
    """Why a sample was refused."""
    jump = shown((sample.stamp_ns - (newest_ns or 0)) * 1e-9)
    return MessageRejectedError(f'stamp jumps by {jump}, and none agrees with it; check the clock')
