"""Whether a robot can have some effects: values that make sense, bodies that stay bodies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..dynamics.pseudo_inertia import pseudo_inertia
from ..effects.catalogue import changed_robot
from ..effects.effect import Effect
from ..errors import ConfigurationError
from ..model.robot import Robot


def is_possible(applied: Effect | Sequence[Effect], robot: Robot) -> bool:
    """Whether a robot with effects can move: a light link has no moment to lose."""
    try:
        changed_robot(robot, [applied] if isinstance(applied, Effect) else applied)
    except ConfigurationError:
        return False
    return True


def is_physical(effects: Sequence[Effect], robot: Robot) -> bool:
    """Whether every body of the robot is still one beside effects, made of positive masses."""
    try:
        remaining = changed_robot(robot, effects).inertial_parameters
    except ConfigurationError:
        return False
    was, remains = (
        np.linalg.eigvalsh(pseudo_inertia(p))[:, 0] > 0.0
        for p in (robot.inertial_parameters, remaining)
    )
    return bool(np.all(remains | ~was))
