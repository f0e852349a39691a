"""What an effect does along a given motion, as a generalized force on the believed robot.

An effect that changes the robot is the force by which the changed robot's inverse dynamics differ;
an effect with hidden states (a sprung mass) is driven by the given motion. Both are exact for the
given motion; that the motion itself stays as measured is what a filter's column means.
"""

from __future__ import annotations

import numpy as np

from ...dynamics.forward_kinematics import body_accelerations
from ...dynamics.rnea import rnea
from ...dynamics.tree import FREE, Records, difference, is_empty, tree_of
from ...effects.effect import Effect
from ...effects.motion import Motion
from ...model.robot import Robot
from ...types import Array
from ..trajectory.reference import Kinematics

_REMEMBERED = 1e8  # bytes of a motion: all of 20 s with ten joints, of 60 s with seven


class InverseDynamics:
    """Generalized force that a motion of one robot needs; wheels and gravity included.

    Args:
        robot: The robot.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.tree = tree_of(robot)

    def __call__(self, motion: Motion) -> Array:
        """(N, 6 + n) of S tau + unknown forces; the first six are zero for a fixed base."""
        force = needed(self.tree, motion)
        if self.robot.inputs is not None:
            force -= input_force(self.robot, motion)
        return force

    def motion(self, kinematics: Kinematics, effort: Array, window: Array | None = None) -> Motion:
        """A reference as a motion; known inputs alone act on a free base as a whole."""
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
            window=window,
        )
        if self.robot.is_free:
            mass = float(np.sum(self.robot.inertial_parameters[:, 0]))
            linear = -self(motion)[:, :3] / mass
            motion.acceleration = np.concatenate([linear, acceleration[:, 3:]], axis=1)
        return motion


def needed(tree: Records, motion: Motion) -> Array:
    """(N, 6 + n) generalized force that a motion needs of a tree, or of a difference of two.

    Gravity stands still where a free base turns.
    """
    known = motion.acceleration
    if known is None:
        raise ValueError('inverse dynamics need accelerations')
    qdd, gravity = np.ascontiguousarray(known[:, 6:]), tree[0]['gravity']
    if tree[0]['kind'] != FREE or not gravity.any():
        return np.asarray(rnea(tree, motion.kinematics, motion.accelerations, qdd))
    weightless, fall = tree.copy(), np.zeros_like(known)
    weightless[0]['gravity'] = 0.0
    fall[:, :3] = np.einsum('nji,j->ni', motion.rotation, gravity)
    bodies = body_accelerations(motion.tree, motion.kinematics, known - fall)
    return np.asarray(rnea(weightless, motion.kinematics, bodies, qdd))


def input_force(robot: Robot, motion: Motion) -> Array:
    """(N, 6 + n) of the robot's known inputs, each state's mean over its share of the time."""
    out = motion.zeros()
    if robot.inputs is None or not robot.is_free:
        return out
    window = motion.window
    if window is None:
        middle = 0.5 * (motion.time[1:] + motion.time[:-1])
        window = np.stack(
            [np.append(motion.time[:1], middle), np.append(middle, motion.time[-1:])], axis=1
        )
    out[:, :6] = robot.inputs.force(robot.thrusters, *window.T)
    if robot.inputs.wheels is not None:
        start, end = (excess_momentum(robot, times) for times in window.T)
        width = np.maximum(window[:, 1] - window[:, 0], 1e-9)[:, None]  # clocks tell no less
        out[:, 3:6] -= (end - start) / width + np.cross(motion.omega, 0.5 * (start + end))
    return out


def excess_momentum(robot: Robot, times: Array) -> Array:
    """(N, 3) measured momentum of the own wheels beyond the constant one of the robot [N m s].

    With it the wheels take h' + w x h from the base.
    """
    wheels = None if robot.inputs is None else robot.inputs.wheels
    if wheels is None:
        return np.zeros((len(times), 3))
    return wheels.at(times) - robot.servicer_momentum


class Response:
    """Generalized forces of effects along one motion.

    Args:
        robot: The believed robot, its believed effects' changes made.
        motion: The motion, with accelerations.
    """

    def __init__(self, robot: Robot, motion: Motion) -> None:
        self.robot = robot
        self.motion = motion
        self._inverse = InverseDynamics(robot)

    def force(self, effect: Effect) -> Array:
        """(N, 6 + n) by which the robot with the effect differs from the one without.

        What swings is dear, and asked again and again: that of the first model of a record serves
        all others, as first guesses of a frequency are farther from any truth than models are
        from each other.
        """
        known = self.motion.swung
        if known is None or not effect.hidden:
            return self._force(effect)
        key = (*effect.key, *effect.values.values())
        if key in known:
            return known[key].astype(float)
        force = self._force(effect)
        if len(known) * force.nbytes < 2.0 * _REMEMBERED:
            known[key] = force.astype(np.float32)
        return force

    def _force(self, effect: Effect) -> Array:
        changed = effect.change(self.robot)
        if changed is self.robot:
            return effect.force(self.motion, effect.driven(self.motion))
        motion = self.motion.of(changed)
        force = effect.force(motion, effect.driven(motion)) - self._difference(changed, motion)
        if self.robot.inputs is not None:
            force += input_force(changed, motion) - input_force(self.robot, motion)
        return force

    def _difference(self, changed: Robot, motion: Motion) -> Array:
        """(N, 6 + n) inverse dynamics of the changed robot less those of this one."""
        if not np.array_equal(changed.gravity, self.robot.gravity):
            return needed(tree_of(changed), motion) - needed(self._inverse.tree, motion)
        change = difference(tree_of(changed), self._inverse.tree)
        return motion.zeros() if is_empty(change) else needed(change, motion)
