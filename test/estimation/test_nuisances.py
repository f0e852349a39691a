"""Nuisances of the identifier: names, refusals, and columns against their closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.models import robot_of, table_one

from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.estimation.trajectory.reference import Kinematics
from spacerobot_ros.estimation.unknowns.nuisances import Nuisances
from spacerobot_ros.estimation.unknowns.torque_hold import Holds

ALL = (
    'gyro_bias',
    'encoder_offset',
    'imu_delay',
    'attitude_delay',
    'torque_hold',
    'external_torque_inertial',
    'target_wheel_drag',
    'servicer_wheel_drag',
)
AAM = np.array([42.0, 49.0, 41.0])
H0 = np.array([1.0, -2.0, 0.5])
COUNT = 7


@pytest.fixture(scope='module')
def robot():
    return robot_of(
        table_one(),
        servicer_wheels={'momentum': H0.tolist()},
        target_wheels={'links': ['link_3'], 'momentum': [0.0, 0.0, 0.0]},
    )


@pytest.fixture
def at(rng):
    q, qd, qdd = rng.standard_normal((3, COUNT, 3))
    omega, alpha = 0.1 * rng.standard_normal((2, COUNT, 3))
    rotation = Rotation.random(COUNT, rng=1)
    return Kinematics(np.linspace(0.0, 60.0, COUNT), q, qd, omega, rotation, qdd, alpha)


def test_names_and_units(robot):
    nuisances = Nuisances(ALL, robot)
    assert nuisances.names == (
        *(f'gyro_bias_{axis}' for axis in 'xyz'),
        *(f'encoder_offset_{i}' for i in (1, 2, 3)),
        *('imu_delay', 'attitude_delay', 'torque_hold'),
        *(f'external_torque_inertial_{axis}' for axis in 'xyz'),
        *('target_wheel_drag', 'servicer_wheel_drag'),
    )
    assert nuisances.units == (
        *('rad/s', 'rad/s', 'rad/s', 'rad', 'rad', 'rad', 's', 's', 's^2'),
        *('N m', 'N m', 'N m', '1/s', '1/s'),
    )


@pytest.mark.parametrize(
    ('ids', 'place'),
    [(('joint_viscous_friction',), 0), (('gyro_bias', 'gyro_bias'), 1), (('imu_delay', ''), 1)],
)
def test_other_effects_and_repeated_ones_are_refused(robot, ids, place):
    with pytest.raises(ConfigurationError, match=rf'nuisances\[{place}\].*is not one of gyro_bi'):
        Nuisances(ids, robot)


def test_prior_is_about_zero_unless_the_period_of_holds_is_known(robot):
    nuisances = Nuisances(('gyro_bias', 'torque_hold'), robot)
    mean, std = nuisances.prior()
    np.testing.assert_array_equal(mean, 0.0)
    np.testing.assert_allclose(std, [1e-3, 1e-3, 1e-3, 1e-4], rtol=1e-12)
    mean, std = nuisances.prior(Holds(np.arange(3.0), 0.03, is_known=True))
    assert (mean[3], std[3]) == pytest.approx((0.03**2 / 12, 0.03**2 / 120))


def columns_of(nuisances, columns, name):
    return columns[..., [i for i, each in enumerate(nuisances.names) if each.startswith(name)]]


def test_what_sensors_misread(robot, at):
    nuisances = Nuisances(ALL, robot)
    values = np.zeros(nuisances.size)
    values[:9] = [1e-4, 2e-4, -3e-4, 1e-3, 0.0, -2e-3, 0.02, 0.3, 1e-5]
    held = np.ones((COUNT, 3))
    want = {  # of the gyro: b - d w' - k s j; of the attitude: -d w
        'gyro': values[:3] - 0.02 * at.alpha - 1e-5 * held,
        'joint_position': np.tile(values[3:6], (COUNT, 1)),
        'joint_velocity': -1e-5 * held,
        'attitude': -0.3 * at.omega,
    }
    for channel, error in want.items():
        is_held = channel in ('gyro', 'joint_velocity')
        total, columns = nuisances.misreadings(values, channel, at, held if is_held else None)
        # differences of numbers of order one by steps of 1e-8
        np.testing.assert_allclose(total, error, rtol=0, atol=1e-14)
        np.testing.assert_allclose(columns @ values, error, rtol=0, atol=1e-10)


def test_what_is_added_to_the_momentum(robot, at):
    nuisances = Nuisances(ALL[5:], robot)
    torque, target, servicer = np.array([1e-3, -2e-3, 5e-3]), 1e-3, 2e-3
    values = np.array([*torque, target, servicer])
    total, columns, by_aam = nuisances.imbalance(values, at, AAM)
    np.testing.assert_allclose(
        by_aam @ AAM, total - nuisances.imbalance(values, at, 0.0 * AAM)[0], rtol=0, atol=1e-12
    )
    t = at.time[:, None]
    wheel = robot.target_wheels[0]
    zero = Nuisances((), robot)._motion(at, AAM).base_rotation('link_3') @ wheel.rotation @ AAM
    want = at.rotation.inv().apply(t * torque)
    want += -np.expm1(-target * t) * zero - np.expm1(-servicer * t) * H0
    np.testing.assert_allclose(total, want, rtol=0, atol=1e-12)
    back = np.swapaxes(at.matrices, 1, 2) * at.time[:, None, None]
    np.testing.assert_allclose(columns_of(nuisances, columns, 'external'), back, rtol=0, atol=1e-8)
    for name, tau, h in (('target', target, zero), ('servicer', servicer, H0)):
        slope = (t * np.exp(-tau * t) * h)[..., None]
        # central differences of 1e-7 over a minute
        np.testing.assert_allclose(
            columns_of(nuisances, columns, name), slope, rtol=0, atol=1e-6 * np.max(np.abs(slope))
        )
