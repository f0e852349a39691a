"""Joints: what effects at a manipulator joint have in common."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from ..model.robot import Robot
from ..types import Array
from .effect import Effect
from .motion import Motion, mobility
from .parameter import Parameter

STICTION_RATE = 2e-3
"""Rate over which dry friction changes its sign [rad/s]: sign(v) is smoothed to tanh(v / this)."""


class JointEffect(Effect):
    """An effect at a manipulator joint; of a sliding joint its torques are forces.

    Attributes of the kinds:
        needs_motor: Whether a joint without a motor shows nothing of it.
        needs_current: Whether only a motor whose effort is a current shows it.
    """

    group = 'joint'
    needs_motor: ClassVar[bool] = False
    needs_current: ClassVar[bool] = False

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Every manipulator joint, with a motor where it takes one."""
        if cls.needs_current:
            return robot.with_current
        passive = robot.passive_joints if cls.needs_motor else ()
        return tuple(joint for joint in robot.arm if joint not in passive)

    @classmethod
    def unit_at(cls, robot: Robot, where: str | None, parameter: Parameter) -> str:
        """Unit of one of its parameters: of a joint that slides by ways and forces."""
        if where not in robot.joints or parameter.role == 'phase':
            return parameter.unit
        return robot.unit_of(parameter.unit, where)

    @classmethod
    def parameters_at(cls, robot: Robot, where: str | None) -> tuple[Parameter, ...]:
        """As of any effect; friction beside that of the URDF is also less than none."""
        every = super().parameters_at(robot, where)
        base = robot.friction.get((cls.id, where), 0.0)
        return tuple(replace(p, minimum=-base) for p in every) if base else every

    def mobility(self, robot: Robot) -> float:
        """Acceleration of the joint by its own torque, all joints at zero [1/(kg m^2)]."""
        return mobility(robot, 6 + robot.joints.index(str(self.where)))


class JointTorque(JointEffect):
    """A torque on one joint that its own angle, rate and motor torque decide."""

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque at its joint."""
        column = motion.column(self.where)
        torque = self.torque(motion.q[:, column], motion.qd[:, column], motion.effort[:, column])
        return motion.joint_force(self.where, torque)

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """(N,) torque on the joint [N m].

        Args:
            q: (N,) its position [rad].
            qd: (N,) its rate [rad/s].
            effort: (N,) its motor torque [N m].
        """
        raise NotImplementedError


def direction(qd: Array) -> Array:
    """Smoothed sign of a joint rate."""
    return np.tanh(qd / STICTION_RATE)
