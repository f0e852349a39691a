"""Minimal parameters: number, rank, what they reproduce, values of the reference study."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.models import AXIS, DUAL_ARM, random_tree, robot_of, table_one

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.estimation.trajectory.reference import Kinematics
from spacerobot_ros.estimation.unknowns.minimal import (
    independent_columns,
    minimal_regressor,
    minimal_set,
)

# Printed in the reference study for axes x, y, y, from an independent implementation.
XYY = {
    'J0xx': 2113.2,
    'J0yy': 4908.4,
    'J0zz': 4540.5,
    'J0xy': -240.6,
    'J0xz': -481.1,
    'J0yz': -245.3,
    'J1xx': 2432.16,
    'J1yy': -2432.06,
    'J2xx': -1676.3,
    'J2yy': 1676.4,
    'J3xx': -355.7,
    'J3yy': 705.7,
    'Q0_2xx': 835.4,
    'Q0_2yx': 415.1,
    'Q0_2zx': 830.2,
    'Q0_3xx': 379.7,
    'Q0_3yx': 188.7,
    'Q0_3zx': 377.4,
    'Q2_3xx': 792.5,
}
TREES = {
    'one joint': ([0], ()),
    'serial 3': ([0, 1, 2], ()),
    'serial 5': ([0, 1, 2, 3, 4], ()),
    'branching': ([0, 1, 1, 2], ()),
    'dual arm': (DUAL_ARM, ()),
    'a slide': ([0], (1,)),
    'slides on slides': ([0, 1, 2], (1, 2)),
    'slides in branches': ([0, 1, 1, 2], (2, 3)),
}


def random_motion(rng, n, count):
    """Any N states."""
    q, qd = rng.uniform(-3.0, 3.0, (2, count, n))
    omega, rotation = rng.standard_normal((count, 3)), Rotation.identity(count)
    return Kinematics(np.arange(count), q, qd, omega, rotation)


def momenta(robot, motion):
    """(N, 3) angular momentum of the bodies in base axes, from the recursions over bodies."""
    still = replace(robot, servicer_wheels=replace(robot.servicer_wheels, momentum=np.zeros(3)))
    dynamics, zero, level = Dynamics(still), np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
    rows = zip(motion.q, motion.omega, motion.qd, strict=True)
    return np.array([dynamics.momentum(State(zero, level, q, zero, w, r))[3:] for q, w, r in rows])


def check_momentum_of(robot, structure, rng):
    """The set has as many parameters as its regressor has rank, and tells the momentum."""
    found = minimal_set(robot, structure)
    motion = random_motion(rng, robot.n_joints, 2 * len(found))
    regressor = minimal_regressor(found, motion)
    unit = regressor.reshape(-1, len(found)) / np.linalg.norm(regressor, axis=(0, 1))
    assert np.linalg.cond(unit) < 1e4  # 10 to 100; as large as 1e16 with one too many
    want = momenta(robot, motion)
    got = regressor @ found.of_robot(robot)
    # rounding, and least squares of a well-conditioned regressor: 1e-14
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-11 * np.max(np.abs(want)))
    return found


@pytest.mark.parametrize(
    ('axes', 'structure', 'k'),
    [
        ('zyx', 'symmetric', 19),
        ('xyy', 'symmetric', 19),
        ('xyz', 'symmetric', 19),
        ('zyy', 'symmetric', 24),
        ('zyz', 'symmetric', 24),
        ('zzz', 'symmetric', 24),
        ('xxx', 'symmetric', 12),
        ('zyx', 'generic', 45),
        ('xyy', 'generic', 45),
        ('zyy', 'generic', 45),
        ('zzz', 'generic', 45),
    ],
)
def test_number_of_parameters_of_table_one(axes, structure, k):
    found = minimal_set(robot_of(table_one(axes)), structure)
    assert len(found) == len(found.names) == k


@pytest.mark.parametrize('slides', [(), (2,), (1, 3)], ids=['turning', 'one slides', 'two slide'])
@pytest.mark.parametrize('axes', ['zyx', 'xyy', 'zyy', 'zzz'])
def test_parameters_of_table_one_tell_the_momentum(axes, slides, rng):
    parts = table_one(axes)
    for index in slides:
        parts[index] = replace(parts[index], kind='prismatic')
    generic, symmetric = (
        check_momentum_of(robot_of(parts), structure, rng)
        for structure in ('generic', 'symmetric')
    )
    assert len(symmetric) < len(generic)


@pytest.mark.parametrize('is_parallel', [False, True], ids=['oblique axes', 'parallel axes'])
@pytest.mark.parametrize('kind', TREES.values(), ids=TREES.keys())
def test_any_tree(kind, is_parallel, rng):
    parts = random_tree(rng, *kind)
    if is_parallel:
        parts = [replace(part, axis=AXIS['z'], rpy=(0.0, 0.0, 0.0)) for part in parts]
    joints = [parts[i].joint for i in 1 + rng.permutation(len(parts) - 1)]
    robot = robot_of(parts, joints)
    generic = check_momentum_of(robot, 'generic', rng)
    vectors = 3 + 2 * len(parts[1:]) - len(kind[1])
    assert len(generic) == vectors * (vectors + 1) // 2
    # without zeros there is nothing to assume, and a rank search among more entries finds as many,
    # so no other combination can be told either
    assert len(check_momentum_of(robot, 'symmetric', rng)) == len(generic)


def test_thirty_joints_in_a_row(rng):
    robot = robot_of(random_tree(rng, list(range(30))))
    found, motion = minimal_set(robot, 'generic'), random_motion(rng, 30, 3)
    assert len(found) == 32 * 63
    got, want = (
        minimal_regressor(found, motion) @ found.of_robot(robot),
        momenta(robot, motion),
    )
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-11 * np.max(np.abs(want)))


def test_stacked_bodies(rng):
    robot = robot_of(random_tree(rng, [0, 1], prismatic=(2,)))
    found, factors = minimal_set(robot, 'generic'), rng.uniform(0.5, 2.0, (3, 50))
    stacked = [np.array([getattr(b, part) for b in robot.bodies]) for part in PARTS]
    stacked = [factors.reshape(3, 50, *np.ones(x.ndim, dtype=int)) * x for x in stacked]
    got = found.of_bodies(*stacked)
    for place in np.ndindex(3, 50):
        one = found.of_bodies(*(x[place] for x in stacked))
        np.testing.assert_allclose(got[place], one, rtol=1e-12, atol=1e-12)


PARTS = 'mass', 'com', 'inertia'


def test_values_of_the_reference_study():
    robot = robot_of(table_one('xyy'))
    found = minimal_set(robot, 'symmetric')
    assert minimal_set(robot, 'symmetric') is found  # a controller asks with every estimate
    values = found.of_robot(robot)
    assert found.names == tuple(XYY)
    # printed with one decimal, two entries with two
    np.testing.assert_allclose(values, list(XYY.values()), rtol=0, atol=0.0501)


def test_dependence_on_the_structure_only():
    # Other numbers with the same zeros give the same set to the last bit.
    robot = robot_of(table_one('zyx'))
    scaled = robot.with_inertial_parameters(robot.inertial_parameters * 3.0)
    one, two = minimal_set(robot, 'symmetric'), minimal_set(scaled, 'symmetric')
    assert one.names == two.names
    np.testing.assert_array_equal(one.of_robot(robot), two.of_robot(robot))
    np.testing.assert_array_equal(one.expansion, two.expansion)


def test_only_independent_columns_are_kept(rng):
    basis = rng.standard_normal((30, 3))
    columns = np.column_stack(
        [np.zeros(30), basis[:, 0], 2.0 * basis[:, 0], basis[:, 1], basis @ [1.0, -2.0, 0.0]]
    )
    norms = np.linalg.norm(columns, axis=0)
    assert independent_columns(columns / np.where(norms > 0.0, norms, 1.0)) == [1, 3]
