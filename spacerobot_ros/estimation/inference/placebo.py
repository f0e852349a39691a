"""Placebo extensions: as many columns of the same size and colour, without any meaning.

A candidate's whitened columns are cut into pieces of a second, or less where these would be few,
which are shuffled, and half of them reversed in time, half in sign: a column that hardly changes,
a bias's, would stay what it is. What such columns explain of data they were not fitted to, any
extension of that size would.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...types import Array, IntArray
from .evidence import Gram, cross_validated, folds

DRAWS = 20  # of which a cause beats all by chance once in 21 times
_PIECE = 1.0  # s
_FEWEST = 30
"""Pieces of a recording: among the orders and signs of fewer, 20 draws find one that is much like
the column itself. Of nine, one did as well as a joint's Coulomb friction of 118 nats."""
SEED = 20  # any serves


def held_out_gain(
    columns: Array, data: Array, sizes: Array, blocks: Sequence[slice], times: Array
) -> float:
    """Largest held-out gain in twice the log likelihood among placebo columns.

    Args:
        columns: (R, K) the candidate's whitened columns.
        data: (R,) whitened innovations of the model without it.
        sizes: (K,) plausible sizes.
        blocks: Rows of each part, which is predicted from the others.
        times: (R,) time of every row, each of its recording [s].
    """
    rng = np.random.default_rng(SEED)
    unbounded = (np.full(len(sizes), -np.inf), np.full(len(sizes), np.inf))
    best = 0.0
    for _ in range(DRAWS):
        order, signs = shuffle(times, rng)
        shuffled = signs[:, None] * columns[order]
        parts = [Gram.of(shuffled[rows], data[rows]) for rows in blocks]
        best = max(best, cross_validated(folds(parts, 0, np.zeros(0)), sizes, unbounded))
    return best


def shuffle(times: Array, rng: np.random.Generator) -> tuple[IntArray, Array]:
    """Rows in another order, with signs: pieces shuffled, half of them turned."""
    length = float(np.sum(np.clip(np.diff(times), 0.0, _PIECE)))  # without what lies between parts
    count = min(len(times), max(_FEWEST, round(length / _PIECE)))
    pieces = np.array_split(np.arange(len(times)), count)
    order = rng.permutation(count)
    turned = rng.random(count) < 0.5
    rows = [pieces[k][::-1] if turned[k] else pieces[k] for k in order]
    signs = np.repeat(rng.choice((-1.0, 1.0), count), [len(piece) for piece in rows])
    return np.concatenate(rows), signs
