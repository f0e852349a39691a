"""States of a motion as Pinocchio takes them, and the wheels' torques as its external forces."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from spacerobot_ros.dynamics.pinocchio_model import in_pinocchio
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.model.robot import Robot


def pin_states(motion: Motion) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Configuration and velocity of every state, the base at the origin."""
    robot = motion.robot
    offset = 7 if robot.is_free else 0
    for angles, rates in zip(motion.q, motion.rates, strict=True):
        q = np.zeros(in_pinocchio(robot).model.nq)
        if robot.is_free:
            q[6] = 1.0
        q[offset + in_pinocchio(robot).velocity_indices] = angles
        yield q, rates[in_pinocchio(robot).columns]


def pin_acceleration(motion: Motion) -> np.ndarray:
    """(N, nv) accelerations in Pinocchio's order."""
    return np.asarray(motion.acceleration)[:, in_pinocchio(motion.robot).columns]


def wheel_torques(robot: Robot, q: np.ndarray, v: np.ndarray) -> pin.StdVec_Force:
    """-omega x h on every body that carries gyrostats, in its frame."""
    model, data = in_pinocchio(robot).model, in_pinocchio(robot).model.createData()
    pin.forwardKinematics(model, data, q, v)
    external = pin.StdVec_Force([pin.Force.Zero() for _ in range(model.njoints)])
    for g in robot.gyrostats:
        joint = in_pinocchio(robot).joint_ids[g.body]
        torque = -np.cross(data.v[joint].angular, g.body_momentum)
        external[joint] += pin.Force(np.zeros(3), torque)
    return external
