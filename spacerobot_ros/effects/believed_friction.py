"""Friction of a URDF: `<dynamics damping= friction=>`, which the model believes in.

A robot file's own effect of that kind at the joint is the total, and replaces it; so does what a
diagnosis names.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from ..model.robot import Robot
from .effect import Effect
from .joints.joint_friction import CoulombFriction, ViscousFriction

_OF_URDF = (('damping', ViscousFriction), ('friction', CoulombFriction))
_MARK = ' (URDF)'


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
            effect = kind(name=f'{attribute} of {name}{_MARK}', where=name, values=values)
            if value and not any(is_total(e, effect) for e in own):
                out.append(effect)
    return tuple(out)


def of_urdf(effects: Iterable[Effect]) -> list[Effect]:
    """Of some effects those that the URDF states."""
    return [effect for effect in effects if effect.name.endswith(_MARK)]


def urdf_in_words(robot: Robot, effects: Iterable[Effect]) -> tuple[str, ...]:
    """A note that friction of the URDF is believed; none where it says nothing."""
    said: dict[str, list[str]] = {}
    for effect in of_urdf(effects):
        (p,) = effect.parameters
        law = 'viscous' if effect.id == ViscousFriction.id else 'Coulomb'
        value = f'{law} {effect[p.name]:g} {effect.unit_at(robot, effect.where, p)}'
        said.setdefault(str(effect.where), []).append(value)
    joints = '; '.join(f'{joint} {", ".join(values)}' for joint, values in said.items())
    return (f'friction of the URDF is believed: {joints}',) if said else ()


def is_total(effect: Effect, believed: Effect) -> bool:
    """Whether an effect is all friction of its kind and joint, that of the URDF included."""
    is_same = believed.id in (effect.id, *effect.refines) and effect.where == believed.where
    return believed.name.endswith(_MARK) and is_same and effect.recordings is None


def totals(found: Sequence[Effect], believed: Iterable[Effect]) -> list[Effect]:
    """Effects found beside believed ones, of frictions the total.

    Friction of the URDF is part of one of them: of its own law, or else of one that refines it.
    """
    out = list(found)
    for base in of_urdf(believed):
        here = [k for k, effect in enumerate(found) if is_total(effect, base)]
        for k in sorted(here, key=lambda k: found[k].id != base.id)[:1]:
            unit = found[k].parameters[0].unit
            sizes = {p.name: out[k][p.name] for p in found[k].parameters if p.unit == unit}
            more = {name: max(0.0, size + _size(base)) for name, size in sizes.items()}
            out[k] = out[k].changed(**more)
    return out


def extended(believed: Iterable[Effect], added: Sequence[Effect]) -> tuple[Effect, ...]:
    """All effects of a model with further ones, of which frictions are totals."""
    return (*(e for e in believed if not any(is_total(a, e) for a in added)), *added)


def with_friction(robot: Robot, believed: Iterable[Effect]) -> Robot:
    """The robot that knows the friction of its URDF that is believed: so much can be absent."""
    return replace(robot, friction={e.key: _size(e) for e in of_urdf(believed)})


def _size(friction: Effect) -> float:
    return next(iter(friction.values.values()))
