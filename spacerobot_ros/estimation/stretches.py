"""A record too long for memory, cut into stretches: rows are summed over them, one at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..recording.faults.thresholds import FEWEST_SAMPLES
from ..recording.record import Record
from .rows import ChannelError

PER_SAMPLE = 2500.0
"""Bytes that a diagnosis needs a sample and joint squared: every joint adds rows and columns, each
held a few times. `python -m validation bench.scaling` measures 2300 to 2950, 3200 at most."""
MOST_MEMORY = 4e9  # bytes; a record that needs more is summed over stretches
STRETCH_MEMORY = 5e8
"""Of each, whose search needs twice that: of two hours of seven joints the record, its sums and
what is loaded are 0.8 GB."""
_LEAST = 20.0  # s: no stretch is shorter, whose start and end would be most of it
_SAMPLED = 5  # stretches that together need no more than `MOST_MEMORY`
SHOWN = 20_000  # samples of a channel that plots keep
_FAR = 0.5  # of the farthest that a joint goes in any stretch


@dataclass(frozen=True, slots=True)
class LongRecord:
    """Stretches of one record, by time.

    Args:
        every: All of them.
        sample: Numbers of some: of each fifth of the record the one in which joints go farthest,
            and that of a joint which moves in none of these. Of them is made what must be known
            before rows are summed: levels of noise, a first set of causes.
    """

    every: tuple[Record, ...]
    sample: tuple[int, ...]

    @classmethod
    def of(cls, record: Record) -> LongRecord | None:
        """Of a record; None where it fits into memory."""
        if record.joints is None:
            return None
        need = PER_SAMPLE * len(record.joint_time) * record.q.shape[1] ** 2
        start, end = record.span
        count = min(math.ceil(need / STRETCH_MEMORY), math.floor((end - start) / _LEAST))
        if need <= MOST_MEMORY or count < 2:
            return None
        edges = np.linspace(start, end, count + 1)
        edges[0] = -np.inf  # the first sample, and others a little before it
        cut = (record.between(a, b) for a, b in pairwise(edges.tolist()))
        every = [own for own in cut if len(own.joint_time) >= FEWEST_SAMPLES]
        ways = np.array([np.ptp(own.q, axis=0) for own in every])
        ways /= np.maximum(np.max(ways, axis=0), np.finfo(float).tiny)
        fifths = np.array_split(np.arange(len(every)), _SAMPLED)
        sample = {int(own[np.argmax(np.sum(ways[own], axis=1))]) for own in fifths if len(own)}
        still = np.flatnonzero(np.max(ways[sorted(sample)], axis=0) < _FAR)
        sample |= {int(np.argmax(ways[:, j])) for j in still}
        return cls(tuple(every), tuple(sorted(sample)))

    @property
    def note(self) -> str:
        """What a user should know."""
        length = float(np.ptp(self.every[0].span))
        count = len(self.every)
        return f'too long for memory at once: {count} stretches of {length:.0f} s were summed'


def thinned(channel: ChannelError, most: int) -> ChannelError:
    """A channel with some of its samples."""
    step = max(1, len(channel.time) // max(1, most))
    time, measured, error = (x[::step] for x in (channel.time, channel.measured, channel.error))
    return replace(channel, time=time, measured=measured, error=error)


def joined(same: Sequence[ChannelError]) -> ChannelError:
    """One channel along several stretches."""
    return replace(
        same[0],
        time=np.concatenate([own.time for own in same]),
        measured=np.concatenate([own.measured for own in same]),
        error=np.concatenate([own.error for own in same]),
    )
