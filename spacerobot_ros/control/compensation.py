"""What a controller can do about the physical effects that its model believes in.

Bodies and wheels are the changed robot's. Forces inside the machine that follow from the motion
(friction, learned ones with their history, gains of motors, harnesses) are fed forward along the
reference, so that nothing is fed back through a friction that changes its sign; sensor faults are
undone before the law sees a sample. What comes from outside, runs by a clock of its own or swings
on states that no sensor shows is left to the feedback.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..dynamics.equations import Dynamics
from ..effects.effect import Effect
from ..effects.motion import Motion
from ..model.robot import Robot
from ..types import Array, Vector3
from .joint_reference import Setpoint

_PASSES = 3  # of the fixed point for forces in proportion to the torque itself


class FeedForward:
    """Joint torques that make up for the forces of effects along a reference.

    Args:
        robot: The robot as all effects have made it.
        effects: The believed effects; those that can't be fed forward are passed over.
    """

    def __init__(self, robot: Robot, effects: Sequence[Effect]) -> None:
        self._robot = robot
        self._effects = tuple(effect for effect in effects if effect.is_known_ahead)
        self._dynamics = Dynamics(robot)
        self._own = [np.zeros(effect.hidden) for effect in self._effects]
        self._last: Array | None = None  # joint angles of the reference

    def __call__(self, setpoint: Setpoint, omega_WB_B: Vector3, tau: Array) -> Array:
        """(n,) torque under which the effects leave of `tau` (n,) what it was meant to do.

        Args:
            setpoint: The reference.
            omega_WB_B: (3,) base rate.
            tau: (n,) torque of a law that knows of no effects [N m].
        """
        if not self._effects:
            return tau
        self._follow(setpoint.q)
        wanted, base_share = tau, self._base_share(setpoint.q)
        for _ in range(_PASSES):
            force = self._force(setpoint, omega_WB_B, tau)
            tau = wanted - (force[6:] - base_share @ force[:6])
        return tau

    def _force(self, setpoint: Setpoint, omega_WB_B: Vector3, tau: Array) -> Array:
        """(6 + n,) generalised force of all effects."""
        state = np.zeros(1), setpoint.q[None], setpoint.qd[None], tau[None]
        motion = Motion(self._robot, *state, omega=omega_WB_B[None])
        pairs = zip(self._effects, self._own, strict=True)
        return np.asarray(sum(effect.force(motion, own[None])[0] for effect, own in pairs))

    def _follow(self, q: Array) -> None:
        """Own states of effects along the reference, whose history they are."""
        if self._last is not None:
            self._own = [
                effect.followed(self._robot, own, self._last, q)
                for effect, own in zip(self._effects, self._own, strict=True)
            ]
        self._last = q

    def _base_share(self, q: Array) -> Array:
        """(n, 6) joint force that a force on the free base amounts to, its motion eliminated."""
        n = self._robot.n_joints
        if not self._robot.is_free:
            return np.zeros((n, 6))
        M = self._dynamics.mass_matrix(q)
        return np.asarray(np.linalg.solve(M[:6, :6], M[:6, 6:]).T)
