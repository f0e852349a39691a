"""The bound against a brute-force Fisher information: every unknown moved, every sample predicted.

The oracle predicts samples by integrating the attitude from the momentum equation, its inertia
taken column by column from the minimal regressor, and differentiates numerically: no
linearization, no filter.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation
from support.models import H_BASE, H_TARGET, random_tree, robot_of

from spacerobot_ros.dynamics.forward_kinematics import forward_kinematics
from spacerobot_ros.dynamics.tree import tree_of
from spacerobot_ros.estimation.filters.momentum_process import MomentumModel
from spacerobot_ros.estimation.trajectory.reference import Kinematics, NoiseLevels
from spacerobot_ros.estimation.unknowns.body_coordinates import BodyCoordinates
from spacerobot_ros.estimation.unknowns.minimal import minimal_regressor, minimal_set
from spacerobot_ros.identification.cramer_rao import information_root
from spacerobot_ros.recording.record import (
    AttitudeSeries,
    JointSeries,
    RateSeries,
    Record,
    to_stamps,
)
from validation.papers.estimators import bound_of, bound_std
from validation.papers.paper import levels_of, momentum_motion, noisy_record, scenario

STEP, DURATION, KNOT = 0.02, 10.0, 0.5
GRID = STEP * np.arange(round(DURATION / STEP) + 1)
JOINTS, GYRO, ATTITUDE = slice(None), slice(0, None, 2), slice(0, None, 5)
STDS = (1e-4, 5e-4, 2e-4, 3e-4)
NOISE = NoiseLevels(
    **dict(zip(('joint_position', 'joint_velocity', 'gyro', 'attitude'), STDS, strict=True)),
    joint_effort=np.inf,
)
SKEW = np.array(
    [[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]]
)


class Oracle:
    """Predicts all samples, whitened, from one vector of unknowns."""

    def __init__(self, robot, structure, rng):
        self.robot, self.minimal, self.h0 = robot, minimal_set(robot, structure), H_BASE
        self.bodies = BodyCoordinates(robot, structure)
        self.n, self.body = robot.n_joints, robot.target_wheels[0].body
        count = round(DURATION / KNOT)
        self.knots = KNOT * np.arange(-5, count + 6)
        phase = rng.uniform(0.0, 6.0, (2, self.n))
        turns = 2.0 * np.pi * np.arange(count + 5)[:, None] / count
        self.coefficients = 0.5 * (np.sin(turns + phase[0]) + np.sin(2.0 * turns + phase[1]))
        self.start = Rotation.random(random_state=4)
        x = self.minimal.of_robot(robot)
        # a body rate of its own at the start fixes the total momentum
        moving = self.momentum(*self.joints(self.coefficients, GRID[:1]), [0.1, 0.12, 0.08], x)
        link = self.link(self.joints(self.coefficients, GRID[:1])[0])[0]
        total = self.start.apply(moving[0] + H_BASE + link @ H_TARGET)
        nuisance = np.concatenate([self.coefficients.ravel(), np.zeros(3)])
        self.truth = np.concatenate([nuisance, total, H_TARGET, np.zeros(self.bodies.size)])
        self.free = len(nuisance)

    def joints(self, coefficients, time):
        curve = BSpline(self.knots, coefficients, 5)
        return curve(time), curve(time, 1)

    def momentum(self, q, qd, omega, x):
        omega = np.broadcast_to(omega, (len(q), 3))
        states = Kinematics(np.zeros(len(q)), q, qd, omega, Rotation.identity(len(q)))
        return minimal_regressor(self.minimal, states) @ x

    def link(self, q):
        still = np.zeros((len(q), 6 + self.n))
        return forward_kinematics(tree_of(self.robot), q, still, q).rotations[:, self.body]

    def driven(self, unknowns):
        """q, q', and of the base's rate the momentum that is not its own, and inverse inertia."""
        c = unknowns[: self.coefficients.size].reshape(self.coefficients.shape)
        aam = unknowns[c.size + 6 : c.size + 9]
        x = self.minimal.of_bodies(*self.bodies.bodies(unknowns[c.size + 9 :]))
        fine = 0.5 * STEP * np.arange(2 * len(GRID) - 1)
        q, qd = self.joints(c, fine)
        known = self.momentum(q, qd, np.zeros(3), x) + self.h0
        known += self.link(q) @ aam
        still = np.zeros_like(qd)
        D = np.stack([self.momentum(q, still, e, x) for e in np.eye(3)], axis=2)
        return q[::2], qd[::2], known, np.linalg.inv(D)

    def simulate(self, unknowns):
        """Of every row of unknowns (B, u): q, q', omega and R_WB on the grid."""
        q, qd, known, inverse = (
            np.array(x) for x in zip(*map(self.driven, unknowns), strict=True)
        )
        turn, total = (unknowns[:, self.free + k : self.free + k + 3] for k in (-3, 0))

        def rate(k, R):
            h_B = np.einsum('bij,bi->bj', R, total) - known[:, k]
            w = np.einsum('bij,bj->bi', inverse[:, k], h_B)
            return w, R @ (w @ SKEW).reshape(-1, 3, 3)

        R = [(Rotation.from_rotvec(turn) * self.start).as_matrix()]
        for k in range(len(GRID) - 1):
            k1 = rate(2 * k, R[-1])[1]
            k2 = rate(2 * k + 1, R[-1] + 0.5 * STEP * k1)[1]
            k3 = rate(2 * k + 1, R[-1] + 0.5 * STEP * k2)[1]
            k4 = rate(2 * k + 2, R[-1] + STEP * k3)[1]
            R.append(R[-1] + STEP / 6.0 * (k1 + 2.0 * (k2 + k3) + k4))
        omega = np.stack([rate(2 * k, r)[0] for k, r in enumerate(R)], axis=1)
        return q, qd, omega, np.stack(R, axis=1)

    def predict(self, unknowns):
        q, qd, omega, R = self.simulate(unknowns)
        parts = (q[:, JOINTS], qd[:, JOINTS], omega[:, GYRO], R[:, ATTITUDE] / np.sqrt(2.0))
        whitened = [p.reshape(len(p), -1) / s for p, s in zip(parts, STDS, strict=True)]
        return np.concatenate(whitened, axis=1)

    def information(self):
        """Of [h_W; AAM; y], all else eliminated."""
        steps = 1e-5 * np.diag(np.maximum(np.abs(self.truth), 1.0))
        above, below = (self.predict(self.truth + sign * steps) for sign in (1.0, -1.0))
        J = (above - below).T / (2.0 * np.diag(steps))
        nuisance, wanted = J[:, : self.free], J[:, self.free :]
        wanted = wanted - nuisance @ np.linalg.lstsq(nuisance, wanted, rcond=None)[0]
        return wanted.T @ wanted


