"""Minimal parameters: number, rank gap, what they reproduce, values of the reference study."""

from __future__ import annotations

import numpy as np
import pytest
from support.identification import inertia_of, joint_names
from support.models import DUAL_ARM, random_tree, robot_of, table_one

from spacerobot_ros.dynamics.blocks import BlockTree
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.estimation.unknowns.minimal import independent_columns, minimal_set

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
    'one joint': [0],
    'serial 2': [0, 1],
    'serial 3': [0, 1, 2],
    'serial 4': [0, 1, 2, 3],
    'serial 5': [0, 1, 2, 3, 4],
    'branching': [0, 1, 1, 2],
    'dual arm': DUAL_ARM,
}


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
    assert found.rank_gap > 1e10


@pytest.mark.parametrize('parents', TREES.values(), ids=TREES.keys())
def test_number_of_parameters_of_a_generic_tree(parents, rng):
    n = len(parents)
    parts = random_tree(rng, parents)
    joints = [parts[i].joint for i in 1 + rng.permutation(n)]
    found = minimal_set(robot_of(parts, joints), 'generic')
    assert len(found) == (n + 2) * (2 * n + 3)
    assert found.rank_gap > 1e10


def test_a_robot_without_zeros_has_nothing_to_assume(rng):
    robot = robot_of(random_tree(rng, [0, 1, 2]))
    assert len(minimal_set(robot, 'symmetric')) == len(minimal_set(robot, 'generic')) == 45


@pytest.mark.parametrize('structure', ['symmetric', 'generic'])
@pytest.mark.parametrize('axes', ['zyx', 'xyy', 'zyy'])
def test_expanded_parameters_have_the_true_momentum_and_inertia(axes, structure, rng):
    parts = table_one(axes)
    robot = robot_of(parts)
    tree, found = BlockTree(robot), minimal_set(robot, structure)
    pi = found.expansion @ (found.regrouping @ tree.parameters())
    q = rng.uniform(-3.0, 3.0, (20, 3))
    rotations = tree.rotations(q)
    got = tree.inertia(rotations, tree.rate_maps(rotations), pi)
    want = np.array([inertia_of(parts, joint_names(parts), x) for x in q])
    # least squares of a well-conditioned regressor: 1e-14, and the requirement of the dynamics
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-11 * np.max(np.abs(want)))


@pytest.mark.parametrize('parents', TREES.values(), ids=TREES.keys())
def test_expanded_parameters_of_a_generic_tree(parents, rng):
    parts = random_tree(rng, parents)
    robot = robot_of(parts)
    tree, found = BlockTree(robot), minimal_set(robot, 'generic')
    pi = found.expansion @ (found.regrouping @ tree.parameters())
    q = rng.uniform(-3.0, 3.0, (10, len(parents)))
    rotations = tree.rotations(q)
    got = tree.inertia(rotations, tree.rate_maps(rotations), pi)
    want = np.array([inertia_of(parts, joint_names(parts), x) for x in q])
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-11 * np.max(np.abs(want)))


@pytest.mark.parametrize('structure', ['symmetric', 'generic'])
def test_regrouping_inverts_the_expansion(structure):
    found = minimal_set(robot_of(table_one('zyx')), structure)
    np.testing.assert_allclose(
        found.regrouping @ found.expansion, np.eye(len(found)), rtol=0, atol=1e-12
    )


def test_values_of_the_reference_study():
    robot = robot_of(table_one('xyy'))
    found = minimal_set(robot, 'symmetric')
    assert minimal_set(robot, 'symmetric') is found  # a controller asks with every estimate
    values = found.regrouping @ BlockTree(robot).parameters()
    assert found.names == tuple(XYY)
    # printed with one decimal, two entries with two
    np.testing.assert_allclose(values, list(XYY.values()), rtol=0, atol=0.0501)


def test_dependence_on_the_structure_only():
    # Other numbers with the same zeros give the same set to the last bit.
    robot = robot_of(table_one('zyx'))
    scaled = robot.with_inertial_parameters(robot.inertial_parameters * 3.0)
    one, two = minimal_set(robot, 'symmetric'), minimal_set(scaled, 'symmetric')
    assert one.names == two.names
    np.testing.assert_array_equal(one.expansion, two.expansion)
    np.testing.assert_array_equal(one.regrouping, two.regrouping)


def test_only_independent_columns_are_kept(rng):
    basis = rng.standard_normal((30, 3))
    columns = np.column_stack(
        [np.zeros(30), basis[:, 0], 2.0 * basis[:, 0], basis[:, 1], basis @ [1.0, -2.0, 0.0]]
    )
    norms = np.linalg.norm(columns, axis=0)
    assert independent_columns(columns / np.where(norms > 0.0, norms, 1.0)) == [1, 3]


def test_prismatic_joint_is_refused(rng):
    robot = robot_of(random_tree(rng, [0, 1], prismatic=(1,)))
    with pytest.raises(ConfigurationError, match='revolute'):
        minimal_set(robot, 'generic')
