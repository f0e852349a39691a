"""What the effects of one manipulator joint share."""

from __future__ import annotations

from ..model.robot import Robot
from ..types import Array
from .effect import Effect
from .motion import Motion, inverse_mass


class JointEffect(Effect):
    """An effect at a manipulator joint; of a sliding joint its torques are forces."""

    group = 'joint'

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Every manipulator joint."""
        return robot.arm

    def mobility(self, robot: Robot) -> float:
        """Acceleration of the joint by its own torque, all joints at zero [1/(kg m^2)]."""
        column = 6 + robot.joints.index(str(self.where))
        return float(inverse_mass(robot)[column, column])


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
