"""The bound against a brute-force Fisher information: every unknown moved, every sample predicted.

The oracle predicts samples by integrating the attitude from the momentum equation, its inertia
taken column by column from the regressor, and differentiates numerically: no linearisation, no
interval algebra.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation
from support.models import H_BASE, H_TARGET, random_tree, robot_of

from spacerobot_ros.campaign.noisy_records import plan_of
from spacerobot_ros.campaign.scenario import cached_motion, scenario
from spacerobot_ros.dynamics.blocks import BlockTree
from spacerobot_ros.errors import ConfigurationError, IdentificationError
from spacerobot_ros.estimation.minimal import minimal_set
from spacerobot_ros.estimation.reference import Kinematics
from spacerobot_ros.identification.cramer_rao import SensorPlan, cramer_rao_bound
from spacerobot_ros.model.settings import SensorSettings

STEP, DURATION, KNOT = 0.01, 1.2, 0.4
GRID = STEP * np.arange(round(DURATION / STEP) + 1)
JOINTS, GYRO, ATTITUDE = slice(0, None, 2), slice(1, None, 3), slice(0, None, 10)
STDS = (1e-4, 5e-4, 2e-4, 3e-4)


class Oracle:
    """Predicts all samples, whitened, from one vector of unknowns."""

    def __init__(self, robot, minimal, rng):
        self.tree, self.minimal, self.h0 = BlockTree(robot), minimal, H_BASE
        self.n, self.body = robot.n_joints, robot.target_wheels[0].body
        count = round(DURATION / KNOT)
        self.knots = KNOT * np.arange(-5, count + 6)
        self.coefficients = rng.normal(0.0, 0.6, (count + 5, self.n))
        self.start = Rotation.random(random_state=4)
        x = minimal.regrouping @ self.tree.parameters()
        # a body rate of its own at the start fixes the total momentum
        moving = self.momentum(*self.joints(self.coefficients, GRID[:1]), [0.1, 0.12, 0.08], x)
        link = self.tree.rotations(self.joints(self.coefficients, GRID[:1])[0])[0, self.body]
        total = self.start.apply(moving[0] + H_BASE + link @ H_TARGET)
        nuisance = np.concatenate([self.coefficients.ravel(), np.zeros(3)])
        self.truth = np.concatenate([nuisance, total, H_TARGET, x])
        self.free = len(nuisance)

    def joints(self, coefficients, time):
        curve = BSpline(self.knots, coefficients, 5)
        return curve(time), curve(time, 1)

    def momentum(self, q, qd, omega, x):
        rotations = self.tree.rotations(q)
        u = np.column_stack([np.broadcast_to(omega, (len(q), 3)), qd])
        maps = self.tree.rate_maps(rotations)
        return self.tree.regressor(rotations, maps, u) @ (self.minimal.expansion @ x)

    def simulate(self, unknowns):
        c = unknowns[: self.coefficients.size].reshape(self.coefficients.shape)
        turn, total, aam = np.split(unknowns[c.size : c.size + 9], 3)
        x = unknowns[c.size + 9 :]
        fine = 0.5 * STEP * np.arange(2 * len(GRID) - 1)
        q, qd = self.joints(c, fine)
        known = self.momentum(q, qd, np.zeros(3), x) + self.h0
        known += self.tree.rotations(q)[:, self.body] @ aam
        still = np.zeros_like(qd)
        D = np.stack([self.momentum(q, still, e, x) for e in np.eye(3)], axis=2)
        inverse = np.linalg.inv(D)

        def rate(k, R):
            w = inverse[k] @ (R.T @ total - known[k])
            return w, R @ np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])

        R = [(Rotation.from_rotvec(turn) * self.start).as_matrix()]
        for k in range(len(GRID) - 1):
            k1 = rate(2 * k, R[-1])[1]
            k2 = rate(2 * k + 1, R[-1] + 0.5 * STEP * k1)[1]
            k3 = rate(2 * k + 1, R[-1] + 0.5 * STEP * k2)[1]
            k4 = rate(2 * k + 2, R[-1] + STEP * k3)[1]
            R.append(R[-1] + STEP / 6.0 * (k1 + 2.0 * (k2 + k3) + k4))
        omega = np.array([rate(2 * k, r)[0] for k, r in enumerate(R)])
        return q[::2], qd[::2], omega, np.array(R)

    def predict(self, unknowns):
        q, qd, omega, R = self.simulate(unknowns)
        parts = (q[JOINTS], qd[JOINTS], omega[GYRO], R[ATTITUDE] / np.sqrt(2.0))
        return np.concatenate([p.ravel() / s for p, s in zip(parts, STDS, strict=True)])

    def information(self):
        """Of [h_W; AAM; x], all else eliminated."""
        scale = np.maximum(np.abs(self.truth), 1.0)
        step = 1e-5
        columns = [
            (self.predict(self.truth + step * s * e) - self.predict(self.truth - step * s * e))
            / (2.0 * step * s)
            for s, e in zip(scale, np.eye(len(scale)), strict=True)
        ]
        J = np.column_stack(columns)
        nuisance, wanted = J[:, : self.free], J[:, self.free :]
        wanted = wanted - nuisance @ np.linalg.lstsq(nuisance, wanted, rcond=None)[0]
        return wanted.T @ wanted


def motion_of(oracle):
    q, qd, omega, R = oracle.simulate(oracle.truth)
    return Kinematics(GRID, q, qd, omega, Rotation.from_matrix(R))


def servicer(structure):
    robot = scenario('zyx').robot
    return robot, minimal_set(robot, structure)


def two_arms(rng):
    wheels = {
        'servicer_wheels': {'momentum': list(H_BASE)},
        'target_wheels': {'links': ['link_2'], 'momentum': list(H_TARGET)},
    }
    robot = robot_of(random_tree(rng, [0, 0]), **wheels)
    return robot, minimal_set(robot, 'generic')


@pytest.mark.parametrize('which', ['servicer', 'two arms'])
def test_the_information_is_that_of_brute_force(which, rng):
    robot, minimal = servicer('symmetric') if which == 'servicer' else two_arms(rng)
    oracle = Oracle(robot, minimal, rng)
    plan = SensorPlan(GRID[JOINTS], GRID[GYRO], GRID[ATTITUDE], *STDS)
    bound = cramer_rao_bound(robot, minimal, motion_of(oracle), plan, KNOT)
    expected = oracle.information()
    scale = 1.0 / np.sqrt(np.diag(expected))
    got = bound.factor.T @ bound.factor
    # central differences of 1e-5 and Hermite interpolation between nodes 50 ms apart
    np.testing.assert_allclose(
        got * np.outer(scale, scale), expected * np.outer(scale, scale), rtol=0, atol=2e-4
    )


def test_the_bound_is_proportional_to_the_noise():
    case, motion = scenario('zyx'), cached_motion('zyx')
    one, ten = (
        cramer_rao_bound(case.robot, case.minimal, motion, plan_of(motion, s)).std
        for s in (0.1, 1.0)
    )
    np.testing.assert_allclose(ten, 10.0 * one, rtol=1e-6)  # rounding of an information of 1e10


def test_the_bound_of_the_prototype():
    case, motion = scenario('zyx'), cached_motion('zyx')
    plan = plan_of(motion, 1.0)
    std = cramer_rao_bound(case.robot, case.minimal, motion, plan).std
    percent = 100.0 * std[:3] / case.robot.target_momentum
    # printed to three digits in the notes, from other code
    np.testing.assert_allclose(percent, [0.133, 0.111, 0.112], rtol=0, atol=6e-4)
    without = cramer_rao_bound(
        case.robot, case.minimal, motion, replace(plan, joint_velocity_std=None)
    )
    percent = 100.0 * without.std[:3] / case.robot.target_momentum
    np.testing.assert_allclose(percent, [0.1337, 0.112, 0.112], rtol=0, atol=6e-4)


def test_finer_knots_hardly_matter():
    case, motion = scenario('zyx'), cached_motion('zyx')
    coarse, fine = (
        cramer_rao_bound(case.robot, case.minimal, motion, plan_of(motion, 1.0), knot).std
        for knot in (0.5, 0.1)
    )
    np.testing.assert_allclose(fine, coarse, rtol=2e-3)
    assert np.all(fine > coarse)  # more freedom never tells more


def test_fewer_attitudes_tell_less():
    case, motion = scenario('zyx'), cached_motion('zyx')
    plan = plan_of(motion, 1.0)
    slow = replace(plan, attitude_time=plan.attitude_time[::25])
    none = replace(plan, attitude_std=None)
    bounds = [
        cramer_rao_bound(case.robot, case.minimal, motion, p).std for p in (plan, slow, none)
    ]
    assert np.all(bounds[0] < bounds[1])
    assert np.all(bounds[1] < bounds[2])


def test_joints_at_rest_tell_nothing_of_what_they_would_move():
    case, motion = scenario('zyx'), cached_motion('zyx')
    rest = Kinematics(
        motion.time,
        np.zeros_like(motion.q),
        np.zeros_like(motion.qd),
        np.zeros_like(motion.omega),
        Rotation.from_quat(np.tile([0.0, 0.0, 0.0, 1.0], (len(motion.time), 1))),
    )
    bound = cramer_rao_bound(case.robot, case.minimal, rest, plan_of(rest, 1.0))
    assert bound.rank < case.minimal.expansion.shape[1] + 3
    assert np.any(np.isinf(bound.std))


def test_a_plan_beyond_the_motion_is_refused():
    case, motion = scenario('zyx'), cached_motion('zyx')
    sensors = SensorSettings(joint_position_std=1e-4, gyro_std=1e-4, attitude_std=1e-4)
    plan = SensorPlan.regular(sensors, 30.0, 100.0, 100.0, 10.0)
    assert len(plan.joint_time) == 3001
    with pytest.raises(
        IdentificationError, match=r'from 0 to 30 s, the motion from 0 to 19\.98 s'
    ):
        cramer_rao_bound(case.robot, case.minimal, motion, plan)


@pytest.mark.parametrize(
    ('change', 'place'),
    [
        ({'gyro_std': 0.0}, r'plan\.gyro_std'),
        ({'attitude_std': np.nan}, r'plan\.attitude_std'),
        ({'rate_time': np.array([0.0, 0.2, 0.1])}, r'plan\.rate_time'),
        ({'joint_time': np.array([0.0, np.nan])}, r'plan\.joint_time'),
    ],
)
def test_an_impossible_plan_is_refused(change, place):
    with pytest.raises(ConfigurationError, match=place):
        replace(plan_of(cached_motion('zyx'), 1.0), **change)