def motion_of(oracle):
    q, qd, omega, R = (x[0] for x in oracle.simulate(oracle.truth[None]))
    return Kinematics(GRID, q, qd, omega, Rotation.from_matrix(R))


def two_arms(rng):
    wheels = {
        'servicer_wheels': {'momentum': list(H_BASE)},
        'target_wheels': {'links': ['link_2'], 'momentum': list(H_TARGET)},
    }
    return robot_of(random_tree(rng, [0, 0]), **wheels)


def exact_record(robot, motion):
    stamps, turned = to_stamps(motion.time), motion.rotation.as_quat()
    joints = JointSeries(robot.joints, stamps[JOINTS], motion.q[JOINTS], motion.qd[JOINTS])
    rates = RateSeries(stamps[GYRO], motion.omega[GYRO])
    return Record(joints, rates, AttitudeSeries(stamps[ATTITUDE], turned[ATTITUDE]))


@pytest.mark.parametrize('which', ['servicer', 'two arms'])
def test_the_information_is_that_of_brute_force(which, rng):
    robot, structure = scenario('zyx').robot, 'symmetric'
    if which == 'two arms':
        robot, structure = two_arms(rng), 'generic'
    oracle = Oracle(robot, structure, rng)
    record = exact_record(robot, motion_of(oracle))
    root = information_root(MomentumModel(robot, structure), record, NOISE)
    expected, got = oracle.information(), root.T @ root
    scale = 1.0 / np.sqrt(np.diag(expected))
    # central differences of 1e-5; joints that the filter drives by white snap, not by knots
    np.testing.assert_allclose(
        got * np.outer(scale, scale), expected * np.outer(scale, scale), rtol=0, atol=2e-4
    )


def test_the_bound_is_proportional_to_the_noise():
    # the filter takes joints for a little smoother than the noise is small
    np.testing.assert_allclose(bound_of('zyx', 1.0), 10.0 * bound_of('zyx', 0.1), rtol=1e-3)


def test_bodies_are_bounded_tighter_than_the_linear_set_of_the_prototype():
    percent = 100.0 * bound_of('zyx')[:3] / scenario('zyx').robot.target_momentum
    # of 19 minimal parameters, printed to three digits in the notes, from other code; bodies with
    # these zeros span 15 directions of them
    share = percent / [0.133, 0.111, 0.112]
    assert np.all((share > 0.7) & (share < 1.0))


def test_joint_rates_add_little():
    case, motion = scenario('zyx'), momentum_motion('zyx')
    record = noisy_record(case.robot.joints, motion, 0.0, 0)
    record = replace(record, joints=replace(record.joints, velocity=None))
    model = MomentumModel(case.robot, 'symmetric')
    root = information_root(model, record, levels_of(1.0))
    # by 1 %, as the prototype has it
    np.testing.assert_allclose(bound_std(root, model)[:3], bound_of('zyx')[:3], rtol=0.02)


def test_fewer_attitudes_tell_less():
    assert np.all(bound_of('zyx') < bound_of('zyx', attitude_every=25))


def test_joints_at_rest_tell_nothing_of_what_they_would_move():
    case, motion = scenario('zyx'), momentum_motion('zyx')
    rest = Kinematics(
        motion.time,
        np.zeros_like(motion.q),
        np.zeros_like(motion.qd),
        np.zeros_like(motion.omega),
        Rotation.from_quat(np.tile([0.0, 0.0, 0.0, 1.0], (len(motion.time), 1))),
    )
    record = noisy_record(case.robot.joints, rest, 0.0, 0)
    model = MomentumModel(case.robot, 'symmetric')
    root = information_root(model, record, levels_of(1.0))
    bound = bound_std(root, model)
    assert np.all(np.isinf(bound[3:]))
    # at rest the total momentum is all that is seen; rounding sees the rest to 1e-12
    assert np.all(bound[:3] > 1e9)
