"""Rows of recordings in blocks: what is held out, and what errs for itself.

Blocks of a recording have as many rows in which anything moves: others say nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from ...inference.decisive import CLUSTERS
from ...types import IntArray
from .balance import Balance

_BLOCKS, _FEW = 4, 2  # of a recording, and of one too short for so many
_LEAST_BLOCK = 4.0  # s of motion
_MOMENT = 4.0  # periods of the band
CLUSTERS_AT_MOST = 100  # of all recordings: more say the same


def blocks_of(balances: Sequence[Balance]) -> list[IntArray]:
    """(M,) number of the block of each row, recording by recording: four of each, or two."""
    enough = _BLOCKS * _LEAST_BLOCK
    return _cut(balances, [_BLOCKS if _length(b) >= enough else _FEW for b in balances])


def clusters_of(balances: Sequence[Balance], at_most: int) -> list[IntArray]:
    """The same for what errs for itself: four periods of the band, or shorter where these are few.

    What is missed of a start or a turn fills two or three: the variance between blocks of a false
    change of a KUKA is 49, 209, 211 and 225 times that of rows at 0.5, 1, 2 and 4 s.
    """
    whole = sum(map(_length, balances))
    counts = [
        max(_length(b) * b.arm.band / _MOMENT, _length(b) * CLUSTERS / whole) for b in balances
    ]
    most = max(sum(counts) / at_most, 1.0)
    return _cut(balances, [max(1, math.ceil(count / most)) for count in counts])


def _cut(balances: Iterable[Balance], counts: Iterable[int]) -> list[IntArray]:
    out, first = [], 0
    for balance, count in zip(balances, counts, strict=True):
        moved = _moved(balance)
        out.append(first + count * np.maximum(moved - 1, 0) // max(moved[-1], 1))
        first = int(out[-1][-1]) + 1
    return out


def _moved(balance: Balance) -> IntArray:
    """(M,) rows so far in which anything moves."""
    return np.cumsum(np.any(balance.arm.is_moving[:: balance.arm.stride], axis=1))


def _length(balance: Balance) -> float:
    """Time in which anything moves [s]."""
    return float(_moved(balance)[-1] * balance.arm.stride * balance.arm.step)
