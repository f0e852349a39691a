"""Effects that the identifier estimates beside the momentum: columns by bound effects alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.models import robot_of, table_one

from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.motion import Motion

STEP = 1e-6
COUNT = 7


@pytest.fixture
def motion(rng):
    robot = robot_of(
        table_one(),
        servicer_wheels={'momentum': [1.0, -2.0, 0.5]},
        target_wheels={'links': ['link_3'], 'momentum': [42.0, 49.0, 41.0]},
    )
    n = robot.n_joints
    q, qd, effort = rng.standard_normal((3, COUNT, n))
    omega, velocity = 0.1 * rng.standard_normal((2, COUNT, 3))
    rotation = Rotation.random(COUNT, random_state=1).as_matrix()
    time = np.linspace(0.0, 3.0, COUNT)
    return Motion(robot, time, q, qd, effort, rotation=rotation, omega=omega, velocity=velocity)


def bound(kind, where, **values):
    return CATALOGUE[kind](name=kind, where=where, values={**CATALOGUE[kind].nominal(), **values})


def test_gyro_bias_and_encoder_offset_shift_their_own_column(motion):
    for i, axis in enumerate('xyz'):
        effect = bound('gyro_bias', None, **{axis: STEP})
        column = (effect.sense('gyro', motion.omega, motion) - motion.omega) / STEP
        np.testing.assert_allclose(column, np.tile(np.eye(3)[i], (COUNT, 1)), rtol=0, atol=1e-9)
    for i, joint in enumerate(motion.robot.joints):
        effect = bound('encoder_offset', joint, offset=STEP)
        column = (effect.sense('joint_position', motion.q, motion) - motion.q) / STEP
        shift = np.tile(np.eye(motion.robot.n_joints)[i], (COUNT, 1))
        np.testing.assert_allclose(column, shift, rtol=0, atol=1e-8)


@pytest.mark.parametrize(('kind', 'clock'), [('imu_delay', 'imu'), ('attitude_delay', 'attitude')])
def test_delays_act_on_their_own_clock(kind, clock):
    effect = bound(kind, None, delay=0.02)
    assert {c: effect.delay(c) for c in ('joints', 'effort', 'imu', 'attitude')} == {
        **dict.fromkeys(('joints', 'effort', 'imu', 'attitude'), 0.0),
        clock: 0.02,
    }


def test_external_torque_is_constant_in_the_inertial_frame(motion):
    effect = bound('external_torque_inertial', None, x=1.0, y=-2.0, z=0.5)
    force = effect.force(motion, np.zeros((COUNT, 0)))
    inertial = np.einsum('nij,nj->ni', motion.rotation, force[:, 3:6])
    np.testing.assert_allclose(inertial, np.tile([1.0, -2.0, 0.5], (COUNT, 1)), atol=1e-12)
    assert not force[:, :3].any()
    assert not force[:, 6:].any()


@pytest.mark.parametrize(
    ('kind', 'where', 'momentum'),
    [
        ('servicer_wheel_drag', None, [1.0, -2.0, 0.5]),
        ('target_wheel_drag', 'link_3', [42.0, 49.0, 41.0]),
    ],
)
def test_wheel_drag_takes_momentum_in_proportion_to_time(motion, kind, where, momentum):
    hidden = np.zeros((COUNT, 0))
    still = bound(kind, where)  # an infinite time constant
    assert not still.momentum(motion, hidden).any()
    assert not still.force(motion, hidden).any()
    column = bound(kind, where, time_constant=1.0 / STEP).momentum(motion, hidden) / STEP
    link = where or motion.robot.base_link
    h = np.einsum('nij,j->ni', motion.base_rotation(link), np.array(momentum))
    np.testing.assert_allclose(column[:, 3:], -motion.time[:, None] * h, rtol=1e-5, atol=1e-9)
