"""The linearized momentum equation against finite differences of sums over the bodies."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.identification import carried, inertia_of, servicer
from support.models import DUAL_ARM, random_tree, robot_of, table_one

from spacerobot_ros.estimation.filters.momentum_process import MomentumModel
from spacerobot_ros.estimation.trajectory.reference import Kinematics
from spacerobot_ros.estimation.unknowns.minimal import minimal_set

STEP = 1e-5
# Central differences: STEP^2 = 1e-10, rounding 1e-16 / STEP = 1e-11, derivatives of order ten.
SLOPE = 3e-8


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


def dual_arm():
    rng = np.random.default_rng(3)
    parts = random_tree(rng, DUAL_ARM)
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
}


@pytest.fixture(params=ROBOTS.values(), ids=ROBOTS.keys())
def case(request, rng):
    """Return the truth, the product's model, true constants and a reference at random states."""
    parts, robot, structure = request.param()
    model = MomentumModel(robot, minimal_set(robot, structure))
    constants = model.prior()
    size = 40.0 if robot.target_wheels[-1].link == 'link_3' else 3.0
    constants[: 3 + model.n_aam] = size * rng.standard_normal(3 + model.n_aam)
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


def test_offset_is_the_rate_that_the_reference_misses(case):
    _, model, constants, reference = case
    offset = model.linearize(reference, constants).offset
    for k in range(len(offset)):
        want = true_rate(case, k) - reference.omega[k]
        scale = 1.0 + np.max(np.abs(want))
        np.testing.assert_allclose(offset[k], want, rtol=0, atol=1e-11 * scale)


def test_slope_by_attitude_joint_positions_and_rates(case):
    # The linear model holds to first order where the reference is the truth.
    _, model, constants, reference = case
    n = model.n
    omega = np.array([true_rate(case, k) for k in range(len(reference.time))])
    exact = Kinematics(reference.time, reference.q, reference.qd, omega, reference.rotation)
    state = model.linearize(exact, constants).state
    blocks = (('dphi', slice(0, 3), 3), ('dq', slice(3, 3 + n), n), ('dqd', slice(3 + n, None), n))
    for k in range(len(omega)):
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
    change[3 + model.n_aam :] = 0.0
    linear = model.linearize(reference, constants)
    moved = model.linearize(reference, constants + change)
    got = linear.offset + linear.constants @ change
    np.testing.assert_allclose(got, moved.offset, rtol=0, atol=1e-10 * np.max(np.abs(got)))


def test_slope_by_inertial_parameters(case, rng):
    _, model, constants, reference = case
    omega = np.array([true_rate(case, k) for k in range(len(reference.time))])
    exact = Kinematics(reference.time, reference.q, reference.qd, omega, reference.rotation)
    change = np.zeros(model.size)
    # a hundred-thousandth of the robot's own parameters
    count = len(model.minimal)
    change[3 + model.n_aam :] = STEP * rng.standard_normal(count) * constants[3 + model.n_aam :]
    ahead, behind = (model.linearize(exact, constants + s * change).offset for s in (1.0, -1.0))
    got = model.linearize(exact, constants).constants @ change
    want = 0.5 * (ahead - behind)
    # second order cancels; third: STEP^2, and rounding of numbers of order ten
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-8 * np.max(np.abs(got)) + 1e-13)


def test_regressor_balances_the_true_momentum(case):
    truth, model, constants, reference = case
    omega = np.array([true_rate(case, k) for k in range(len(reference.time))])
    exact = Kinematics(reference.time, reference.q, reference.qd, omega, reference.rotation)
    columns, h0 = model.regressor(exact)
    scale = np.max(np.abs(constants[:3])) + 10.0
    np.testing.assert_allclose(columns @ constants, h0, rtol=0, atol=1e-11 * scale)
    np.testing.assert_array_equal(h0[0], truth.robot.servicer_wheels.momentum)


def test_prior_is_what_the_robot_file_believes(case):
    _, model, constants, _ = case
    prior = model.prior()
    np.testing.assert_array_equal(prior[: 3 + model.n_aam], 0.0)
    np.testing.assert_array_equal(prior[3 + model.n_aam :], constants[3 + model.n_aam :])


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
