"""The matrix W of free-floating dynamics against Pinocchio and against sums over the bodies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from support.models import AXIS, DUAL_ARM, Motion, momentum_and_energy, random_tree, robot_of

from spacerobot_ros.dynamics.blocks import BlockTree
from spacerobot_ros.errors import ConfigurationError

RELATIVE = 1e-12  # the requirement; rounding alone gives 1e-15 to 1e-14
TREES = {
    'one joint': ([0], ()),
    'serial 3': ([0, 1, 2], ()),
    'branching': ([0, 1, 2, 1, 4], ()),  # depth first, as Pinocchio needs it
    'dual arm': (DUAL_ARM, ()),
    'a slide': ([0], (1,)),
    'slides on slides': ([0, 1, 2], (1, 2)),
    'slides in branches': ([0, 1, 2, 1, 4], (2, 4)),
}


@pytest.fixture(params=TREES.values(), ids=TREES.keys())
def machine(request, rng):
    """Return random parts with oblique axes, and their robot with joints in a random order."""
    parts = random_tree(rng, *request.param)
    joints = [parts[i].joint for i in 1 + rng.permutation(len(parts) - 1)]
    return parts, robot_of(parts, joints)


@pytest.fixture(params=[False, True], ids=['two axes a body', 'three'])
def tree(request, machine):
    return BlockTree(machine[1], whole=request.param)


def close(got, want, relative=RELATIVE):
    """Compare, the tolerance relative to the largest entry."""
    np.testing.assert_allclose(got, want, rtol=0, atol=relative * np.max(np.abs(want)))


def entries_of(tree, robot):
    bodies = robot.bodies
    return tree.entries(*(np.array([getattr(b, p) for b in bodies]) for p in PARTS))


PARTS = 'mass', 'com', 'inertia'


def states(rng, n, count=20):
    """Joint positions beyond a whole turn and rates about 1 rad/s."""
    return rng.uniform(-4.0, 4.0, (count, n)), rng.standard_normal((count, 3 + n))


def test_regressor_is_the_sum_of_momenta_over_the_bodies(machine, tree, rng):
    parts, robot = machine
    q, u = states(rng, robot.n_joints)
    want = []
    for position, rates in zip(q, u, strict=True):
        joints, zero = robot.joints, np.zeros(3)
        by_name = (dict(zip(joints, x, strict=True)) for x in (position, rates[3:]))
        want.append(momentum_and_energy(parts, Motion(np.eye(3), zero, rates[:3], zero, *by_name)))
    close(tree.regressor(q, u) @ entries_of(tree, robot), [momentum for _, momentum, _ in want])


def pinocchio(robot):
    """Return Pinocchio's model of the robot's bodies, parents first, without gravity."""
    model, numbers = pin.Model(), []
    model.gravity.setZero()
    for body in robot.bodies:
        kind = pin.JointModelFreeFlyer()
        if numbers:
            slides = body.is_prismatic
            kind = pin.JointModelPrismaticUnaligned if slides else pin.JointModelRevoluteUnaligned
            kind = kind(body.axis)
        parent = numbers[body.parent] if numbers else 0
        placed = pin.SE3(body.rotation, body.translation)
        numbers.append(model.addJoint(parent, kind, placed, body.name))
        model.appendBodyToJoint(numbers[-1], pin.Inertia(*body.solid), pin.SE3.Identity())
    return model, model.createData()


@pytest.mark.parametrize('whole', [False, True])
@pytest.mark.parametrize('kind', TREES.values(), ids=TREES.keys())
def test_equation_is_that_of_pinocchio_with_the_translation_eliminated(kind, whole, rng):
    robot = robot_of(random_tree(rng, *kind))
    n, tree, (model, data) = robot.n_joints, BlockTree(robot, whole=whole), pinocchio(robot)
    wheels, W = rng.standard_normal((n + 1, 3)), tree.matrix(entries_of(tree, robot))
    q, u = states(rng, n, 5)
    got, printed = (tree.equation(q, u, W, wheels, reaction) for reaction in (True, False))
    for k in range(len(q)):
        v = np.concatenate([rng.standard_normal(3), u[k]])  # the base's velocity does not matter
        place = np.concatenate([np.zeros(6), [1.0], q[k]])
        rows = np.empty((6 + n, 7 + n))
        M = pin.crba(model, data, place)
        rows[:, :-1] = np.triu(M) + np.triu(M, 1).T
        rows[:, -1] = pin.nonLinearEffects(model, data, place, v)
        want = rows[3:, 3:] - rows[3:, :3] @ rows[:3, 3:] / M[0, 0]
        for body in range(n + 1):  # virtual power of the wheels' torque
            turning = pin.computeJointJacobian(model, data, place, body + 1)[3:]
            want[:, -1] += (turning.T @ np.cross(turning @ v, wheels[body]))[3:]
        close(got[k], want)
        # as the paper prints it: wheels load the base alone
        without = (rows[3:, -1] - rows[3:, :3] @ rows[:3, -1] / M[0, 0])[3:]
        close(printed[k], np.column_stack([want[:, :-1], [*want[:3, -1], *without]]))


def test_base_rows_of_the_inertia_are_the_regressor(machine, tree, rng):
    x = rng.standard_normal(len(tree.pairs))  # any numbers: both are linear in them
    n = machine[1].n_joints
    q, u = states(rng, n)
    M = tree.equation(q, u, tree.matrix(x), np.zeros((n + 1, 3)))[..., :-1]
    close(tree.regressor(q, u) @ x, (M[:, :3] @ u[..., None])[..., 0])


def test_names_say_whose_vectors_they_are_and_which_slide(rng):
    parts = random_tree(rng, [0, 1, 2], prismatic=(2,))
    parts[1:] = [replace(part, axis=axis) for part, axis in zip(parts[1:], AXES, strict=True)]
    tree = BlockTree(robot_of(parts))
    units = dict(zip(tree.names, tree.units, strict=True))
    assert tree.names[:6] == ('J0xx', 'J0yy', 'J0zz', 'J0xy', 'J0xz', 'J0yz')
    assert tree.names[6:13] == ('S1xx', 'S1yy', 'S1xy', 'S2ss', 'S3zz', 'S3vv', 'S3zv')
    assert tree.names[-4:] == ('Q1_3yz', 'Q1_3yv', 'Q2_3sz', 'Q2_3sv')
    assert (units['J0xy'], units['Q0_2xs'], units['S2ss']) == ('kg m^2', 'kg m', 'kg')
    assert len(units) == len(tree.pairs) == 8 * 9 // 2


AXES = -AXIS['z'], AXIS['x'], np.array([0.6, 0.8, 0.0])


def test_fixed_base_is_refused(rng):
    robot = robot_of(random_tree(rng, [0, 1]), base='fixed')
    with pytest.raises(ConfigurationError, match=r'robot\.base: .*free base'):
        BlockTree(robot)
