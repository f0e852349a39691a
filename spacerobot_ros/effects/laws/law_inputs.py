"""What a learned law may depend on, along a motion."""

from __future__ import annotations

from ...model.robot import Robot
from ...types import Array
from ..motion import Motion
from .grammar import quantity

AXES = ('x', 'y', 'z')
_OF_JOINTS = {'rate': 'qd', 'angle': 'q', 'load': 'effort'}


def base_axes(robot: Robot) -> tuple[str, ...]:
    """Axes of a free base as places, such as `base_link/x`."""
    return tuple(f'{robot.base_link}/{axis}' for axis in AXES) if robot.is_free else ()


_WIDTHS = {'attitude': 2, 'base_rate': 1, 'time': 0}
"""Axes in the name of a component."""


def is_component(what: str, whose: str) -> bool:
    """Whether a quantity of the base, or the time, has such a component."""
    return what not in _WIDTHS or (len(whose) == _WIDTHS[what] and set(whose) <= set(AXES))


def input_of(name: str, motion: Motion) -> Array | None:
    """(N,) an input along a motion; None where the motion does not have it."""
    return quantity_along(*quantity(name), motion)


def quantity_along(what: str, whose: str, motion: Motion) -> Array | None:
    """(N,) a quantity along a motion, as `input_of`.

    Args:
        what: What it is.
        whose: A joint, an axis, two of them, or a free name.
        motion: The motion.
    """
    if what in _OF_JOINTS:
        values: Array = getattr(motion, _OF_JOINTS[what])
        return values[:, motion.column(whose)]
    match what:
        case 'time':
            return motion.time
        case 'attitude':
            return motion.rotation[:, AXES.index(whose[0]), AXES.index(whose[1])]
        case 'base_rate':
            return motion.omega[:, AXES.index(whose)]
        case 'extra':
            return motion.extra.get(whose)
    known = motion.acceleration
    return None if known is None else known[:, 6 + motion.column(whose)]
