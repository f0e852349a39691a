"""Real sensors: Allan deviation, steps, limits, lost samples, stamps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spacerobot_ros.dynamics.state import State
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.model.robot_settings import SensorSettings
from spacerobot_ros.model.settings import SimulatorSettings, parse_settings
from spacerobot_ros.sensing.imperfections import Imperfections
from spacerobot_ros.sensing.sensors import SensorSuite

SETTINGS = SimulatorSettings(period=0.01, imu_rate=100.0, attitude_rate=100.0, seed=3)
ATTITUDE = np.array([0.0, 0.0, 0.0, 1.0])


def allan(rates, period, sizes):
    """Allan deviations of (N, 3) rates for clusters of some sizes, all axes together."""
    angles = np.vstack([np.zeros(3), np.cumsum(rates, axis=0)]) * period
    out = []
    for m in sizes:
        second = angles[2 * m :] - 2.0 * angles[m:-m] + angles[: -2 * m]
        out.append(np.sqrt(np.mean(second**2) / (2.0 * (m * period) ** 2)))
    return np.array(out)


def test_the_gyros_allan_deviation_is_that_of_its_parameters():
    """IEEE Std 952: sigma^2(t) = N^2 / t + K^2 t / 3."""
    std, walk, samples, period = 1e-3, 3e-4, 200_000, 0.01
    sensors = SensorSettings(gyro_std=std, gyro_bias_walk=walk)
    gyro = Imperfections(sensors, SETTINGS)
    rates = np.array([gyro.rate(np.zeros(3)) for _ in range(samples)])
    sizes = np.array([1, 3, 10, 30, 100, 300, 1000, 3000])
    times = sizes * period
    expected = np.sqrt(std**2 * period / times + walk**2 * times / 3.0)
    # 3 axes of 2000 s: at the longest time of 30 s some 200 independent clusters, 5 % each
    np.testing.assert_allclose(allan(rates, period, sizes), expected, rtol=0.12, atol=0)
    np.testing.assert_allclose(
        allan(rates, period, sizes[:4]), expected[:4], rtol=0.01, atol=0
    )  # 1e4 clusters and more


def test_a_walk_alone_has_the_variance_of_its_time():
    sensors = SensorSettings(gyro_bias_walk=1e-4)
    ends = [
        [Imperfections(sensors, replace(SETTINGS, seed=s)).rate(np.zeros(3)) for _ in range(1)][-1]
        for s in range(400)
    ]
    # one step of 10 ms: 1e-4 sqrt(0.01); 1200 numbers, 2 % each
    assert np.std(ends) == pytest.approx(1e-5, rel=0.1)


def test_steps_and_range():
    sensors = SensorSettings(
        gyro_range=0.5,
        gyro_resolution=0.01,
        joint_position_resolution=1e-3,
        joint_effort_resolution=0.25,
    )
    state = State(
        np.zeros(3),
        ATTITUDE,
        np.array([0.12345, -0.9996, 0.0]),
        np.zeros(3),
        np.array([0.1234, -3.0, 0.7]),
        np.array([0.1, 0.2, 0.3]),
    )
    said = SensorSuite(sensors, SETTINGS, 3).sample(0, state, np.array([0.3, -0.4, 1.0]))
    np.testing.assert_allclose(said.omega, [0.12, -0.5, 0.5], rtol=1e-15, atol=0)
    np.testing.assert_allclose(said.joints.position, [0.123, -1.0, 0.0], rtol=1e-15, atol=0)
    np.testing.assert_allclose(said.joints.effort, [0.25, -0.5, 1.0], rtol=0, atol=0)
    np.testing.assert_array_equal(said.joints.velocity, state.qd)


def test_every_joint_has_noise_of_its_own():
    stds = (0.01, 0.3, 2.0)
    sensors = SensorSettings(joint_effort_std=stds, joint_velocity_std=stds)
    suite = SensorSuite(sensors, SETTINGS, 3, n_wheels=0)
    said = [suite.sample(k, spinning(0.0), np.zeros(3)).joints for k in range(4000)]
    for values in ([s.effort for s in said], [s.velocity for s in said]):
        # a standard deviation of 4000 samples has one of 1.1 %; five of them
        np.testing.assert_allclose(np.std(values, axis=0), stds, rtol=0.056, atol=0)
    assert np.std([s.position for s in said]) == 0.0


def spinning(rate):
    return State(
        np.zeros(3), ATTITUDE, np.zeros(3), np.zeros(3), np.array([0.0, rate, 0.0]), np.zeros(3)
    )


def test_a_tracker_is_blind_above_its_rate():
    suite = SensorSuite(SensorSettings(attitude_rate_limit=0.05), SETTINGS, 3)
    assert suite.sample(0, spinning(0.049), np.zeros(3)).attitude_xyzw is not None
    fast = suite.sample(1, spinning(0.051), np.zeros(3))
    assert fast.attitude_xyzw is None
    assert fast.omega is not None


def test_samples_are_lost_at_their_share_but_never_the_first():
    sensors = SensorSettings(joint_dropout=0.2, imu_dropout=0.5, attitude_dropout=0.9)
    state = spinning(0.0)
    for seed in range(20):
        first = SensorSuite(sensors, replace(SETTINGS, seed=seed), 3).sample(0, state, np.zeros(3))
        assert all(x is not None for x in (first.joints, first.omega, first.attitude_xyzw))
    suite = SensorSuite(sensors, SETTINGS, 3)
    said = [suite.sample(k, state, np.zeros(3)) for k in range(4000)]
    for name, share in (('joints', 0.2), ('omega', 0.5), ('attitude_xyzw', 0.9)):
        lost = np.mean([getattr(s, name) is None for s in said])
        assert lost == pytest.approx(share, abs=5.0 * np.sqrt(share * (1 - share) / 4000))


def late_by(sensors, steps=3000):
    """Lateness of the joints' stamps, read from a joint that moves at 1 rad/s [s]."""
    suite = SensorSuite(sensors, SETTINGS, 1)
    late = []
    for k in range(steps):
        time = 0.01 * k
        state = State(
            np.zeros(3), ATTITUDE, np.array([time]), np.zeros(3), np.zeros(3), np.ones(1)
        )
        late.append(time - suite.sample(k, state, np.zeros(1)).joints.position[0])
    return np.array(late)


