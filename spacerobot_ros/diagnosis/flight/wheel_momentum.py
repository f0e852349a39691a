r"""The captured wheels' momentum in flight: a constant with a prior.

Its filter runs beside the state's, on the whitened innovations r and the columns s of the momentum
(Friedland 1969):

    r' = (r - s b) / sqrt(1 + s P s'),   b <- b + P s' (r - s b) / (1 + s P s')

so r' is white and of unit variance where only the momentum was not known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...dynamics.compiling import compiled
from ...effects.catalogue import CATALOGUE
from ...effects.motion import Motion
from ...estimation.unknowns.response import Response
from ...model.robot import Robot
from ...types import Array

_KIND = CATALOGUE['target_wheel_momentum']


@dataclass(frozen=True, slots=True, eq=False)
class Momentum:
    """What is believed of the captured wheels, beyond what the robot's model says.

    Args:
        mean: (p,) [N m s], link after link, each in its link frame. covariance: (p, p).
    """

    mean: Array
    covariance: Array


def momentum_forces(motion: Motion, robot: Robot) -> Array:
    """(N, 6 + n, p) generalized force of a unit momentum more of every captured wheel axis."""
    response = Response(robot, motion)
    columns = [
        response.force(_KIND(name='', where=wheels.link, values={**_KIND.nominal(), axis: 1.0}))
        for wheels in robot.target_wheels
        for axis in 'xyz'
    ]
    return np.stack(columns, axis=2) if columns else np.zeros((len(motion), 6 + robot.n_joints, 0))


@compiled
def constant_pass(values: Array, columns: Array, mean: Array, covariance: Array) -> Array:
    """Whitened innovations of C columns where p constants are estimated along.

    Args:
        values: (R, C).
        columns: (R, p) of the constants.
        mean: (p, C) estimates; updated in place.
        covariance: (p, p) of the constants; updated in place.

    Returns:
        (R, C).
    """
    out = np.empty_like(values)
    for r in range(len(values)):
        s = columns[r]
        spread = covariance @ s
        variance = 1.0 + s @ spread
        error = values[r] - s @ mean
        out[r] = error / np.sqrt(variance)
        for i in range(len(s)):
            mean[i] += spread[i] / variance * error
            for j in range(len(s)):
                covariance[i, j] -= spread[i] * spread[j] / variance
    return out
