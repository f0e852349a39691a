"""Momentum, energy and momentum maps against sums over bodies from first principles."""

from __future__ import annotations

import numpy as np
import pytest
from support.models import (
    DUAL_ARM,
    H_BASE,
    H_TARGET,
    WHEEL_SPIN,
    momentum_and_energy,
    quaternion_matrix,
    random_tree,
    robot_of,
    settings_of,
    table_one,
    wheel_joints,
    with_wheels,
)
from support.states import motion_of, random_state

from spacerobot_ros.dynamics.equations import Dynamics, without_translation
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.simulation.truth import true_robot

RELATIVE = 1e-13  # sums of at most a few hundred products

TREES = {
    'one joint': ([0], ()),
    'serial 3': ([0, 1, 2], ()),
    'serial 5': ([0, 1, 2, 3, 4], ()),
    'star': ([0, 0, 0], ()),
    'dual arm': (DUAL_ARM, ()),
    'branching arm': ([0, 1, 1, 3, 2], ()),
    'slides': ([0, 1, 2, 0], (2, 4)),
}


@pytest.fixture(params=TREES.values(), ids=TREES.keys())
def tree(request, rng):
    """Return a random tree and its robot, joints listed in a random order."""
    parents, prismatic = request.param
    parts = random_tree(rng, parents, prismatic)
    joints = [parts[i].joint for i in 1 + rng.permutation(len(parents))]
    return parts, robot_of(parts, joints)


def test_momentum_and_energy_of_any_tree(tree, rng):
    parts, robot = tree
    dynamics = Dynamics(robot)
    for _ in range(20):
        state = random_state(rng, robot.n_joints)
        P, h, T = momentum_and_energy(parts, motion_of(state, robot.joints))
        total = dynamics.momentum(state)
        np.testing.assert_allclose(total[:3], P, rtol=0, atol=RELATIVE * 1e3)
        np.testing.assert_allclose(total[3:], h, rtol=0, atol=RELATIVE * 1e3)
        assert dynamics.energy(state)[0] == pytest.approx(T, rel=RELATIVE)


def test_maps_are_the_derivatives_of_momentum(tree, rng):
    # With the centre of mass anywhere, momentum about it is linear in [omega; qd]: unit rates give
    # the columns exactly.
    parts, robot = tree
    dynamics, n = Dynamics(robot), robot.n_joints
    q, zero = rng.uniform(-3.0, 3.0, n), np.zeros(3)
    columns = []
    for unit in np.eye(3 + n):
        state = State(zero, np.array([0.0, 0.0, 0.0, 1.0]), q, zero, unit[:3], unit[3:])
        columns.append(momentum_and_energy(parts, motion_of(state, robot.joints))[1])
    maps = without_translation(dynamics.mass_matrix(q))[:3]
    np.testing.assert_allclose(maps, np.array(columns).T, rtol=0, atol=1e-11)


def test_dqq_is_the_kinetic_energy_about_the_centre_of_mass(tree, rng):
    parts, robot = tree
    dynamics, n = Dynamics(robot), robot.n_joints
    total = sum(part.mass for part in parts)
    for _ in range(10):
        state = random_state(rng, n)
        P, _, T = momentum_and_energy(parts, motion_of(state, robot.joints))
        u = np.concatenate([state.omega_WB_B, state.qd])
        energy = 0.5 * u @ without_translation(dynamics.mass_matrix(state.q)) @ u
        assert energy == pytest.approx(T - P @ P / (2.0 * total), rel=1e-12)


def test_centre_of_mass_at_rest(tree, rng):
    parts, robot = tree
    state = Dynamics(robot).at_rest_centre(random_state(rng, robot.n_joints))
    P, _, _ = momentum_and_energy(parts, motion_of(state, robot.joints))
    np.testing.assert_allclose(P, 0.0, rtol=0, atol=1e-12)  # of terms of order 1e2


def test_gyrostats_add_their_momentum_turned_into_the_inertial_frame(rng):
    parts = table_one()
    robot = robot_of(
        parts,
        servicer_wheels={'momentum': list(H_BASE)},
        target_wheels={'links': ['link_3'], 'momentum': list(H_TARGET)},
    )
    bare = Dynamics(robot_of(parts))
    for _ in range(20):
        state = random_state(rng, 3)
        R_0 = quaternion_matrix(state.q_WB_xyzw)
        z, y, x = state.q
        c, s = np.cos, np.sin
        R_3 = (
            np.array([[c(z), -s(z), 0.0], [s(z), c(z), 0.0], [0.0, 0.0, 1.0]])
            @ np.array([[c(y), 0.0, s(y)], [0.0, 1.0, 0.0], [-s(y), 0.0, c(y)]])
            @ np.array([[1.0, 0.0, 0.0], [0.0, c(x), -s(x)], [0.0, s(x), c(x)]])
        )
        added = Dynamics(robot).momentum(state) - bare.momentum(state)
        expected = R_0 @ (H_BASE + R_3 @ H_TARGET)
        np.testing.assert_allclose(
            added, [0.0, 0.0, 0.0, *expected], rtol=0, atol=1e-10
        )  # of 1e4 N m s


def test_rotors_and_gyrostats_have_the_same_momentum(rng):
    # Rotors at relative rate h / I carry the momentum h of the gyrostat, whatever the host does.
    parts = with_wheels(table_one())
    wheels = {
        'servicer_wheels': {'joints': wheel_joints(0), 'rates': list(H_BASE / WHEEL_SPIN)},
        'target_wheels': {'joints': wheel_joints(3), 'rates': list(H_TARGET / WHEEL_SPIN)},
    }
    robot = robot_of(parts, **wheels)
    plant = true_robot(robot, settings_of(parts, **wheels))
    for _ in range(20):
        s = random_state(rng, 3)
        angles = rng.uniform(-3.0, 3.0, 6)
        full = State(
            s.p_WB,
            s.q_WB_xyzw,
            np.append(s.q, angles),
            s.v_WB_B,
            s.omega_WB_B,
            np.append(s.qd, plant.rotor_rates),
        )
        _, h, _ = momentum_and_energy(parts, motion_of(full, plant.joints))
        # 1e4 N m s
        np.testing.assert_allclose(Dynamics(plant).momentum(full)[3:], h, rtol=0, atol=1e-10)
        np.testing.assert_allclose(Dynamics(robot).momentum(s)[3:], h, rtol=0, atol=1e-10)
