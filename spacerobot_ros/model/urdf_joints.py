"""Joints of a URDF, and those that are held at an angle: a gripper that nobody logs.

A held joint is a fixed one at that angle, and so is one that mimics it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace

import scipy

from ..errors import ConfigurationError
from ..types import Matrix3, Vector3
from .schema import REST

MOVING = ('revolute', 'continuous', 'prismatic')
FRICTION = ('damping', 'friction')
"""Attributes of `<dynamics>`."""
_TURN = 2.0 * math.pi
_SLACK = 1e-6  # rad or m beyond a limit: decimals of a file


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint at `multiplier` times another one's position plus `offset`."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """One joint: child frame in the parent's at zero, unit axis in the child frame, limits.

    Limits are infinite where the URDF gives none, or an effort or a velocity of zero. `held` is
    the position of one that is held [rad or m], whose kind is fixed then. `damping` [N m s/rad or
    N s/m] and `friction` [N m or N] are those of `<dynamics>`, of a joint that moves by itself.
    """

    name: str
    kind: str
    parent: str
    child: str
    rotation: Matrix3
    translation: Vector3
    axis: Vector3
    effort_limit: float
    velocity_limit: float
    position_limit: tuple[float, float]
    mimic: Mimic | None = None
    held: float | None = None
    damping: float = 0.0
    friction: float = 0.0

    @property
    def slides(self) -> bool:
        """Whether it slides instead of turning."""
        return self.kind == 'prismatic'

    def held_at(self, position: float) -> Joint:
        """The fixed joint that it is at a position [rad or m]."""
        rotation, translation = self.rotation, self.translation
        if self.slides:
            translation = translation + position * (rotation @ self.axis)
        else:
            rotation = (
                rotation
                @ scipy.spatial.transform.Rotation.from_rotvec(position * self.axis).as_matrix()
            )
        moved = replace(self, rotation=rotation, translation=translation)
        return replace(moved, kind='fixed', mimic=None, held=position)


def with_held(joints: Mapping[str, Joint], held: Mapping[str, float]) -> dict[str, Joint]:
    """Joints of which some are held, and those that mimic them.

    Args:
        joints: By name.
        held: Position of each joint that is held [rad or m].

    Raises:
        ConfigurationError: one that is no moving joint, or can not be held there.
    """
    moving = [joint.name for joint in joints.values() if joint.kind in MOVING]
    for name, given in held.items():
        others = {other: q for other, q in held.items() if other != name}
        why = f'the URDF has no moving joint {name!r} (it has {", ".join(moving)})'
        faults = _faults(joints[name], given, joints, others) if name in moving else (why,)
        for fault in faults:
            raise ConfigurationError(f'robot.held.{name}', fault)
    at = {name: _position(name, joints, held) for name in moving}
    return {
        name: joint if (position := at.get(name)) is None else joint.held_at(position)
        for name, joint in joints.items()
    }


def with_rest(
    joints: Mapping[str, Joint], listed: Collection[str], held: Mapping[str, float]
) -> dict[str, float]:
    """Positions of held joints [rad or m], with those of joints that `REST` stands for.

    Args:
        joints: By name.
        listed: Those that move.
        held: By name, and of all others.
    """
    if REST in joints or REST not in held:
        return dict(held)
    out = {name: position for name, position in held.items() if name != REST}
    for name, joint in joints.items():
        follows = joint.mimic is not None and joint.mimic.joint not in listed
        if joint.kind in MOVING and not (name in listed or name in held or follows):
            low, high = joint.position_limit
            out[name] = min(max(held[REST], low), high)
    return out


def _position(name: str, joints: Mapping[str, Joint], held: Mapping[str, float]) -> float | None:
    """Where a joint is held: by itself, or as a mimic of one that is; None where it moves."""
    scale, offset = 1.0, 0.0
    for _ in joints:  # chains are no longer
        if name in held:
            return scale * held[name] + offset
        joint = joints.get(name)
        if joint is None or joint.mimic is None:
            break
        name, offset = joint.mimic.joint, offset + scale * joint.mimic.offset
        scale *= joint.mimic.multiplier
    return None


def _faults(
    joint: Joint, position: float, joints: Mapping[str, Joint], others: Mapping[str, float]
) -> Iterator[str]:
    unit = 'm' if joint.slides else 'rad'
    low, high = joint.position_limit
    if not low - _SLACK <= position <= high + _SLACK:
        yield f'{position:g} {unit} is beyond its limits in the URDF, {low:g} to {high:g} {unit}'
    elif not joint.slides and abs(position) > _TURN:
        yield f'{position:g} rad is more than a turn: angles are in rad'
    follows = _position(joint.name, joints, others)
    if follows is not None and abs(follows - position) > _SLACK:
        yield (
            f'{position:g} {unit}, but it mimics a joint that is held, which puts it at '
            f'{follows:g} {unit}: leave it out'
        )


def left_moving(joint: Joint) -> str:
    """Why a joint of the URDF that is neither listed nor held has to be one of these."""
    if joint.mimic is None:
        return (
            f'joint {joint.name!r} of the URDF moves but is not named: list it, make it '
            f'fixed, or hold it by robot.held: {{{joint.name}: 0.0}}'
        )
    return (
        f'joint {joint.name!r} of the URDF mimics {joint.mimic.joint!r}, which is not supported '
        f'while that moves: hold it by robot.held: {{{joint.name}: 0.0}}, '
        'or hold both by that of the other'
    )
