"""The momentum equation about any bodies, against finite differences of sums over them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.identification import carried, inertia_of, servicer
from support.models import DUAL_ARM, random_tree, robot_of, table_one

from spacerobot_ros.estimation.filters import momentum_process
from spacerobot_ros.estimation.filters.momentum_process import MomentumModel
from spacerobot_ros.estimation.trajectory.reference import Kinematics

STEP = 1e-5
# Central differences: STEP^2 = 1e-10, rounding 1e-16 / STEP = 1e-11, derivatives of order ten.
SLOPE = 3e-8


NUMBERS = 'mass', 'com', 'inertia'


class Truth:
    """Body rate solved directly: w = D^-1 (R^T h_W - h0 - sum R_b h_b - Dq q')."""

    def __init__(self, parts, robot):
        self.parts, self.robot = parts, robot
        names = [part.name for part in parts]
        self.carriers = [names.index(g.link) for g in robot.target_wheels]

    def rate(self, q, qd, R, momentum, aam):
        M = inertia_of(self.parts, self.robot.joints, q)
        h = R.T @ momentum - self.robot.servicer_wheels.momentum - M[:3, 3:] @ qd
        for i, body in enumerate(self.carriers):
            h -= carried(self.parts, self.robot.joints, q, body) @ aam[3 * i : 3 * i + 3]
        return np.linalg.solve(M[:3, :3], h)


def dual_arm(slides=()):
    rng = np.random.default_rng(3)
    parts = random_tree(rng, DUAL_ARM, slides)
    joints = [parts[i].joint for i in 1 + rng.permutation(len(DUAL_ARM))]
    robot = robot_of(
        parts,
        joints,
        servicer_wheels={'momentum': [3.0, -2.0, 5.0]},
        target_wheels={'links': ['link_3', 'link_5'], 'momentum': [0.0] * 6},
    )
    return parts, robot, 'generic'


ROBOTS = {
    'zyx': lambda: (table_one('zyx'), servicer('zyx'), 'symmetric'),
    'xyy': lambda: (table_one('xyy'), servicer('xyy'), 'generic'),
    'dual arm': dual_arm,
    'slides in two arms': lambda: dual_arm(slides=(2, 4)),
}


@pytest.fixture(params=ROBOTS.values(), ids=ROBOTS.keys())
def case(request, rng):
    """Return the truth, the product's model, true constants and a reference at random states.

    The bodies are some way off the file's.
    """
    parts, robot, structure = request.param()
    model = MomentumModel(robot, structure)
    constants = model.prior()
    size = 40.0 if robot.target_wheels[-1].link == 'link_3' else 3.0
    constants[: 3 + model.n_aam] = size * rng.standard_normal(3 + model.n_aam)
    constants[model.y] = 0.2 * rng.standard_normal(model.bodies.size)
    bodies = {body.name: body for body in model.robot_at(constants).bodies}
    parts = [
        replace(part, **{x: getattr(bodies[part.name], x) for x in NUMBERS}) for part in parts
    ]
    N = 5
    reference = Kinematics(
        np.arange(float(N)),
        rng.uniform(-3.0, 3.0, (N, model.n)),
        rng.standard_normal((N, model.n)),
        rng.standard_normal((N, 3)),
        Rotation.random(N, rng=rng),
    )
    return Truth(parts, robot), model, constants, reference


def true_rate(case, k, dphi=0.0, dq=0.0, dqd=0.0):
    """Body rate that the constants give at reference time k, the state off by a little."""
    truth, model, constants, reference = case
    turned = reference.rotation[k] * Rotation.from_rotvec(np.zeros(3) + dphi)
    return truth.rate(
        reference.q[k] + dq,
        reference.qd[k] + dqd,
        turned.as_matrix(),
        constants[:3],
        constants[3 : 3 + model.n_aam],
    )


def exact_motion(case):
    """The reference with the body rate that the constants give."""
    reference = case[3]
    omega = np.array([true_rate(case, k) for k in range(len(reference.time))])
    return Kinematics(reference.time, reference.q, reference.qd, omega, reference.rotation)


def test_offset_is_the_rate_that_the_reference_misses(case):
    _, model, constants, reference = case
    offset = model.linearize(reference, constants).offset
    for k in range(len(offset)):
        want = true_rate(case, k) - reference.omega[k]
        scale = 1.0 + np.max(np.abs(want))
        np.testing.assert_allclose(offset[k], want, rtol=0, atol=1e-11 * scale)


def test_slope_by_attitude_joint_positions_and_rates(case):
    # The linear model holds to first order where the reference is the truth.
    _, model, constants, _ = case
    n = model.n
    exact = exact_motion(case)
    state = model.linearize(exact, constants).state
    blocks = (('dphi', slice(0, 3), 3), ('dq', slice(3, 3 + n), n), ('dqd', slice(3 + n, None), n))
    for k in range(len(exact.time)):
        for name, columns, size in blocks:
            slope = [
                (true_rate(case, k, **{name: d}) - true_rate(case, k, **{name: -d})) / (2.0 * STEP)
                for d in STEP * np.eye(size)
            ]
            scale = 1.0 + np.max(np.abs(slope))
            np.testing.assert_allclose(
                state[k][:, columns], np.transpose(slope), rtol=0, atol=SLOPE * scale
            )


def test_constants_enter_exactly_linearly(case, rng):
    # Momentum is linear in h_W and AAM, and D does not depend on them.
    _, model, constants, reference = case
    change = rng.standard_normal(model.size)
    change[model.y] = 0.0
    linear = model.linearize(reference, constants)
    moved = model.linearize(reference, constants + change)
    change = model.filtered(constants + change) - model.filtered(constants)
    got = linear.offset + linear.constants @ change
    np.testing.assert_allclose(got, moved.offset, rtol=0, atol=1e-10 * np.max(np.abs(got)))


@pytest.mark.parametrize('most', [0, 8], ids=['inertial', 'minimal'])
def test_slope_by_the_bodies(case, most, monkeypatch):
    _, model, constants, _ = case
    monkeypatch.setattr(momentum_process, '_MOST_MINIMAL', most)
    model, exact = MomentumModel(model.robot, model.structure), exact_motion(case)
    assert model.is_minimal == bool(most)
    told = model.linearize(exact, constants).constants[..., model.filter_bodies]
    got = told @ model.told_slopes(constants[model.y])
    for i, step in enumerate(STEP * np.eye(model.size)[model.y]):
        ahead, behind = (model.linearize(exact, constants + s * step).offset for s in (1.0, -1.0))
        want = (ahead - behind) / (2.0 * STEP)
        np.testing.assert_allclose(
            got[..., i], want, rtol=0, atol=SLOPE * (1.0 + np.max(np.abs(want)))
        )


def test_true_momentum_is_balanced(case):
    truth, model, constants, _ = case
    missing, columns = model.balance(exact_motion(case), constants)
    scale = np.max(np.abs(constants[:3])) + 10.0
    np.testing.assert_allclose(missing, 0.0, rtol=0, atol=1e-11 * scale)
    # the file's bodies miss by what the derivatives say, to second order
    change = 1e-6 * constants * (np.arange(model.size) >= model.y.start)
    off = model.balance(exact_motion(case), constants + change)[0]
    np.testing.assert_allclose(off, columns @ change, rtol=0, atol=1e-4 * np.max(np.abs(off)))
    without = constants.copy()
    without[:3] = 0.0
    found = model.total_momentum(exact_motion(case), without)
    np.testing.assert_allclose(found, constants[:3], rtol=0, atol=1e-11 * scale)
    want = max(
        np.linalg.norm(inertia_of(truth.parts, truth.robot.joints, q)[:3, 3:] @ qd)
        for q, qd in zip(case[3].q, case[3].qd, strict=True)
    )
    assert model.joint_share(case[3], constants) == pytest.approx(want, rel=1e-12)


def test_prior_is_what_the_robot_file_believes(case):
    _, model, _, _ = case
    np.testing.assert_array_equal(model.prior(), 0.0)
    wheels = np.arange(1.0, 1.0 + model.n_aam)
    robot = model.robot.with_target_momentum(wheels)
    prior = MomentumModel(robot, model.structure).prior()
    np.testing.assert_array_equal(prior[model.aam], wheels)
    # and zero means the file's bodies
    pi = model.robot_at(model.prior()).inertial_parameters
    np.testing.assert_allclose(pi, model.robot.inertial_parameters, rtol=1e-12, atol=1e-9)


def test_a_part_of_a_reference_is_linearized_as_within_the_whole(case):
    _, model, constants, reference = case
    rest = reference.part(slice(1, None))
    np.testing.assert_array_equal(rest.time, reference.time[1:])
    np.testing.assert_array_equal(rest.matrices, reference.matrices[1:])
    whole, part = (model.linearize(r, constants) for r in (reference, rest))
    np.testing.assert_array_equal(part.offset, whole.offset[1:])
    np.testing.assert_array_equal(part.constants, whole.constants[1:])


def test_long_references_are_linearized_as_short_ones(case, rng):
    # More times than are taken at once.
    _, model, constants, reference = case
    picks = rng.integers(0, len(reference.time), 700)
    long = Kinematics(
        np.arange(700.0),
        reference.q[picks],
        reference.qd[picks],
        reference.omega[picks],
        reference.rotation[picks],
    )
    short, got = model.linearize(reference, constants), model.linearize(long, constants)
    for name in ('offset', 'state', 'constants'):
        want = getattr(short, name)
        # the same sums in another blocking
        np.testing.assert_allclose(
            getattr(got, name), want[picks], rtol=0, atol=1e-12 * np.max(np.abs(want))
        )
