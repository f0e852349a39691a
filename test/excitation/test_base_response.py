"""Predicted motion of the free base, against sums over the bodies and the plant's equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from support.excitation import TABLE_TWO, robot_file, six_joints
from support.identification import carried, joint_names, simulate
from support.models import ATTITUDE_XYZW, H_BASE, H_TARGET, OMEGA, Motion, momentum_and_energy
from support.models import table_one as table_one_parts

from spacerobot_ros.dynamics.equations import Dynamics, without_translation
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.estimation.trajectory.base_response import BaseResponse, BaseStart
from spacerobot_ros.excitation.motions import MotionFamily
from spacerobot_ros.model.motion_settings import ReferenceSettings
from validation.smooth_motion import simulate_smooth

START = BaseStart(ATTITUDE_XYZW, OMEGA)
TREES = {
    'table_one': table_one_parts(),
    'six_joints': six_joints(),
    'dual_arm': six_joints(dual=True),
}
SLIDE = [replace(p, kind='prismatic') if i == 2 else p for i, p in enumerate(six_joints())]


def motion(parts, steps, seed=1):
    n = len(parts) - 1
    family = MotionFamily(20.0, 3, np.zeros(n), np.linspace(0.0, 20.0, steps + 1))
    x = 0.3 * np.random.default_rng(seed).standard_normal((1, family.size))
    robot = robot_file(parts).robot
    return robot, BaseResponse(robot).move(family.times, *family.motion(x), START)


def total_momentum(parts, m, k):
    order = joint_names(parts)
    R = m.R_WB[0, k]
    q, qd = (dict(zip(order, v[0, k], strict=True)) for v in (m.q, m.qd))
    still = Motion(R, np.zeros(3), R @ m.omega[0, k], np.zeros(3), q, qd)
    wheels = H_BASE + carried(parts, order, m.q[0, k], len(parts) - 1) @ H_TARGET
    return momentum_and_energy(parts, still)[1] + R @ wheels


@pytest.mark.parametrize('tree', TREES)
def test_momentum_is_constant(tree):
    parts = TREES[tree]
    _, m = motion(parts, 200)
    for k in range(0, 201, 20):
        # exact by construction at every node: rounding of sums over the bodies
        np.testing.assert_allclose(total_momentum(parts, m, k), m.h_W[0], rtol=0, atol=1e-9)


def test_attitude_and_rate_are_those_of_table_two():
    run = simulate('zyx', 20.0)
    reference = ReferenceSettings(
        **{k: tuple(v) if isinstance(v, list) else v for k, v in TABLE_TWO.items()}
    )
    family = MotionFamily(20.0, 3, np.zeros(3), run.time)
    x = family.amplitudes(reference)
    m = BaseResponse(robot_file().robot).move(run.time, *family.motion(x[None]), START)
    np.testing.assert_allclose(m.q[0], run.q, rtol=0, atol=1e-12)
    # fourth-order steps of 10 ms on rates below 1 rad/s
    np.testing.assert_allclose(m.omega[0], run.omega, rtol=0, atol=1e-8)
    x, y, z, w = run.attitude_xyzw[-1]
    np.testing.assert_allclose(m.R_WB[0, -1, 0, 0], 1 - 2 * (y * y + z * z), rtol=0, atol=1e-8)
    np.testing.assert_allclose(m.R_WB[0, -1, 0, 1], 2 * (x * y - z * w), rtol=0, atol=1e-8)


# of the slide, 3 m out, errors of open loop grow a thousandfold in 8 s
@pytest.mark.parametrize(
    ('parts', 'points'),
    [(TREES['table_one'], 6), (TREES['dual_arm'], 6), (SLIDE, 3)],
    ids=['table_one', 'dual_arm', 'slide'],
)
def test_plant_under_the_predicted_torque_moves_as_predicted(parts, points):
    robot, m = motion(parts, 2000)
    dynamics = Dynamics(robot)
    zeros = np.zeros(3)
    start = State(zeros, ATTITUDE_XYZW, m.q[0, 0], zeros, m.omega[0, 0], m.qd[0, 0])
    torque = CubicSpline(m.time, m.torque[0])
    nodes = slice(None, 400 * points, 400)
    times = m.time[nodes]
    x = simulate_smooth(
        dynamics,
        dynamics.at_rest_centre(start).to_vector(),
        lambda t, _: torque(t),
        times,
        1e-10,
        1e-12,
    )
    n = robot.n_joints
    # open loop for 20 s: torque interpolated at 10 ms, base to fourth order
    np.testing.assert_allclose(x[:, 7 : 7 + n], m.q[0, nodes], rtol=0, atol=1e-5)
    np.testing.assert_allclose(x[:, 10 + n : 13 + n], m.omega[0, nodes], rtol=0, atol=1e-6)


def test_candidates_do_not_mix():
    robot = robot_file().robot
    family = MotionFamily(20.0, 3, np.zeros(3), np.linspace(0.0, 20.0, 121))
    x = 0.3 * np.random.default_rng(2).standard_normal((3, family.size))
    base = BaseResponse(robot)
    together = base.move(family.times, *family.motion(x), START)
    for i in range(3):
        alone = base.move(family.times, *family.motion(x[i : i + 1]), START)
        # the same sums, perhaps in another order
        np.testing.assert_allclose(together.torque[i], alone.torque[0], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(together.omega[i], alone.omega[0], rtol=0, atol=1e-12)


def test_spin_up_leaves_the_robot_without_new_momentum():
    robot = robot_file().robot
    q = np.array([0.3, -0.4, 0.5])
    omega = BaseResponse(robot).spun_up(q, H_BASE)
    D = without_translation(Dynamics(robot).mass_matrix(q))[:3, :3]
    np.testing.assert_allclose(D @ omega + H_BASE, 0.0, rtol=0, atol=1e-10)


def test_family_rests_at_both_ends_and_gives_its_own_coefficients_back():
    family = MotionFamily(15.0, 4, np.array([0.1, -0.2]), np.linspace(0.0, 15.0, 50))
    x = np.random.default_rng(0).standard_normal(family.size)
    q, qd, qdd = family.motion(x[None])
    for end in (0, -1):
        np.testing.assert_allclose(q[0, end], [0.1, -0.2], rtol=0, atol=1e-12)
        np.testing.assert_allclose([qd[0, end], qdd[0, end]], 0.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(family.amplitudes(family.reference(x)), x, rtol=1e-14, atol=0)
