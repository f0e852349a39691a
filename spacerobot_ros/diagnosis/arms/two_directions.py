r"""Dry friction of two sizes: what a friction and an offset of one joint's efforts say together.

    tau_measured - tau = T sign(q') + b = F where q' > 0, -B where q' < 0,    F = T + b, B = T - b

is one cause, friction of another size in each direction, as long as the joint moves; at rest it
holds any torque from -B to F either way. The zero of a torque sensor drifts, so there an offset
is one; currents are set to zero with the motor off, and a command has no sensor.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from ...effects.catalogue import CATALOGUE
from ...effects.effect import Effect
from ...estimation.balance.arm_priors import DRY
from ...model.robot import Robot
from ..answer.cause import Cause, Estimated
from .spring_rest import OFFSET, at_place

_KINDS = ('motor', 'current', 'command')  # of efforts
_CURRENT = 'current_offset'
_TWO_SIZES = 'joint_asymmetric_friction'
_LARGEST = 0.5
"""Of the friction, an offset that is its own: three times as much one way as the other. A cart's
belt has 2.4 times (6 and 2.5 N), an arm's drive 1.1; what is more is a zero."""


def with_directions(
    causes: Sequence[Cause], robot: Robot, constants: Iterable[Effect]
) -> tuple[Cause, ...]:
    """Causes of an arm, a dry friction and an offset of one joint as one where they can be.

    Args:
        causes: All that are named.
        robot: The robot.
        constants: Motor constants that were estimated along.
    """
    out = list(causes)
    units = dict(zip(robot.arm, robot.known_effort_units.tolist(), strict=True))
    units |= {str(c.where): c['constant'] for c in constants}
    for friction in causes:
        kind, where = friction.applied.id, str(friction.applied.where)
        if kind != DRY or not friction.relevant or robot.effort_kind(where) not in _KINDS:
            continue
        offset = at_place(out, OFFSET, friction) or at_place(out, _CURRENT, friction)
        if offset is None or not offset.relevant:
            continue
        both = _both(friction, offset, 1.0 if offset.applied.id == OFFSET else units[where])
        if both is not None:
            out[out.index(friction)] = both
            out.remove(offset)
    return tuple(out)


def is_frictions(offset: float, dry: float) -> bool:
    """Whether an offset of a joint's torque may be its dry friction's."""
    return abs(offset) <= _LARGEST * dry


def direction_notes(causes: Iterable[Cause], robot: Robot) -> tuple[str, ...]:
    """What else such friction may be, and which data would tell."""
    return tuple(_note(c, robot) for c in causes if c.applied.id == _TWO_SIZES)


def _note(cause: Cause, robot: Robot) -> str:
    where = str(cause.applied.where)
    forward, backward = cause.applied['forward'], cause.applied['backward']
    unit = robot.unit_of('N m', where)
    return (
        f'{where}: friction of {forward:.3g} and {backward:.3g} {unit} by its direction is one of '
        f'{0.5 * (forward + backward):.3g} {unit} and an offset of the efforts of '
        f'{0.5 * (forward - backward):.3g} {unit}, moving or held; efforts logged while the motor '
        'is off tell: an offset stays in them'
    )


def _both(friction: Cause, offset: Cause, unit: float) -> Cause | None:
    """One cause of both; None where the offset is too large to be friction's."""
    dry = friction.parameters['torque']
    (zero,) = offset.parameters.values()
    shift = unit * zero.value
    if not is_frictions(shift, dry.value):
        return None
    std = math.hypot(dry.std, unit * zero.std)
    values = {'forward': dry.value + shift, 'backward': dry.value - shift}
    applied = CATALOGUE[_TWO_SIZES](
        name=f'{_TWO_SIZES}_{friction.applied.where}', where=friction.applied.where, values=values
    )
    return replace(
        friction,
        applied=applied,
        parameters={
            name: Estimated(value=v, std=std, unit=dry.unit) for name, v in values.items()
        },
        thresholds={
            p.name: replace(p, relevant=friction.thresholds['torque'].relevant)
            for p in applied.parameters
        },
        rivals=tuple(r for r in friction.rivals if r.effect != offset.applied.id),
        constant_p=min(friction.constant_p, offset.constant_p),
    )
