"""What an effect does along a given motion, as a generalised force on the believed robot.

An effect that changes the robot is the force by which the changed robot's inverse dynamics differ;
an effect with hidden states (a sprung mass) is driven by the given motion. Both are exact for the
given motion; that the motion itself stays as measured is what a filter's column means.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..dynamics.rnea import rnea
from ..dynamics.tree import Records, difference, is_empty, tree_of
from ..effects.effect import Effect
from ..effects.motion import Motion
from ..model.robot import Robot
from ..types import Array
from .reference import Kinematics


class InverseDynamics:
    """Generalised force that a motion of one robot needs; wheels and gravity included.

    Args:
        robot: The robot.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.tree = tree_of(robot)

    def __call__(self, motion: Motion) -> Array:
        """(N, 6 + n) of S tau + external forces; the first six are zero for a fixed base."""
        return needed(self.tree, motion)

    def motion(self, kinematics: Kinematics, effort: Array) -> Motion:
        """A reference as a motion; a free base moves so that no force acts on the whole."""
        k = kinematics
        acceleration = np.zeros((len(k.time), 6 + self.robot.n_joints))
        acceleration[:, 6:] = k.qdd
        acceleration[:, 3:6] = k.alpha
        motion = Motion(
            self.robot,
            k.time,
            k.q,
            k.qd,
            effort,
            rotation=k.matrices,
            omega=k.omega,
            acceleration=acceleration,
            coasts=self.robot.is_free,
        )
        if self.robot.is_free:
            mass = float(np.sum(self.robot.inertial_parameters[:, 0]))
            linear = -self(motion)[:, :3] / mass
            motion.acceleration = np.concatenate([linear, acceleration[:, 3:]], axis=1)
        return motion


def needed(tree: Records, motion: Motion) -> Array:
    """(N, 6 + n) generalised force that a motion needs of a tree, or of a difference of two."""
    if motion.acceleration is None:
        raise ValueError('inverse dynamics need accelerations')
    qdd = np.ascontiguousarray(motion.acceleration[:, 6:])
    return np.asarray(rnea(tree, motion.kinematics, motion.accelerations, qdd))


class Response:
    """Generalised forces of effects along one motion.

    Args:
        robot: The believed robot, its believed effects' changes made.
        motion: The motion, with accelerations.
    """

    def __init__(self, robot: Robot, motion: Motion) -> None:
        self.robot = robot
        self.motion = motion
        self._inverse = InverseDynamics(robot)

    @cached_property
    def _needed(self) -> Array:
        return self._inverse(self.motion)

    def force(self, effect: Effect) -> Array:
        """(N, 6 + n) by which the robot with the effect differs from the one without."""
        changed = effect.change(self.robot)
        if changed is self.robot:
            return effect.force(self.motion, effect.driven(self.motion))
        motion = self.motion.of(changed)
        return effect.force(motion, effect.driven(motion)) - self._difference(changed, motion)

    def _difference(self, changed: Robot, motion: Motion) -> Array:
        """(N, 6 + n) inverse dynamics of the changed robot less those of this one."""
        if not np.array_equal(changed.gravity, self.robot.gravity):
            return InverseDynamics(changed)(motion) - self._needed
        change = difference(tree_of(changed), self._inverse.tree)
        return motion.zeros() if is_empty(change) else needed(change, motion)
