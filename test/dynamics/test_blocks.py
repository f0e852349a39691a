"""Block parameters against Pinocchio's centroidal momentum and against sums over the bodies."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from support.identification import carried, inertia_of
from support.models import DUAL_ARM, random_tree, robot_of, to_urdf

from spacerobot_ros.dynamics.blocks import BlockTree
from spacerobot_ros.errors import ConfigurationError

RELATIVE = 1e-12  # the requirement; rounding alone gives 1e-15 to 1e-14
TREES = {
    'one joint': [0],
    'serial 2': [0, 1],
    'serial 3': [0, 1, 2],
    'serial 4': [0, 1, 2, 3],
    'serial 5': [0, 1, 2, 3, 4],
    'star': [0, 0, 0],
    'branching': [0, 1, 1, 3, 2],
    'dual arm': DUAL_ARM,
}


@pytest.fixture(params=TREES.values(), ids=TREES.keys())
def tree(request, rng):
    """Return random parts, their joints in a random order, and the product's tree."""
    parts = random_tree(rng, request.param)
    joints = tuple(parts[i].joint for i in 1 + rng.permutation(len(request.param)))
    return parts, joints, BlockTree(robot_of(parts, list(joints)))


def close(got, want, relative=RELATIVE):
    """Compare, the tolerance relative to the largest entry."""
    np.testing.assert_allclose(got, want, rtol=0, atol=relative * np.max(np.abs(want)))


def states(rng, n, count=20):
    """Joint positions beyond a whole turn and rates about 1 rad/s."""
    return rng.uniform(-4.0, 4.0, (count, n)), rng.standard_normal((count, 3 + n))


def maps_at(blocks, q):
    rotations = blocks.rotations(q)
    return rotations, blocks.rate_maps(rotations)


def centroidal_momentum(parts, joints, q, u):
    """Angular momentum about the centre of mass in base axes, by Pinocchio from the URDF."""
    model = pin.buildModelFromXML(to_urdf(parts), pin.JointModelFreeFlyer())
    data = model.createData()
    q_pin, v_pin = pin.neutral(model), np.zeros(model.nv)
    v_pin[3:6] = u[:3]  # the base's velocity does not matter about the centre of mass
    for j, name in enumerate(joints):
        joint = model.joints[model.getJointId(name)]
        v_pin[joint.idx_v] = u[3 + j]
        if joint.nq == 2:  # unbounded joints are held as cosine and sine
            q_pin[joint.idx_q : joint.idx_q + 2] = np.cos(q[j]), np.sin(q[j])
        else:
            q_pin[joint.idx_q] = q[j]
    return np.array(pin.computeCentroidalMomentum(model, data, q_pin, v_pin).angular)


def test_regressor_is_the_centroidal_momentum_of_pinocchio(tree, rng):
    parts, joints, blocks = tree
    pi = blocks.parameters()
    q, u = states(rng, blocks.n)
    got = blocks.regressor(*maps_at(blocks, q), u) @ pi
    close(got, [centroidal_momentum(parts, joints, *state) for state in zip(q, u, strict=True)])


def test_inertia_is_the_sum_over_the_bodies(tree, rng):
    parts, joints, blocks = tree
    q, _ = states(rng, blocks.n)
    got = blocks.inertia(*maps_at(blocks, q), blocks.parameters())
    close(got, [inertia_of(parts, joints, position) for position in q])


def test_inertia_is_the_mass_matrix_of_pinocchio_with_the_translation_eliminated(rng):
    parts = random_tree(rng, DUAL_ARM)
    joints = tuple(part.joint for part in parts[1:])
    blocks = BlockTree(robot_of(parts, list(joints)))
    urdf = to_urdf(parts).replace('"continuous"', '"revolute"')  # one number a joint
    limits = '<limit lower="-9" upper="9" effort="1" velocity="1"/></joint>'
    model = pin.buildModelFromXML(urdf.replace('</joint>', limits), pin.JointModelFreeFlyer())
    data = model.createData()
    order = [model.joints[model.getJointId(name)].idx_v for name in joints]
    q, _ = states(rng, 6, 5)
    for position in q:
        q_pin = pin.neutral(model)
        q_pin[1 + np.array(order)] = position
        M = pin.crba(model, data, q_pin)
        M = np.triu(M) + np.triu(M, 1).T
        M = M[np.ix_([*range(6), *order], [*range(6), *order])]
        want = M[3:, 3:] - M[3:, :3] @ np.linalg.solve(M[:3, :3], M[:3, 3:])
        got = blocks.inertia(*maps_at(blocks, position[None]), blocks.parameters())[0]
        close(got, want)


