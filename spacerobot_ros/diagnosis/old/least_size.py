"""From which size on a cause has enough evidence for a name."""

from __future__ import annotations

import math

import numpy as np

from ...estimation.inference.evidence import Gram, price
from ...types import Array


def multiple_of(gram: Gram, direction: Array, cost: float, sizes: Array, others: Array) -> float:
    """Multiple x of coefficients (K,) of which the evidence of some sizes over others is a cost.

    Noise aside, 1/2 x^2 d' S (S + 1 / prior^2)^-1 S d less the price of its freedom, with S the
    information of the coefficients. Infinite where the motion shows nothing of it.

    Args:
        gram: Sums for the coefficients, all else integrated out.
        direction: (K,) of them.
        cost: The log evidence.
        sizes: (K,) prior standard deviations.
        others: (K,) those of what it is compared with.
    """
    power = 0.0
    for sign, prior in ((1.0, sizes), (-1.0, others)):
        scaled, seen = prior[:, None] * gram.matrix * prior, prior * (gram.matrix @ direction)
        power += sign * float(seen @ np.linalg.solve(np.eye(len(prior)) + scaled, seen))
        cost += sign * price(np.asarray(np.linalg.eigvalsh(scaled)), gram.rows)
    return math.sqrt(2.0 * cost / power) if power > 0.0 else math.inf


def deviation_along(gram: Gram, direction: Array) -> float:
    """Standard deviation of a multiple of coefficients (K,); infinite where nothing shows it."""
    square = float(direction @ gram.matrix @ direction)
    return 1.0 / math.sqrt(square) if square > 0.0 else math.inf


def by_few(gain: float, freedom: float) -> float:
    """Log evidence by the level of few runs: Student's t in place of a normal distribution."""
    if gain <= 0.0 or math.isinf(freedom):
        return gain
    return 0.5 * (freedom + 1.0) * math.log1p(2.0 * gain / freedom)


def as_many(gain: float, freedom: float) -> float:
    """Of which `by_few` makes a log evidence."""
    if math.isinf(freedom):
        return gain
    return 0.5 * freedom * math.expm1(2.0 * gain / (freedom + 1.0))
