"""Angular momentum about the centre of mass and its derivatives, against sums over the bodies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.identification import inertia_of, place
from support.models import DUAL_ARM, Motion, momentum_and_energy, random_tree, robot_of

from spacerobot_ros.dynamics.angular_momentum import AngularMomentum, angular_momentum
from spacerobot_ros.dynamics.tree import tree_of

STEP = 1e-5
# Central differences: STEP^2 and rounding 1e-16 / STEP, of momenta of order a hundred.
SLOPE = 1e-7
COUNT = 4
TREES = {
    'one joint': ([0], ()),
    'serial 4': ([0, 1, 2, 3], ()),
    'branching': ([0, 1, 1, 2], ()),
    'dual arm': (DUAL_ARM, ()),
    'a slide': ([0], (1,)),
    'slides on slides': ([0, 1, 2], (1, 2)),
    'slides in branches': ([0, 1, 1, 2, 0], (2, 3, 5)),
}


@pytest.fixture(params=TREES.values(), ids=TREES.keys())
def case(request, rng):
    """Return parts, joints in another order than theirs, and states."""
    parts = random_tree(rng, *request.param)
    joints = tuple(parts[i].joint for i in 1 + rng.permutation(len(parts) - 1))
    n = len(joints)
    q, qd = rng.uniform(-2.0, 2.0, (2, COUNT, n))
    return parts, joints, q, rng.standard_normal((COUNT, 3)), qd


def of(parts, joints, q, omega, qd):
    """The product's, of a robot of these parts."""
    robot = robot_of(parts, list(joints))
    return AngularMomentum(*angular_momentum(tree_of(robot), q, omega, qd)), robot


def summed(parts, joints, q, omega, qd):
    """(N, 3) momentum summed over the bodies, the base's frame that of reference."""

    def one(q, omega, qd):
        names = dict(zip(joints, q, strict=True)), dict(zip(joints, qd, strict=True))
        drift = np.array([0.3, -2.0, 1.0])  # of the base: angular momentum is not about it
        motion = Motion(np.eye(3), np.zeros(3), omega, drift, *names)
        return momentum_and_energy(parts, motion)[1]

    return np.array([one(*each) for each in zip(q, omega, qd, strict=True)])


def test_momentum_and_inertia_are_sums_over_the_bodies(case):
    parts, joints, q, omega, qd = case
    got, _ = of(*case)
    want = summed(*case)
    scale = np.max(np.abs(want))  # rounding
    np.testing.assert_allclose(got.momentum, want, rtol=0, atol=1e-13 * scale)
    inertia = inertia_of(parts, joints, q)[:, :3]
    np.testing.assert_allclose(got.inertia, inertia, rtol=0, atol=1e-13 * np.max(np.abs(inertia)))
    rates = np.hstack([omega, qd])
    np.testing.assert_allclose(
        np.einsum('nij,nj->ni', got.inertia, rates), want, rtol=0, atol=1e-12 * scale
    )


def test_derivatives_by_the_joints(case):
    parts, joints, q, omega, qd = case
    got, _ = of(*case)
    for j, step in enumerate(STEP * np.eye(len(joints))):
        ahead, behind = (summed(parts, joints, q + s * step, omega, qd) for s in (1.0, -1.0))
        want = (ahead - behind) / (2.0 * STEP)
        scale = 1.0 + np.max(np.abs(want))
        np.testing.assert_allclose(got.by_joints[..., j], want, rtol=0, atol=SLOPE * scale)


NUMBERS = 10
_ENTRY = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))


def shifted(part, number, size):
    """A part whose m, m c (3) or inertia about its origin (6) is larger by a size."""
    square = np.dot(part.com, part.com) * np.eye(3) - np.outer(part.com, part.com)
    mass, first, moments = part.mass, part.mass * part.com, part.inertia + part.mass * square
    if number == 0:
        mass = mass + size
    elif number < 4:
        first = first + size * np.eye(3)[number - 1]
    else:
        i, j = _ENTRY[number - 4]
        moments = moments.copy()
        moments[i, j] += size
        moments[j, i] = moments[i, j]
    com = first / mass
    about = moments - mass * (np.dot(com, com) * np.eye(3) - np.outer(com, com))
    return replace(part, mass=mass, com=com, inertia=about)


def test_derivatives_by_the_bodies(case):
    parts, joints, q, omega, qd = case
    got, robot = of(*case)
    names = [body.name for body in robot.bodies]
    for k, part in enumerate(parts):
        for number in range(NUMBERS):
            moved = [
                summed(
                    [shifted(p, number, s * STEP) if p is part else p for p in parts],
                    joints, q, omega, qd,
                )
                for s in (1.0, -1.0)
            ]  # fmt: skip
            want = (moved[0] - moved[1]) / (2.0 * STEP)
            column = 10 * names.index(parts[k].name) + number
            scale = 1.0 + np.max(np.abs(want))
            np.testing.assert_allclose(
                got.by_bodies[..., column], want, rtol=0, atol=SLOPE * scale
            )


def test_frames_and_axes(case):
    parts, joints, q, _, _ = case
    got, robot = of(*case)
    tree = place(parts, joints, q)
    names = [part.name for part in parts]
    for i, body in enumerate(robot.bodies):
        k = names.index(body.name)
        np.testing.assert_allclose(got.rotations[:, i], tree.rotations[:, k], rtol=0, atol=1e-13)
        # of a turning joint, the column of the rate of its own body
    for j, joint in enumerate(joints):
        k = next(i for i, part in enumerate(parts) if i and part.joint == joint)
        np.testing.assert_allclose(
            got.axes[:, j], tree.angular[:, k, :, 3 + j], rtol=0, atol=1e-13
        )
