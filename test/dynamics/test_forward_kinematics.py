"""Kinematics and inverse dynamics of many states at once against Pinocchio, state by state."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from support.effects import motion_of
from support.models import TREES, random_tree, robot_of
from support.pinocchio_states import pin_acceleration, pin_states, wheel_torques

from spacerobot_ros.dynamics.pinocchio_model import in_pinocchio
from spacerobot_ros.dynamics.tree import difference, is_empty, tree_of
from spacerobot_ros.estimation.unknowns.response import InverseDynamics, needed

COUNT = 5


@pytest.fixture(params=TREES.values(), ids=TREES.keys())
def robot(request, rng):
    """A robot whose joints stand in another order than its bodies, with motors of some inertia."""
    parents, prismatic, options = request.param
    parts = random_tree(rng, parents, prismatic)
    joints = [parts[i].joint for i in 1 + rng.permutation(len(parents))]
    robot = robot_of(parts, joints, **options)
    for joint in robot.joints:
        robot = robot.with_motor_inertia(joint, rng.uniform(0.1, 1.0))
    return robot


def moving(robot, rng):
    """Random states with accelerations; a fixed base has neither rate nor acceleration."""
    motion = motion_of(robot, rng, COUNT, acceleration=rng.standard_normal((COUNT, 20)))
    motion.acceleration = motion.acceleration[:, : 6 + robot.n_joints].copy()
    if not robot.is_free:
        motion.omega, motion.velocity = np.zeros((2, COUNT, 3))
        motion.acceleration[:, :6] = 0.0
    return motion


def close(got, expected):
    """Equal but for rounding: some hundred operations on numbers of the largest one's size."""
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * np.max(np.abs(expected)))


def test_kinematics_equal_pinocchio(robot, rng):
    motion = moving(robot, rng)
    model, data = in_pinocchio(robot).model, in_pinocchio(robot).model.createData()
    wrenches = rng.standard_normal((2, COUNT, 3))
    for body, joint in zip(robot.bodies, in_pinocchio(robot).joint_ids, strict=True):
        if not joint:
            continue
        forces = motion.wrench(body.name, *wrenches)
        for k, (q, v) in enumerate(pin_states(motion)):
            pin.forwardKinematics(model, data, q, v, pin_acceleration(motion)[k])
            place = data.oMi[joint]
            close(motion.base_rotation(body.name)[k], place.rotation)
            np.testing.assert_allclose(
                motion.link_position(body.name)[k], place.translation, rtol=0, atol=1e-14
            )
            close(motion.twist(body.name)[k], data.v[joint].vector)
            close(motion.link_acceleration(body.name)[k], data.a[joint].vector)
            pin.computeJointJacobians(model, data, q)
            J = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL)
            expected = np.zeros(6 + robot.n_joints)
            wrench = np.concatenate(wrenches[:, k])
            expected[in_pinocchio(robot).columns] = J.reshape(6, -1).T @ wrench
            close(forces[k], expected)


def test_a_new_acceleration_is_not_answered_with_the_old_one(robot, rng):
    motion = moving(robot, rng)
    last = robot.bodies[-1].name
    before = motion.link_acceleration(last)
    again = motion.of(robot)
    again.acceleration = 2.0 * np.asarray(motion.acceleration)
    drift = 2.0 * before - again.link_acceleration(last)  # affine in the acceleration
    again.acceleration = np.zeros_like(again.acceleration)
    limit = 1e-12 * np.max(np.abs(before))
    np.testing.assert_allclose(again.link_acceleration(last), drift, rtol=0, atol=limit)
    np.testing.assert_array_equal(motion.link_acceleration(last), before)


def needed_by_pinocchio(robot, motion):
    """(N, 6 + n) recursive Newton-Euler, a call a state."""
    model, columns = in_pinocchio(robot).model, in_pinocchio(robot).columns
    data = model.createData()
    out = motion.zeros()
    for k, (q, v) in enumerate(pin_states(motion)):
        external = wheel_torques(robot, q, v)
        out[k, columns] = pin.rnea(model, data, q, v, pin_acceleration(motion)[k], external)
    return out


def test_inverse_dynamics_equal_pinocchio(robot, rng):
    motion = moving(robot, rng)
    close(InverseDynamics(robot)(motion), needed_by_pinocchio(robot, motion))


def test_difference_of_two_robots_is_the_difference_of_their_forces(robot, rng):
    motion = moving(robot, rng)
    parameters = robot.inertial_parameters.copy()
    parameters[-1] *= 1.5
    other = robot.with_inertial_parameters(parameters).with_motor_inertia(robot.joints[0], 0.3)
    change = difference(tree_of(other), tree_of(robot))
    expected = needed_by_pinocchio(other, motion) - needed_by_pinocchio(robot, motion)
    close(needed(change, motion), expected)
    assert is_empty(difference(tree_of(robot), tree_of(robot)))
