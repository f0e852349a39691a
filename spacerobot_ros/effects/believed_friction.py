"""Friction of joints that a model believes in: of the URDF, of the robot file, and its totals.

`<dynamics damping= friction=>` of a URDF is viscous and Coulomb friction. A robot file's own
effect of that kind at the joint is the total, and stands for it; so does what a diagnosis names.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from ..model.robot import Robot
from .effect import Effect, Key
from .joints.joint_friction import CoulombFriction, ViscousFriction

_OF_URDF = (('damping', ViscousFriction), ('friction', CoulombFriction))
_TOTALS = (ViscousFriction.id, CoulombFriction.id)


def friction_of_urdf(robot: Robot, own: Sequence[Effect]) -> tuple[Effect, ...]:
    """Friction of a robot's URDF beside the effects of its robot file.

    Args:
        robot: The robot.
        own: Effects of the robot file.
    """
    joints, out = robot.tree.joints if robot.arm else {}, list[Effect]()
    for name in robot.arm:
        for attribute, kind in _OF_URDF:
            value, (parameter,) = getattr(joints[name], attribute), kind.parameters
            values = {parameter.name: value}
            effect = kind(name=f'{attribute} of {name} (URDF)', where=name, values=values)
            if value and not any(is_total(e, effect.key) for e in own):
                out.append(effect)
    return tuple(out)


def is_total(effect: Effect, believed: Key) -> bool:
    """Whether an effect is all friction of its kind and joint, a believed one included.

    Args:
        effect: A cause, or an effect of a robot file.
        believed: Id and place of the other.
    """
    law, where = believed
    is_friction = law in _TOTALS and law in (effect.id, *effect.refines)
    return is_friction and effect.where == where and effect.recordings is None


def base_of(effect: Effect, believed: Iterable[Effect]) -> float:
    """Believed friction that the total of an effect includes."""
    return sum(_size(e) for e in believed if is_total(effect, e.key))


def totals(found: Iterable[Effect], believed: Sequence[Effect]) -> list[Effect]:
    """Effects found beside believed ones, of frictions the total; what is believed counts once."""
    left, out = list(believed), list[Effect]()
    for effect in found:
        base, unit = base_of(effect, left), effect.parameters[0].unit if effect.parameters else ''
        sizes = {p.name: effect[p.name] + base for p in effect.parameters if p.unit == unit}
        left = [e for e in left if not is_total(effect, e.key)]
        out.append(effect.changed(**sizes) if base else effect)
    return out


def extended(believed: Iterable[Effect], added: Sequence[Effect]) -> tuple[Effect, ...]:
    """All effects of a model with further ones, of which frictions are totals."""
    return (*(e for e in believed if not any(is_total(a, e.key) for a in added)), *added)


def with_friction(robot: Robot, believed: Iterable[Effect]) -> Robot:
    """The robot that knows how much friction of its joints is believed: so much can be absent."""
    friction: dict[Key, float] = {}
    for effect in believed:
        if effect.id in _TOTALS:
            friction[effect.key] = friction.get(effect.key, 0.0) + _size(effect)
    return replace(robot, friction=friction)


def _size(friction: Effect) -> float:
    return next(iter(friction.values.values()))