def test_jitter_is_spread_evenly_between_none_and_its_size():
    late = late_by(SensorSettings(joint_jitter=0.004))
    assert late.min() >= -1e-12
    assert late.max() <= 0.004 + 1e-12
    assert np.mean(late) == pytest.approx(0.002, rel=0.05)
    assert np.std(late) == pytest.approx(0.004 / np.sqrt(12.0), rel=0.05)


def test_a_drifting_clock_falls_late_in_proportion_to_time():
    late = late_by(SensorSettings(joint_clock_drift=1e-3))
    np.testing.assert_allclose(late, 1e-3 * 0.01 * np.arange(3000), rtol=0, atol=1e-9)


def test_imperfections_leave_the_noise_of_the_others_alone():
    noise = SensorSettings(joint_position_std=1e-5, gyro_std=1e-5, attitude_std=1e-4)
    worse = replace(
        noise, gyro_bias_walk=1e-3, joint_dropout=0.3, attitude_jitter=1e-3, gyro_resolution=1e-6
    )
    plain, real = SensorSuite(noise, SETTINGS, 3), SensorSuite(worse, SETTINGS, 3)
    for k in range(200):
        a = plain.sample(k, spinning(0.0), np.zeros(3))
        b = real.sample(k, spinning(0.0), np.zeros(3))
        np.testing.assert_array_equal(a.attitude_xyzw, b.attitude_xyzw)
        np.testing.assert_allclose(a.omega, b.omega, rtol=0, atol=5e-3)  # the walk alone


@pytest.mark.parametrize(
    ('name', 'value'),
    [('gyro_range', 0.0), ('imu_dropout', 1.0), ('joint_jitter', -1e-3), ('gyro_bias_walk', -1.0)],
)
def test_nonsense_is_refused(name, value):
    with pytest.raises(ConfigurationError, match=f'sensors.{name}'):
        parse_settings({'robot': {'joints': ['a']}, 'sensors': {name: value}})
