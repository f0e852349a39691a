"""What an effect does along a given motion, as a generalised force on the believed robot.

An effect that changes the robot is the force by which the changed robot's inverse dynamics differ;
an effect with hidden states (a sprung mass) is driven by the given motion. Both are exact for the
given motion; that the motion itself stays as measured is what a filter's column means.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import pinocchio as pin

from ..effects.effect import AppliedEffect
from ..effects.motion import Motion
from ..model.robot import Robot
from ..types import Array
from .reference import Kinematics
from .wheel_torque import WheelTorque


class InverseDynamics:
    """Generalised force that a motion of one robot needs; wheels and gravity included.

    Args:
        robot: The robot.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._wheels = WheelTorque(robot)

    def __call__(self, motion: Motion) -> Array:
        """(N, 6 + n) of S tau + external forces; the first six are zero for a fixed base."""
        acceleration = motion.acceleration
        if acceleration is None:
            raise ValueError('inverse dynamics need accelerations')
        model = self.robot.pin_model
        data, columns = model.createData(), motion.pin_columns
        out = motion.zeros()
        rates, accelerations = motion.rates[:, columns], acceleration[:, columns]
        for k, (q, v, a) in enumerate(
            zip(motion.configurations, rates, accelerations, strict=True)
        ):
            external = self._wheels.forces(q, v)
            out[k, columns] = pin.rnea(model, data, q, v, a, external)
        return out

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
            rotation=k.rotation.as_matrix(),
            omega=k.omega,
            acceleration=acceleration,
        )
        if self.robot.is_free:
            mass = float(np.sum(self.robot.inertial_parameters[:, 0]))
            acceleration[:, :3] = -self(motion)[:, :3] / mass
        return motion


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
    def regressor(self) -> Array:
        """(N, 6 + n, n_bodies, 10) inverse dynamics by the inertial parameters of every body."""
        motion, robot = self.motion, self.robot
        model, data = robot.pin_model, robot.pin_model.createData()
        columns = motion.pin_columns
        out = np.zeros((len(motion), 6 + robot.n_joints, len(robot.bodies), 10))
        bodies = [j - 1 for j in robot.pin_joint_ids]
        rates = motion.rates[:, columns]
        accelerations = np.asarray(motion.acceleration)[:, columns]
        for k, (q, v, a) in enumerate(
            zip(motion.configurations, rates, accelerations, strict=True)
        ):
            y = np.asarray(pin.computeJointTorqueRegressor(model, data, q, v, a))
            y = y.reshape(model.nv, -1)  # one joint alone comes without its axis
            for b, place in enumerate(bodies):
                if place >= 0:
                    out[k][columns, b] = y[:, 10 * place : 10 * place + 10]
        return out

    @cached_property
    def _needed(self) -> Array:
        return self._inverse(self.motion)

    def force(self, effect: AppliedEffect) -> Array:
        """(N, 6 + n) by which the robot with the effect differs from the one without."""
        changed = effect.change(self.robot)
        if changed is self.robot:
            return effect.force(self.motion, effect.driven(self.motion))
        motion = self.motion.of(changed)
        return effect.force(motion, effect.driven(motion)) - self._difference(changed, motion)

    def _difference(self, changed: Robot, motion: Motion) -> Array:
        """(N, 6 + n) inverse dynamics of the changed robot less those of this one."""
        inertial = changed.inertial_parameters - self.robot.inertial_parameters
        out = motion.zeros()
        if inertial.any():
            out += np.einsum('nibp,bp->ni', self.regressor, inertial)
        rest = changed.with_inertial_parameters(self.robot.inertial_parameters)
        if not _same_but_inertia(rest, self.robot):
            out += InverseDynamics(rest)(motion.of(rest)) - self._needed
        return out


def _same_but_inertia(a: Robot, b: Robot) -> bool:
    return (
        np.array_equal(a.gravity, b.gravity)
        and all(
            np.array_equal(x.body_momentum, y.body_momentum)
            for x, y in zip(a.gyrostats, b.gyrostats, strict=True)
        )
        and np.array_equal(a.pin_model.armature, b.pin_model.armature)
    )
