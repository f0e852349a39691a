"""Derivatives of the accelerations against Pinocchio's, the wheels' put in by hand."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from support.effects import motion_of
from support.models import DUAL_ARM, random_tree, robot_of
from support.pinocchio_states import pin_columns, pin_states, wheel_torques

from spacerobot_ros.dynamics.rotation import skew
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.filters.torque_process import TorqueDriven
from validation.pinocchio_peer import peer

WHEELS = {
    'servicer_wheels': {'momentum': [25.0, 27.0, 28.0]},
    'target_wheels': {
        'links': ['link_2', 'link_1'],
        'momentum': [42.0, 49.0, 41.0, -3.0, 5.0, 2.0],
    },
}
CASES = {
    'one joint': ([0], (), {}),
    'dual arm': (DUAL_ARM, (), WHEELS),
    'slides': ([0, 1, 2, 1], (2, 4), WHEELS),
    'seven joints': ([0, 1, 2, 3, 4, 5, 6], (4,), WHEELS),
    'fixed base': ([0, 1, 2, 0], (3,), {**WHEELS, 'base': 'fixed', 'gravity': [0.3, 1.0, -9.8]}),
}
COUNT = 5


def by_pinocchio(robot, motion):
    """Derivatives by positions, rates and forces, a call a state, in Pinocchio's order."""
    model, data = peer(robot).model, peer(robot).model.createData()
    forces = motion.zeros()
    forces[:, 6:] = motion.effort
    columns = pin_columns(robot)
    for (q, v), tau in zip(pin_states(motion), forces[:, columns], strict=True):
        external = wheel_torques(robot, q, v)
        by_q, by_v, inverse = (
            x.copy() for x in pin.computeABADerivatives(model, data, q, v, tau, external)
        )
        inverse = np.triu(inverse) + np.triu(inverse, 1).T
        pin.computeForwardKinematicsDerivatives(model, data, q, v, np.zeros(model.nv))
        for g in robot.gyrostats:
            joint = peer(robot).joint_ids[g.body]
            if joint:
                at_q, at_v = pin.getJointVelocityDerivatives(
                    model, data, joint, pin.ReferenceFrame.LOCAL
                )
                onto = inverse @ at_v[3:].T @ skew(g.body_momentum)
                by_q += onto @ at_q[3:]
                by_v += onto @ at_v[3:]
        yield by_q, by_v, inverse


@pytest.mark.parametrize('case', CASES.values(), ids=CASES.keys())
def test_derivatives_equal_pinocchio(case, rng):
    parents, prismatic, options = case
    parts = random_tree(rng, parents, prismatic)
    joints = [parts[i].joint for i in 1 + rng.permutation(len(parents))]
    robot = robot_of(parts, joints, **options)
    for joint in robot.joints:
        robot = robot.with_motor_inertia(joint, rng.uniform(0.1, 1.0))
    motion = motion_of(robot, rng, COUNT)
    if not robot.is_free:
        motion.omega, motion.velocity = np.zeros((2, COUNT, 3))
    process = TorqueDriven(robot)
    got, first, columns = process.linearize(motion), process.first, pin_columns(robot)
    kept = columns >= first
    for k, (by_q, by_v, inverse) in enumerate(by_pinocchio(robot, motion)):
        if robot.is_free:
            by_q[:, :6] = 0.0  # where the base is and how it is turned does not matter
        at = np.ix_(columns[kept] - first, columns[kept] - first)
        for ours, theirs in ((got.by_position[k], by_q), (got.by_velocity[k], by_v)):
            # a thousand operations, the inverse mass matrix among them
            limit = 1e-11 * np.max(np.abs(theirs))
            np.testing.assert_allclose(ours[at], theirs[kept][:, kept], rtol=0, atol=limit)
        limit = 1e-11 * np.max(np.abs(inverse))
        forced = got.by_force[k][columns[kept] - first][:, columns]
        np.testing.assert_allclose(forced, inverse[kept], rtol=0, atol=limit)


def test_what_a_motor_gives_of_its_torque_it_gives_of_its_noise(rng):
    """Else a gain near zero on a link of no mass is quiet whatever was measured."""
    parents, prismatic, options = CASES['dual arm']
    parts = random_tree(rng, parents, prismatic)
    robot = robot_of(parts, [part.joint for part in parts[1:]], **options)
    weak = CATALOGUE['joint_torque_constant'](
        name='weak', where=robot.joints[0], values={'gain': 0.25}
    )
    process = TorqueDriven(robot, [weak])
    got = process.linearize(motion_of(robot, rng, COUNT))
    gains = np.array([0.25, *[1.0] * (robot.n_joints - 1)])
    # differences of linear forces of a step of 1e-6, rounded to 1e-16 of some 100 N m
    expected = got.by_force[:, :, 6:] * gains
    np.testing.assert_allclose(got.by_effort, expected, rtol=0, atol=1e-7 * np.max(expected))
