"""Placebo extensions: as many columns of the same size and color, without any meaning.

A candidate's whitened columns are cut into pieces of a second, which are shuffled and reversed in
time. What such columns explain of data they were not fitted to, any extension of that size would.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..types import Array, IntArray
from .evidence import Gram, cross_validated, folds

DRAWS = 20
_PIECE = 1.0  # s
_SEED = 20


def held_out_gain(
    columns: Array, data: Array, sizes: Array, blocks: Sequence[slice], times: Array
) -> float:
    """Largest held-out gain in twice the log likelihood among placebo columns.

    Args:
        columns: (R, K) the candidate's whitened columns.
        data: (R,) whitened innovations of the model without it.
        sizes: (K,) plausible sizes.
        blocks: Rows of each part, which is predicted from the others.
        times: (R,) time of every row [s].
    """
    rng = np.random.default_rng(_SEED)
    unbounded = (np.full(len(sizes), -np.inf), np.full(len(sizes), np.inf))
    best = 0.0
    for _ in range(DRAWS):
        shuffled = columns[_shuffle(times, rng)]
        parts = [Gram.of(shuffled[rows], data[rows]) for rows in blocks]
        best = max(best, cross_validated(folds(parts, 0, np.zeros(0)), sizes, unbounded))
    return best


def _shuffle(times: Array, rng: np.random.Generator) -> IntArray:
    """Rows in another order: pieces of a second shuffled, half of them reversed."""
    count = max(2, round(float(times[-1] - times[0]) / _PIECE))
    pieces = np.array_split(np.arange(len(times)), count)
    order = rng.permutation(count)
    turned = rng.random(count) < 0.5
    return np.concatenate([pieces[k][::-1] if turned[k] else pieces[k] for k in order])
