"""Noise of the stated size, from streams that leave each other alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, norm

from spacerobot_ros.dynamics.rotation import turned
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.model.robot_settings import SensorSettings
from spacerobot_ros.model.settings import SimulatorSettings
from spacerobot_ros.sensing.sensors import SensorSuite, steps_between

NOISE = SensorSettings(
    joint_position_std=2e-5,
    joint_velocity_std=2e-4,
    joint_effort_std=0.05,
    gyro_std=3e-5,
    attitude_std=4e-4,
)
SETTINGS = SimulatorSettings(joint_rate=100.0, imu_rate=100.0, attitude_rate=100.0, seed=7)
ATTITUDE = np.array([0.2, 0.1, 0.3, 0.927]) / np.linalg.norm([0.2, 0.1, 0.3, 0.927])
STATE = State(
    np.zeros(3),
    ATTITUDE,
    np.array([0.1, -0.2, 0.3, 1.0, 2.0]),
    np.zeros(3),
    np.array([0.1, 0.12, 0.08]),
    np.array([0.01, 0.02, -0.03, 250.0, 270.0]),
)
EFFORT = np.array([1.0, -2.0, 3.0])
SAMPLES = 4000
RISK = 1e-6  # of a false alarm, a test; the seed is fixed, so a pass stays a pass


@pytest.fixture(scope='module')
def errors():
    """Return the errors of every sensor over many samples of one state, by name."""
    suite = SensorSuite(NOISE, SETTINGS, 3, 2)
    rows = {name: [] for name in ('position', 'velocity', 'effort', 'gyro', 'attitude', 'wheels')}
    truth = Rotation.from_quat(ATTITUDE)
    for k in range(SAMPLES):
        m = suite.sample(k, STATE, EFFORT)
        rows['position'].append(m.joints.position - STATE.q[:3])
        rows['velocity'].append(m.joints.velocity - STATE.qd[:3])
        rows['effort'].append(m.joints.effort - EFFORT)
        rows['gyro'].append(m.omega - STATE.omega_WB_B)
        rows['wheels'].append(m.wheel_rates - STATE.qd[3:])
        measured = Rotation.from_quat(m.attitude_xyzw)
        rows['attitude'].append((truth.inv() * measured).as_rotvec())  # on the body side
    return {name: np.array(values) for name, values in rows.items()}


STDS = {
    'position': 2e-5,
    'velocity': 2e-4,
    'effort': 0.05,
    'gyro': 3e-5,
    'attitude': 4e-4,
    'wheels': 2e-4,
}


@pytest.mark.parametrize('name', STDS)
def test_noise_has_the_stated_standard_deviation_and_no_mean(errors, name):
    values = errors[name] / STDS[name]
    for column in values.T:
        low, high = chi2.ppf([RISK / 2, 1 - RISK / 2], SAMPLES)
        assert low < np.sum(column**2) < high
        assert abs(np.mean(column)) * np.sqrt(SAMPLES) < norm.isf(RISK / 2)


def test_all_columns_are_independent_of_each_other_and_of_their_past(errors):
    columns = np.hstack([errors[name] / STDS[name] for name in STDS])
    bound = norm.isf(RISK / 2) / np.sqrt(SAMPLES)
    correlation = np.corrcoef(columns.T) - np.eye(columns.shape[1])
    assert np.max(np.abs(correlation)) < bound
    lagged = np.mean(columns[1:] * columns[:-1], axis=0)
    assert np.max(np.abs(lagged)) < bound


def take(settings, noise=NOISE, n_wheels=0, steps=200):
    suite = SensorSuite(noise, settings, 3, n_wheels)
    return [suite.sample(k, STATE, EFFORT) for k in range(steps)]


def test_the_same_seed_gives_the_same_samples_and_another_seed_others():
    first, again = take(SETTINGS), take(SETTINGS)
    other = take(replace(SETTINGS, seed=8))
    for a, b, c in zip(first, again, other, strict=True):
        np.testing.assert_array_equal(a.omega, b.omega)
        np.testing.assert_array_equal(a.attitude_xyzw, b.attitude_xyzw)
        assert np.all(a.omega != c.omega)
        assert np.all(a.joints.position != c.joints.position)


@pytest.mark.parametrize(
    'change',
    [
        {'noise': replace(NOISE, gyro_std=None)},
        {'noise': replace(NOISE, attitude_std=1.0)},
        {'n_wheels': 2},
        {'settings': replace(SETTINGS, attitude_rate=10.0)},
        {'settings': replace(SETTINGS, imu_rate=50.0)},
    ],
    ids=['silent gyro', 'loud attitude', 'tachometers', 'slow attitude', 'slow gyro'],
)
def test_one_sensor_leaves_the_noise_of_the_others_alone(change):
    plain, changed = take(SETTINGS), take(**{'settings': SETTINGS, **change})
    for a, b in zip(plain, changed, strict=True):
        np.testing.assert_array_equal(a.joints.position, b.joints.position)
        np.testing.assert_array_equal(a.joints.velocity, b.joints.velocity)
        np.testing.assert_array_equal(a.joints.effort, b.joints.effort)


def test_rates():
    settings = replace(SETTINGS, joint_rate=50.0, imu_rate=100.0, attitude_rate=10.0)
    samples = take(settings, n_wheels=1, steps=101)
    due = {
        'joints': [k for k, m in enumerate(samples) if m.joints is not None],
        'omega': [k for k, m in enumerate(samples) if m.omega is not None],
        'attitude': [k for k, m in enumerate(samples) if m.attitude_xyzw is not None],
        'wheels': [k for k, m in enumerate(samples) if m.wheel_rates is not None],
    }
    assert due['joints'] == due['wheels'] == list(range(0, 101, 2))
    assert due['omega'] == list(range(101))
    assert due['attitude'] == list(range(0, 101, 10))


@pytest.mark.parametrize(
    ('rate', 'period', 'steps'), [(100.0, 0.01, 1), (10.0, 0.01, 10), (3.0, 1.0 / 3.0, 1)]
)
def test_steps_between_samples(rate, period, steps):
    assert steps_between(rate, period, 'x') == steps


@pytest.mark.parametrize('name', ['joint_rate', 'imu_rate', 'attitude_rate'])
@pytest.mark.parametrize('rate', [30.0, 200.0, 99.9999])
def test_a_rate_that_does_not_divide_the_control_rate_is_refused(name, rate):
    with pytest.raises(ConfigurationError, match=f'simulator.{name}: .* does not divide'):
        SensorSuite(NOISE, replace(SETTINGS, **{name: rate}), 3)


@pytest.mark.parametrize(
    ('noise', 'settings'),
    [(NOISE, replace(SETTINGS, noise=False)), (SensorSettings(), SETTINGS)],
    ids=['noise off', 'no stds'],
)
def test_without_noise_sensors_are_exact(noise, settings):
    for m in take(settings, noise, steps=3):
        np.testing.assert_array_equal(m.joints.position, STATE.q[:3])
        np.testing.assert_array_equal(m.joints.effort, EFFORT)
        np.testing.assert_array_equal(m.omega, STATE.omega_WB_B)
        np.testing.assert_allclose(m.attitude_xyzw, ATTITUDE, rtol=0, atol=1e-16)  # one ulp
        assert m.wheel_rates is None


@pytest.mark.parametrize('angle', [0.0, 1e-12, 1e-3, 3.0])
def test_turned_is_a_rotation_about_body_axes(angle, rng):
    axis = rng.standard_normal(3)
    vector = angle * axis / np.linalg.norm(axis)
    q = turned(ATTITUDE, vector)
    expected = (Rotation.from_quat(ATTITUDE) * Rotation.from_rotvec(vector)).as_quat()
    np.testing.assert_allclose(q * np.sign(q @ expected), expected, rtol=0, atol=1e-15)  # ulps
    assert q @ ATTITUDE >= 0.0  # the sign follows the true attitude's
