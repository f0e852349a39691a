r"""Where a spring rests: what it and an offset of the same joint's torque say together.

On an arm a spring is fitted about the middle of the motion, q0, so that its constant part is an
offset b of the measured torque,

    tau = k (q - q0) + b = k (q - (q0 - b / k))

which is one cause, a spring that rests elsewhere, as long as the joint can be there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ...model.robot import Robot
from ..answer.cause import Cause, Estimated

SPRING, OFFSET = 'joint_stiffness', 'torque_sensor_bias'


def with_rests(causes: Sequence[Cause], robot: Robot) -> tuple[Cause, ...]:
    """Causes of an arm, a spring and an offset of one joint as one where they can be.

    Args:
        causes: All that are named.
        robot: The robot, which knows the range of its joints.
    """
    out = list(causes)
    for spring in causes:
        offset = at_place(out, OFFSET, spring)
        if spring.applied.id == SPRING and spring.relevant and offset is not None:
            moved = _moved(spring, offset)
            low, high = robot.position_limits[robot.joints.index(str(spring.applied.where))]
            if low <= moved.applied['rest_angle'] <= high:
                out[out.index(spring)] = moved
                out.remove(offset)
    return tuple(out)


def at_place(causes: Sequence[Cause], kind: str, beside: Cause) -> Cause | None:
    """A cause of one kind at the place, and of the recordings, of another."""
    place = beside.applied.where, beside.applied.recordings
    same = (c for c in causes if c.applied.id == kind)
    return next((c for c in same if (c.applied.where, c.applied.recordings) == place), None)


def _moved(spring: Cause, offset: Cause) -> Cause:
    """The spring where the offset is nothing."""
    k, b = spring.parameters['stiffness'], offset.parameters['bias']
    rest = spring.applied['rest_angle'] - b.value / k.value
    std = math.hypot(b.std, b.value / k.value * k.std) / k.value
    values = {**spring.applied.values, 'rest_angle': rest}
    unit = spring.parameters['rest_angle'].unit
    return replace(
        spring,
        applied=replace(spring.applied, values=values),
        parameters={**spring.parameters, 'rest_angle': Estimated(value=rest, std=std, unit=unit)},
        rivals=tuple(r for r in spring.rivals if r.key != offset.applied.key),
    )
