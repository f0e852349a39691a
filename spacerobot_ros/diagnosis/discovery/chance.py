"""Whether a law could win by chance: the whole search repeated on data without meaning.

Data without meaning are what the law itself leaves, with random signs: of its whitened cosine
terms, which keeps the spectrum, lines included; and of blocks in time, which keeps noise that
grows where the motion is fast. The more careful of the two counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...estimation.inference.spectral_terms import cosines, rows_of
from ...types import Array

FLIPS = 200
_BLOCKS = 40
_SEED = 13
_EULER = 0.5772156649015329

Statistic = Callable[[Array], Array]
"""(F,) largest score over all laws of (M, F) whitened residuals."""


def chance_of(
    score: float,
    largest: Statistic,
    left: Array,
    count: int,
) -> float:
    """Probability that the best of all laws scores so high by chance.

    Args:
        score: Of the law.
        largest: The search.
        left: (M,) whitened residual with the law.
        count: Of rows in time.
    """
    rng = np.random.default_rng(_SEED)
    signs = rng.choice([-1.0, 1.0], (len(left), FLIPS))
    rows = rows_of(left, count)
    block = (np.arange(len(rows)) * _BLOCKS) // len(rows)
    turned = rows[:, None] * rng.choice([-1.0, 1.0], (_BLOCKS, FLIPS))[block]
    return max(
        _gumbel(score, largest(draws)) for draws in (signs * left[:, None], cosines(turned))
    )


def _gumbel(score: float, draws: Array) -> float:
    """Tail of the largest of many, from their moments."""
    spread = math.sqrt(6.0) / math.pi * float(np.std(draws, ddof=1))
    place = float(np.mean(draws)) - _EULER * spread
    return -math.expm1(-math.exp(min(-(score - place) / max(spread, 1e-9), 700.0)))
