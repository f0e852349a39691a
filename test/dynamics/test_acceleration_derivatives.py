"""Derivatives of the accelerations against differences of our own, the wheels' included."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from support.effects import motion_of
from support.models import TREES, random_tree, robot_of

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.filters.torque_process import TorqueDriven

COUNT = 5
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


def accelerations(robot, motion, k, q=0.0, rates=0.0, forces=0.0):
    """(6 + n,) of state k, moved: by our own articulated-body algorithm, wheels included."""
    dynamics, n = Dynamics(robot), robot.n_joints
    base, motors = np.split(motion.rates[k] + rates, [6])
    state = State(np.zeros(3), UPRIGHT, motion.q[k] + q, base[:3], base[3:], motors)
    force = np.concatenate([np.zeros(6), motion.effort[k]]) + forces
    return dynamics.rate(state.to_vector(), force[6:], force[:6])[7 + n :]


def slope(function, name, size, step):
    """Derivatives by an argument, by differences of order four."""
    columns = []
    for e in step * np.eye(size):
        near, far = (function(**{name: s * e}) - function(**{name: -s * e}) for s in (1.0, 2.0))
        columns.append((8.0 * near - far) / (12.0 * step))
    return np.array(columns).T


def agrees(robot, rng):
    """Derivatives along a motion are differences of accelerations."""
    motion, n = motion_of(robot, rng, COUNT), robot.n_joints
    if not robot.is_free:
        motion.omega, motion.velocity = np.zeros((2, COUNT, 3))
    process = TorqueDriven(robot)
    got, first = process.linearize(motion), process.first
    for k in range(COUNT):
        of = partial(accelerations, robot, motion, k)
        by_q = slope(of, 'q', n, 1e-3)  # wrong by 1e-12 of the fifth derivative
        by_rates = slope(of, 'rates', 6 + n, 0.1)  # accelerations are quadratic in it
        by_forces = slope(of, 'forces', 6 + n, 1.0)  # and linear in forces
        for ours, exact, limit in (
            (got.by_position[k][:, 6 - first :], by_q[first:], 1e-8),
            (got.by_velocity[k], by_rates[first:, first:], 1e-10),
            (got.by_force[k], by_forces[first:], 1e-10),
        ):
            # rounding of accelerations over the step, a thousand operations each
            np.testing.assert_allclose(ours, exact, rtol=0, atol=limit * np.max(np.abs(exact)))
        if robot.is_free:
            np.testing.assert_array_equal(got.by_position[k][:, : 6 - first], 0.0)


@pytest.mark.parametrize('case', TREES.values(), ids=TREES.keys())
def test_derivatives_are_those_of_our_own_accelerations(case, rng):
    parents, prismatic, options = case
    parts = random_tree(rng, parents, prismatic)
    joints = [parts[i].joint for i in 1 + rng.permutation(len(parents))]
    robot = robot_of(parts, joints, **options)
    for joint in robot.joints:
        robot = robot.with_motor_inertia(joint, rng.uniform(0.1, 1.0))
    agrees(robot, rng)


@pytest.mark.parametrize('change', [{'mass': -0.5}, {'mass': 0.0}, {'inertia': -0.1 * np.eye(3)}])
def test_bodies_that_can_not_exist_have_derivatives_too(change, rng):
    parents, prismatic, options = TREES['slides']
    robot = robot_of(random_tree(rng, parents, prismatic), **options)
    agrees(with_body(robot, 2, **change), rng)


def test_a_singular_mass_matrix_is_refused(rng):
    robot = with_body(robot_of(random_tree(rng, [0, 1])), 2, mass=0.0, inertia=np.zeros((3, 3)))
    with pytest.raises(np.linalg.LinAlgError):
        TorqueDriven(robot).linearize(motion_of(robot, rng, COUNT))


def with_body(robot, index, **change):
    bodies = list(robot.bodies)
    bodies[index] = replace(bodies[index], **change)
    return replace(robot, bodies=tuple(bodies))


def test_what_a_motor_gives_of_its_torque_it_gives_of_its_noise(rng):
    """Else a gain near zero on a link of no mass is quiet whatever was measured."""
    parents, prismatic, options = TREES['dual arm']
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
