"""From which size on an event is named, by a stated rate of false names."""

from __future__ import annotations

import math
from collections.abc import Sequence

import scipy

from ..limits import EVENT, EXCESS, EXCESSES, FALSE_PER_HOUR, LISTED, QUIET

ROOM = 2.0
"""Of that size, by which what is promised exceeds it: for the noise of one in twenty, for times at
which less is seen than usual, and for a shape that is no bell."""


def named_from(sizes: Sequence[float], hours: float) -> float:
    """Z from which `FALSE_PER_HOUR` false events are expected, on this machine.

    What is listed and exceeds `LISTED` by less than twice the mean is taken to be that part of an
    exponential tail. Events reach any z, and where they are many would raise a limit that counts
    them.

    Args:
        sizes: z of all that is listed.
        hours: Length of the recordings.
    """
    reach = 2.0 * EXCESS
    tail = [z - LISTED for z in sizes if z < LISTED + reach]
    excess = (EXCESSES * EXCESS + sum(tail)) / (EXCESSES + len(tail))
    per_hour = (len(tail) + 0.5) / hours / -math.expm1(-reach / excess)
    return max(EVENT, LISTED + excess * math.log(max(per_hour / FALSE_PER_HOUR, 1.0)))


def quiet_size(k: int) -> float:
    """`QUIET` of the norm of k normal numbers."""
    return math.sqrt(float(scipy.special.chdtri(k, 1.0 - QUIET)))


def as_rare(z: float, k: int) -> float:
    """Norm of k normal numbers that is exceeded as seldom as the size z of one."""
    return math.sqrt(float(scipy.special.chdtri(k, math.erfc(z / math.sqrt(2.0)))))


def chance(z: float, cells: float) -> float:
    """Probability that white noise exceeds z anywhere in so many independent templates."""
    return min(1.0, cells * math.erfc(abs(z) / math.sqrt(2.0)))
