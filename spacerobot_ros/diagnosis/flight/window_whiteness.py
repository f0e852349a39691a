"""Structure in the newest whitened innovations of each channel, by the diagnosis' own fit test."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...estimation.inference.whiteness import channel_fit
from ...estimation.rows import ChannelFit
from ...estimation.trajectory.time_base import CHANNELS
from ...types import Array
from .block_innovations import Block
from .probes import Probe

_FEWEST = 100  # samples of a window in which structure is looked for
_SMALLEST = 1e-300  # p-value whose logarithm is finite


@dataclass(frozen=True, slots=True, eq=False)
class Structure:
    """What stands out of every probe's channel.

    Args:
        fits: One a probe; None for torques, and where there are too few samples.
        evidence: (K,) minus the log of each p-value; zero without a fit.
    """

    fits: tuple[ChannelFit | None, ...]
    evidence: Array


class Whiteness:
    """The newest innovations of every sensor's axis.

    Args:
        probes: The probes.
        window: Length of what is kept [s].
        short: Length of it while an alarm lasts, so that its end is soon seen [s].
    """

    def __init__(self, probes: Sequence[Probe], window: float, short: float) -> None:
        self._probes = tuple(probes)
        self._window, self._short = window, short
        self._blocks: deque[Block] = deque()

    def add(self, block: Block, is_alarmed: bool) -> Structure:
        """Take a block and test the window that ends with it.

        Args:
            block: The newest block.
            is_alarmed: Whether an alarm lasts.
        """
        self._blocks.append(block)
        length = self._short if is_alarmed else self._window
        while block.time[-1] - self._blocks[0].time[0] > length:
            self._blocks.popleft()
        channel, axis, time, data = (
            np.concatenate([getattr(b, name) for b in self._blocks])
            for name in ('channel', 'axis', 'time', 'data')
        )
        fits = []
        for probe in self._probes:
            fit = None
            if probe.driven is None:
                at = (channel == CHANNELS.index(probe.channel)) & (axis == probe.axis)
                if np.count_nonzero(at) >= _FEWEST:
                    fit = channel_fit(probe.channel, probe.axis, data[at], time[at])
            fits.append(fit)
        evidence = [0.0 if f is None else -math.log(max(f.p_value, _SMALLEST)) for f in fits]
        return Structure(tuple(fits), np.array(evidence))
