"""States of a motion as Pinocchio takes them, and the wheels' torques as its external forces."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.model.robot import Robot
from validation.pinocchio_peer import peer


def pin_columns(robot: Robot) -> np.ndarray:
    """(nv,) places of Pinocchio's velocities in a generalized vector [base; joints]."""
    order = np.empty(robot.n_joints, dtype=int)
    order[peer(robot).velocity_indices] = np.arange(robot.n_joints)
    base = np.arange(6) if robot.is_free else np.zeros(0, dtype=int)
    return np.concatenate([base, 6 + order])


def pin_states(motion: Motion) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Configuration and velocity of every state, the base at the origin."""
    robot = motion.robot
    offset = 7 if robot.is_free else 0
    for angles, rates in zip(motion.q, motion.rates, strict=True):
        q = np.zeros(peer(robot).model.nq)
        if robot.is_free:
            q[6] = 1.0
        q[offset + peer(robot).velocity_indices] = angles
        yield q, rates[pin_columns(robot)]


def pin_acceleration(motion: Motion) -> np.ndarray:
    """(N, nv) accelerations in Pinocchio's order."""
    return np.asarray(motion.acceleration)[:, pin_columns(motion.robot)]


def wheel_torques(robot: Robot, q: np.ndarray, v: np.ndarray) -> pin.StdVec_Force:
    """-omega x h on every body that carries gyrostats, in its frame."""
    model, data = peer(robot).model, peer(robot).model.createData()
    pin.forwardKinematics(model, data, q, v)
    external = pin.StdVec_Force([pin.Force.Zero() for _ in range(model.njoints)])
    for g in robot.gyrostats:
        joint = peer(robot).joint_ids[g.body]
        torque = -np.cross(data.v[joint].angular, g.body_momentum)
        external[joint] += pin.Force(np.zeros(3), torque)
    return external
