"""What the effects of one manipulator joint share."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ..model.robot import Robot
from ..types import Array
from .effect import Effect, Values
from .motion import Motion


class JointEffect(Effect):
    """An effect at a manipulator joint; of a sliding joint its torques are forces."""

    def places(self, robot: Robot) -> tuple[str | None, ...]:
        """Every manipulator joint."""
        return robot.joints[: robot.n_joints - robot.rotor_count]


class JointTorque(JointEffect):
    """A torque on one joint that its own angle, rate and motor torque decide."""

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """The torque at its joint."""
        joint = str(where)
        column = column_of(motion, where)
        torque = self.torque(
            motion.q[:, column], motion.qd[:, column], motion.effort[:, column], values
        )
        return motion.joint_force(joint, torque)

    def torque(self, q: Array, qd: Array, effort: Array, values: Values) -> Array:
        """(N,) torque on the joint [N m].

        Args:
            q: (N,) its position [rad].
            qd: (N,) its rate [rad/s].
            effort: (N,) its motor torque [N m].
            values: The effect's parameters.
        """
        raise NotImplementedError


def column_of(motion: Motion, where: str | None) -> int:
    """Place of a joint in joint vectors."""
    return motion.robot.joints.index(str(where))


def mobility(robot: Robot, where: str | None) -> float:
    """Acceleration of a joint by its own torque, all joints at zero [1/(kg m^2)]."""
    model = robot.pin_model
    inverse = pin.computeMinverse(model, model.createData(), pin.neutral(model))
    column = model.joints[model.getJointId(str(where))].idx_v
    return float(np.asarray(inverse)[column, column])
