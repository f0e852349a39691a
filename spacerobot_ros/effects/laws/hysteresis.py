r"""Dry friction with a history, for learned torques: the share z of the torque that is mobilised.

    play:   d z' = q'  where |z| < 1 or q' unloads, else 0   (elastic contacts that then slide)
    Dahl:   d z' = q' (1 - z sign(q'))                       (AIAA J. 14 (1976))

Both are functions of the path of q alone, |z| <= 1, and give back no more than they took. Along
angles they are followed exactly; the plant integrates their rates.
"""

from __future__ import annotations

import math

import numpy as np

from ...dynamics.compiling import compiled
from ...types import Array

SLIDING_ACCELERATION = 5.0
"""Acceleration [rad/s^2] with which a joint that starts from rest has the rate sqrt(2 * this * d)
after the displacement d. Faster ones slide already, and a share, which is stiff there, need not
follow more than that rate to stay at 1."""


def followed(q: Array, displacement: float, *, is_dahl: bool, start: float = 0.0) -> Array:
    """(N,) share along angles (N,), from its start; exact for ways in one direction."""
    return np.asarray(_followed(np.diff(q) / displacement, start, is_dahl))


@compiled
def _followed(way: Array, start: float, is_dahl: bool) -> Array:
    z = np.full(len(way) + 1, start)
    for k in range(len(way)):
        if is_dahl:
            sign = 1.0 if way[k] >= 0.0 else -1.0
            z[k + 1] = sign - (sign - z[k]) * math.exp(-abs(way[k]))
        else:
            z[k + 1] = min(max(z[k] + way[k], -1.0), 1.0)
    return z


def share_rate(rate: Array, share: Array, displacement: float, *, is_dahl: bool) -> Array:
    """Rate of the share at joint rates of the same shape [1/s]."""
    if not is_dahl:
        slides = (np.abs(share) >= 1.0) & (share * rate > 0.0)
        return np.where(slides, 0.0, rate) / displacement
    most = math.sqrt(2.0 * SLIDING_ACCELERATION * displacement)
    rate = np.clip(rate, -most, most)
    return (rate - share * np.abs(rate)) / displacement


def fastest_share(displacement: float) -> float:
    """Fastest decay rate of the share [1/s]."""
    return math.sqrt(2.0 * SLIDING_ACCELERATION / displacement)
