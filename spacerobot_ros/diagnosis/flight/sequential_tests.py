r"""Sequential tests of a model: cumulative sums of log likelihood ratios, one threshold for all.

    S_k = max(0, S_{k-1} + ln p1(x_k) / p0(x_k)),  alarm where S_k >= ln(M T / t)

With M tests, one every t, the mean time between false alarms is at least T (Page 1954; Lorden
1971), whatever the alternatives p1 are. Under p0 the whitened innovations are independent standard
normal numbers, and so is z = c'r / |c|, their part along a probe's column c, block after block.
Alternatives: z has mean +1, or -1 (a small error that stays); z has standard deviation 3 (one that
comes, goes or changes its sign), for errors since long and for those that begin with the block;
the noise of a channel is half as large again. Beside them a channel's window is searched for lines
and slow errors (`window_whiteness`), whose p-value counts as exp(-S).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...estimation.trajectory.time_base import CHANNELS
from ...types import Array
from .block_innovations import Block
from .probes import Probe

_SHIFT, _WIDE, _LOUD = 1.0, 3.0, 1.5  # alternatives, see above; whichever, no false alarm more
_LARGEST = 25.0  # of a squared innovation in the test of a channel's noise: one glitch is no alarm
_SEEN = 1e-6  # (sigma per SI unit)^2 below which a probe's error is not seen at all
_CLEARED = 0.5  # of the threshold, below which an alarm may end
_UNEXPLAINED = 6.0  # nats of one test in one block; about four standard deviations
_KEPT = 0.6  # of the threshold, to which sums fall back once the alarm is raised
_TESTS = 5  # a probe; and, of a sensor, one for structure
_JUMP, _STRUCTURE = 3, 4  # their numbers


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """Every probe after a block.

    Args:
        evidence: (K,) its strongest test [nats].
        alarmed: (K,) bool.
        value: (K,) what is unexplained, by the last block [unit of the probe]. std: (K,) of it.
        rms: (K,) of the channel over its noise floor in the last block; nan where it said nothing.
        loud: (K,) bool, whether the channel's noise is what speaks.
        sharpest: (K,) largest whitened innovation of the channel's own sensor in the last block.
        is_explained: Whether the last block alone speaks for the model.
    """

    evidence: Array
    alarmed: np.ndarray
    value: Array
    std: Array
    rms: Array
    loud: np.ndarray
    sharpest: Array
    is_explained: bool

    @property
    def speaks_first(self) -> int:
        """Of the alarmed probes the one with most evidence.

        A jump that a block's last samples alone show resembles many things; then the sensor on
        which it first shows has more evidence than any of them.
        """
        claim = np.where(self.alarmed, self.evidence, -1.0)
        return int(np.argmax(np.maximum(claim, _wide(self.sharpest**2))))


class SequentialTests:
    """The tests of all probes.

    Args:
        probes: The probes.
        interval: Mean time between false alarms [s].
        period: Length of a block [s].
        clear_after: An alarm ends when its tests have been quiet for as long [s].
    """

    def __init__(
        self, probes: Sequence[Probe], interval: float, period: float, clear_after: float
    ) -> None:
        self._probes = tuple(probes)
        count = len(self._probes)
        self.threshold = math.log(self.count * interval / period)
        self._patience = math.ceil(clear_after / period)
        self._sums = np.zeros((_TESTS, count))
        self._risen = np.zeros((_TESTS, count), dtype=int)
        self._quiet = np.zeros(count, dtype=int)
        self.alarmed = np.zeros(count, dtype=bool)

    @property
    def count(self) -> int:
        """Number of tests at work."""
        sensors = sum(probe.driven is None for probe in self._probes)
        return (_TESTS - 1) * len(self._probes) + 2 * sensors

    def since(self, probe: int) -> int:
        """Blocks since the strongest test of a probe began to rise."""
        return int(self._risen[np.argmax(self._sums[:, probe]), probe])

    def add(self, block: Block, structure: Array) -> Verdict:
        """Judge one more block.

        Args:
            block: The block.
            structure: (K,) minus the log of the probability of so much structure in the channel;
                zero for none.
        """
        lasting, value, std = _along(block.lasting, block.data)
        sudden, jump, jump_std = _along(block.sudden, block.data)
        ratios, rms, sharpest = self._noise(block)
        increments = np.stack(
            [
                _SHIFT * lasting - 0.5 * _SHIFT**2,
                -_SHIFT * lasting - 0.5 * _SHIFT**2,
                _wide(lasting**2),
                _wide(sudden**2),
                ratios,
            ]
        )
        increments[:3, ~np.isfinite(std)] = 0.0
        increments[3, ~np.isfinite(jump_std)] = 0.0
        sums = np.maximum(self._sums + increments, 0.0)
        self._risen = np.where(sums > 0.0, self._risen + 1, 0)
        evidence = np.maximum(sums.max(axis=0), structure)
        self._decide(evidence)
        self._sums = np.minimum(sums, np.where(self.alarmed, _KEPT, 1.0) * self.threshold)
        strongest = np.argmax(sums, axis=0)
        began = strongest == _JUMP
        return Verdict(
            evidence,
            self.alarmed.copy(),
            np.where(began, jump, value),
            np.where(began, jump_std, std),
            rms,
            strongest == _STRUCTURE,
            sharpest,
            bool(np.max(increments) < _UNEXPLAINED),
        )

    def _decide(self, evidence: Array) -> None:
        self.alarmed |= evidence >= self.threshold
        self._quiet = np.where(evidence < _CLEARED * self.threshold, self._quiet + 1, 0)
        self.alarmed &= self._quiet <= self._patience

    def _noise(self, block: Block) -> tuple[Array, Array, Array]:
        """Log likelihood ratio of more noise, rms and largest value of every probe's channel."""
        ratios, sharpest = np.zeros((2, len(self._probes)))
        rms = np.full(len(self._probes), np.nan)
        for k, probe in enumerate(self._probes):
            if probe.driven is not None:
                continue
            at = (block.channel == CHANNELS.index(probe.channel)) & (block.axis == probe.axis)
            squares = block.data[at] ** 2
            if len(squares):
                rms[k], sharpest[k] = np.sqrt(np.mean(squares)), np.sqrt(np.max(squares))
                energy = float(np.sum(np.minimum(squares, _LARGEST)))
                gain = 0.5 * (1.0 - 1.0 / _LOUD**2) * energy
                ratios[k] = gain - len(squares) * math.log(_LOUD)
        return ratios, rms, sharpest


def _along(columns: Array, data: Array) -> tuple[Array, Array, Array]:
    """Part of the data along each column: in standard deviations, in its unit, and its std."""
    information = np.einsum('rk,rk->k', columns, columns)
    seen = information > _SEEN
    safe = np.where(seen, information, 1.0)
    part = np.where(seen, columns.T @ data, 0.0)
    std = np.where(seen, 1.0 / np.sqrt(safe), np.inf)
    return part / np.sqrt(safe), part / safe, std


def _wide(squares: Array) -> Array:
    return np.asarray(0.5 * (1.0 - 1.0 / _WIDE**2) * squares - math.log(_WIDE))
