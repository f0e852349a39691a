"""What a learned law may depend on, along a motion."""

from __future__ import annotations

from ..types import Array
from .grammar import quantity
from .motion import Motion

AXES = ('x', 'y', 'z')


def input_of(name: str, motion: Motion) -> Array | None:
    """(N,) an input along a motion; None where the motion does not have it."""
    what, whose = quantity(name)
    if what == 'time':
        return motion.time
    if what == 'attitude':
        return motion.rotation[:, AXES.index(whose[0]), AXES.index(whose[1])]
    if what == 'base_rate':
        return motion.omega[:, AXES.index(whose)]
    if what == 'extra':
        return motion.extra.get(whose)
    column = motion.column(whose)
    if what == 'acceleration':
        return None if motion.acceleration is None else motion.acceleration[:, 6 + column]
    return {'rate': motion.qd, 'angle': motion.q, 'load': motion.effort}[what][:, column]
