"""Whether a law could win by chance: the whole search repeated on data without meaning.

Data without meaning are what the law itself leaves, with random signs: of its whitened cosine
terms, which keeps the spectrum, lines included; and of blocks in time, which keeps noise that
grows where the motion is fast. The more careful of the two counts.

A score is a logarithm of odds, and chance exceeds it exponentially: by s nats more with exp(-s) at
most, as odds do, or steeper as the rarest tenth of the repetitions says. Most laws are nearly what
tolerances allow, which neither gain nor cost anything, so that the usual best score hardly varies
from one repetition to the next and says nothing of its tail.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...estimation.inference.spectral_terms import cosines, rows_of
from ...types import Array

FLIPS = 500  # of which the rarest tenth tells its slope to 1/sqrt(50), 14 %
_BLOCKS = 40  # in time: of 40 s a second each, over which noise that grows with the rate varies
_SEED = 13  # any serves
_RARE = 0.1

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
        score: Of the law, with the level that each hypothesis leaves itself: under the level that
            it leaves it would be larger, by all that is chance in this level.
        largest: The search.
        left: (M,) whitened residual with the law.
        count: Of rows in time.
    """
    rng = np.random.default_rng(_SEED)
    signs = rng.choice([-1.0, 1.0], (len(left), FLIPS))
    rows = rows_of(left, count)
    block = (np.arange(len(rows)) * _BLOCKS) // len(rows)
    turned = rows[:, None] * rng.choice([-1.0, 1.0], (_BLOCKS, FLIPS))[block]
    return max(_tail(score, largest(draws)) for draws in (signs * left[:, None], cosines(turned)))


def _tail(score: float, draws: Array) -> float:
    """Probability of a score, from where the rarest draws begin and how they fall off."""
    start = float(np.quantile(draws, 1.0 - _RARE))
    if score < start:
        return float(np.mean(draws >= score))
    beyond = draws[draws > start] - start
    fall = min(float(np.mean(beyond)), 1.0) if len(beyond) else 1.0
    return _RARE * math.exp((start - score) / max(fall, 1e-3))
