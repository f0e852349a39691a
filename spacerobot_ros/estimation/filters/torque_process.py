"""The torque-driven process: what the believed robot does under the measured torques.

Velocities of the filter are the m = 3 + n of base rate and joint rates (m = n for a fixed base).
The base's position and linear velocity are no part of it: by Galileo's principle they do not
matter to the rest. Generalized forces are (N, 6 + n) as in `effects.motion`.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from ...dynamics.acceleration_derivatives import acceleration_derivatives
from ...dynamics.rotation import skew
from ...effects.catalogue import changed_robot
from ...effects.effect import Effect
from ...effects.motion import Motion
from ...model.robot import Robot
from ...recording.record import Record
from ...recording.robot_inputs import with_inputs
from ...types import Array, BoolArray
from ..trajectory.reference import Kinematics
from ..unknowns.response import InverseDynamics, excess_momentum, input_force

_STEP = 1e-6  # of the differences that give the gradient of believed forces; rad, rad/s, N m


@dataclass(frozen=True, slots=True, eq=False)
class Linearized:
    """Derivatives of the m accelerations at N times.

    Args:
        by_position: (N, m, m) by [dphi; q]. The attitude itself does not matter.
        by_velocity: (N, m, m) by [omega; qd].
        by_force: (N, m, 6 + n) by the generalized force: rows of the inverse mass matrix.
        by_effort: (N, m, n) by the measured torques, which effects may scale.
    """

    by_position: Array
    by_velocity: Array
    by_force: Array
    by_effort: Array


class TorqueDriven:
    """The believed robot with its believed effects.

    Args:
        robot: The robot file's robot.
        effects: Effects believed in.
    """

    def __init__(self, robot: Robot, effects: Sequence[Effect] = ()) -> None:
        self._given = robot, tuple(effects)
        self.robot = changed_robot(robot, effects)
        self.effects = tuple(e for e in effects if e.acts('force'))
        # what has states of its own is driven by the reference and adds no gradient
        self._direct = tuple(e for e in self.effects if not e.hidden)
        self.first = 3 if robot.is_free else 6
        self.n = robot.n_joints
        self.m = self.n + 6 - self.first
        self._inverse = InverseDynamics(self.robot)

    def under(self, record: Record) -> TorqueDriven:
        """The same robot under the known inputs of a record; itself where there are none."""
        robot, effects = self._given
        driven = with_inputs(robot, record)
        return self if driven is robot else TorqueDriven(driven, effects)

    def motion(
        self,
        kinematics: Kinematics,
        effort: Array,
        unpowered: BoolArray | None = None,
        window: Array | None = None,
    ) -> Motion:
        """The reference with the accelerations of base and joints that belong to it."""
        motion = self._inverse.motion(kinematics, effort, window)
        motion.unpowered = unpowered
        return motion

    def needed(self, motion: Motion) -> Array:
        """(N, 6 + n) force that a motion needs beyond known inputs, without effects."""
        return self._inverse(motion)

    def forces(self, motion: Motion) -> Array:
        """(N, 6 + n) generalized force of the believed effects, motor torques excluded."""
        return self._sum(self.effects, motion)

    def force_error(self, motion: Motion) -> Array:
        """(N, 6 + n) force that the torques and effects give beyond what the motion needs.

        With the inverse mass matrix it gives the model's accelerations less the motion's.
        """
        force = self.forces(motion) - self.needed(motion)
        force[:, 6:] += motion.effort
        return force

    def linearize(self, motion: Motion) -> Linearized:
        """Derivatives of the accelerations about a motion."""
        robot, first = self.robot, self.first
        forces = self.forces(motion) + input_force(robot, motion)
        forces[:, 6:] += motion.effort
        by_q, by_v, inverse = acceleration_derivatives(
            robot, motion.q, motion.rates, motion.kinematics, forces
        )
        by_position, by_velocity = by_q[:, first:, first:].copy(), by_v[:, first:, first:].copy()
        if robot.is_free and robot.inputs is not None and robot.inputs.wheels is not None:
            gyroscopic = skew(excess_momentum(robot, motion.time))
            by_velocity[:, :, :3] += inverse[:, first:, 3:6] @ gyroscopic
        by_effort = inverse[:, first:, 6:].copy()
        if self._direct:
            self._add_effects(motion, inverse[:, first:], by_position, by_velocity, by_effort)
        return Linearized(by_position, by_velocity, inverse[:, first:], by_effort)

    def _add_effects(
        self, motion: Motion, inverse: Array, by_q: Array, by_v: Array, by_effort: Array
    ) -> None:
        """Add the gradient of the believed forces, by differences."""
        here = self._sum(self._direct, motion)

        def gradient(moved: Motion) -> Array:
            change = (self._sum(self._direct, moved) - here) / _STEP
            return np.asarray(np.einsum('nij,nj->ni', inverse, change))

        for i in range(self.m):
            column = self.first + i
            by_v[:, :, i] += gradient(_moved(motion, column, rate=_STEP))
            if column >= 6:
                by_q[:, :, i] += gradient(_moved(motion, column, position=_STEP))
        for j in range(self.n):
            effort = motion.effort.copy()
            effort[:, j] += _STEP
            driven = copy(motion)  # bodies move as they did
            driven.effort = effort
            by_effort[:, :, j] += gradient(driven)

    def _sum(self, effects: Sequence[Effect], motion: Motion) -> Array:
        total = motion.zeros()
        for effect in effects:
            total += effect.force(motion, effect.driven(motion))
        return total


def _moved(motion: Motion, column: int, *, rate: float = 0.0, position: float = 0.0) -> Motion:
    """The motion with one velocity or joint position changed."""
    q, qd, omega = motion.q, motion.qd, motion.omega
    if column < 6:
        omega = omega.copy()
        omega[:, column - 3] += rate
    else:
        q, qd = q.copy(), qd.copy()
        q[:, column - 6] += position
        qd[:, column - 6] += rate
    return replace(motion, q=q, qd=qd, omega=omega, coasts=False)
