"""What a formula may take: quantities of joints, base and sensors, their units and values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...model.robot import Robot
from ...types import Array
from ..joint import STICTION_RATE
from ..motion import Motion

AXES = ('x', 'y', 'z')
READING = 'reading'
OF_JOINTS = {'position': 'rad', 'rate': 'rad/s', 'effort': 'N m'}
"""With units of joints that turn."""
OF_KNOWN_MOTIONS = {'acceleration': 'rad/s^2'}
"""Of joints, too, along a motion that is known: forces that are simulated make it themselves."""
OF_BASE = {'base_rate': tuple(AXES), 'attitude': tuple(a + b for a in AXES for b in AXES)}
"""With what may be in brackets behind them."""
CHANNELS = {
    'joint_position': (*OF_JOINTS, READING),
    'joint_velocity': (*OF_JOINTS, READING),
    'joint_effort': (*OF_JOINTS, READING),
    'gyro': ('base_rate', READING),
    'attitude': (),
}
"""Channels that a formula may change, and quantities that are known where that is undone."""
MEASURED = dict(zip(CHANNELS, OF_JOINTS, strict=False))
"""What a channel of joints measures."""
_OF_FORCES = (*OF_JOINTS, *OF_BASE)
_VALUES = {'position': 'q', 'rate': 'qd', 'effort': 'effort'}
_TRIALS = 16  # random states at which a formula is tried

Quantities = Mapping[str, tuple[str | None, ...]]
"""Quantities, and what may be in brackets behind each: '' nothing, None any joint."""


def parts(name: str) -> tuple[str, str]:
    """Of a quantity such as `rate[joint_2]`: what it is, and whose; empty for its own."""
    what, _, whose = name.partition('[')
    return what, whose.removesuffix(']')


def bracketed(what: str, whose: str) -> str:
    """The name of a quantity, in quotes where the place is no plain name."""
    return f'{what}[{whose if whose.isidentifier() else repr(whose)}]' if whose else what


def is_axis(where: str | None) -> bool:
    """Whether a place is an axis of the base, such as `base_link/x`."""
    return where is not None and where[-2:] in {f'/{axis}' for axis in AXES}


def base_axes(robot: Robot) -> tuple[str, ...]:
    """Axes of a free base as places, such as `base_link/x`."""
    return tuple(f'{robot.base_link}/{axis}' for axis in AXES) if robot.is_free else ()


def known_quantities(
    channel: str, is_at_joint: bool, extra: Sequence[str], is_known_motion: bool = False
) -> Quantities:
    """What a formula may take.

    Args:
        channel: That it changes; empty for a force.
        is_at_joint: Whether it acts at a joint, not at an axis of the base.
        extra: Names of what else is measured.
        is_known_motion: Whether it is asked along a known motion alone.
    """
    joints: tuple[str | None, ...] = ('', None) if is_at_joint else (None,)
    out: dict[str, tuple[str | None, ...]] = {}
    for what in CHANNELS[channel] if channel else _OF_FORCES:
        out[what] = joints if what in OF_JOINTS else OF_BASE.get(what, ('',))
    out |= dict.fromkeys(OF_KNOWN_MOTIONS if is_known_motion else (), joints)
    return {**out, 'time': ('',), **({'extra': tuple(extra)} if extra else {})}


def is_known(name: str, known: Quantities) -> bool:
    """Whether a quantity is among some."""
    what, whose = parts(name)
    forms = known.get(what, ())
    return whose in forms or bool(whose and None in forms)


def listed(known: Quantities) -> Iterator[str]:
    """For messages."""
    for what, forms in known.items():
        if '' in forms:
            yield what
        names = ['JOINT' if whose is None else whose for whose in forms if whose != '']
        if names:
            yield f'{what}[{"|".join(names)}]'


def unit_of(name: str, robot: Robot, where: str | None) -> str:
    """Unit of a quantity of joints, of the base or of time."""
    what, whose = parts(name)
    of_joints = {**OF_JOINTS, **OF_KNOWN_MOTIONS}
    if what in of_joints:
        return robot.unit_of(of_joints[what], whose or str(where))
    return {'time': 's', 'base_rate': 'rad/s', 'attitude': ''}[what]


def quantity_along(what: str, whose: str, motion: Motion) -> Array | None:
    """(N,) a quantity along a motion; None where the motion does not have it.

    Args:
        what: What it is.
        whose: A joint, an axis, two of them, or a free name.
        motion: The motion.
    """
    if what in _VALUES:
        values: Array = getattr(motion, _VALUES[what])
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


def at_rest(name: str) -> Array:
    """(1,) of a robot at rest, its base in the inertial frame."""
    what, whose = parts(name)
    return np.full(1, float(what == 'attitude' and whose[0] == whose[1]))


def anywhere(name: str, rng: np.random.Generator) -> Array:
    """(N,) random values; rates both within and beyond stiction."""
    what, _ = parts(name)
    if what == 'time':
        return rng.uniform(0.0, 10.0, _TRIALS)
    slow = np.where(rng.random(_TRIALS) < 0.3, STICTION_RATE, 1.0)
    return rng.uniform(-1.0, 1.0, _TRIALS) * (slow if what == 'rate' else 1.0)