def test_base_rows_of_the_inertia_are_the_regressor(tree, rng):
    _, _, blocks = tree
    pi = rng.standard_normal(len(blocks.names))  # any numbers: both are linear in them
    q, u = states(rng, blocks.n)
    maps = maps_at(blocks, q)
    momentum = np.einsum('nab,nb->na', blocks.inertia(*maps, pi)[:, :3], u)
    close(blocks.regressor(*maps, u) @ pi, momentum)


def test_inertia_is_linear_and_symmetric(tree, rng):
    _, _, blocks = tree
    one, two = rng.standard_normal((2, len(blocks.names)))
    maps = maps_at(blocks, states(rng, blocks.n)[0])
    combined = 2.0 * blocks.inertia(*maps, one) - 3.0 * blocks.inertia(*maps, two)
    close(blocks.inertia(*maps, 2.0 * one - 3.0 * two), combined)
    close(combined, np.swapaxes(combined, 1, 2))


def gradient_of(blocks, q, pi):
    """Inertia and its (N, n, 3+n, 3+n) derivatives, a column for each unit vector."""
    units = np.eye(3 + blocks.n)
    maps = maps_at(blocks, q)
    parts = [blocks.inertia_turned(*maps, pi, np.tile(unit, (len(q), 1))) for unit in units]
    return parts[0][0], np.stack([columns for _, columns in parts], axis=-1)


def test_gradient_against_central_differences_of_the_sum_over_the_bodies(tree, rng):
    parts, joints, blocks = tree
    q, _ = states(rng, blocks.n, 4)
    value, gradient = gradient_of(blocks, q, blocks.parameters())
    close(value, [inertia_of(parts, joints, position) for position in q])
    step = 1e-3
    for k, position in enumerate(q):
        for j in range(blocks.n):

            def at(factor, position=position, j=j):
                moved = position.copy()
                moved[j] += factor * step
                return inertia_of(parts, joints, moved)

            # six-point stencil, error of order step^6 = 1e-18, rounding 1e-13
            slope = (45.0 * (at(1) - at(-1)) - 9.0 * (at(2) - at(-2)) + (at(3) - at(-3))) / (
                60.0 * step
            )
            scale = np.max(np.abs(value[k]))
            np.testing.assert_allclose(gradient[k, j], slope, rtol=0, atol=2e-12 * scale)


def test_gradient_for_numbers_that_no_body_has(tree, rng):
    _, _, blocks = tree
    pi = rng.standard_normal(len(blocks.names))
    q, _ = states(rng, blocks.n, 4)
    _, gradient = gradient_of(blocks, q, pi)
    step = 1e-5
    for j in range(blocks.n):
        shift = step * np.eye(blocks.n)[j]
        ahead, behind = (blocks.inertia(*maps_at(blocks, x), pi) for x in (q + shift, q - shift))
        slope = (ahead - behind) / (2.0 * step)
        # central differences: step^2 = 1e-10 and rounding 1e-11 of numbers of order ten
        np.testing.assert_allclose(gradient[:, j], slope, rtol=0, atol=3e-9)


def test_rotations_follow_origins_axes_and_order(tree, rng):
    parts, joints, blocks = tree
    q, _ = states(rng, blocks.n, 3)
    got = blocks.rotations(q)
    for k, position in enumerate(q):
        for j, name in enumerate(joints):
            body = [part.joint for part in parts].index(name)
            np.testing.assert_allclose(
                got[k, j + 1], carried(parts, joints, position, body), rtol=0, atol=1e-14
            )


def test_names_fit_the_parameters(tree):
    _, _, blocks = tree
    n = blocks.n
    assert len(blocks.names) == len(set(blocks.names)) == 6 * (n + 1) + 9 * n * (n + 1) // 2
    assert len(blocks.parameters()) == len(blocks.names)
    assert blocks.names[:6] == ('J0xx', 'J0yy', 'J0zz', 'J0xy', 'J0xz', 'J0yz')
    assert blocks.names[6 * (n + 1)] == 'Q0_1xx'


def test_parameters_of_another_robot_with_the_same_tree(rng):
    parts, other = (random_tree(np.random.default_rng(seed), [0, 1]) for seed in (1, 1))
    other = [*other[:2], type(other[2])(**{**vars(other[2]), 'mass': 99.0})]
    blocks = BlockTree(robot_of(parts))
    close(blocks.parameters(robot_of(other)), BlockTree(robot_of(other)).parameters())


def test_prismatic_joint_is_refused(rng):
    robot = robot_of(random_tree(rng, [0, 1, 2], prismatic=(2,)))
    with pytest.raises(ConfigurationError, match=r"joint 'j_link_2'.*revolute"):
        BlockTree(robot)


def test_fixed_base_is_refused(rng):
    robot = robot_of(random_tree(rng, [0, 1]), base='fixed')
    with pytest.raises(ConfigurationError, match=r'robot\.base: .*free base'):
        BlockTree(robot)
