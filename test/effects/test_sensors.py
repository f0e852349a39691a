"""Sensor faults and late clocks: what is said against what is true, and undone again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.against_mujoco import TORQUE, plant_with
from support.models import robot_of, table_one

from spacerobot_ros.effects.catalogue import bind_effects
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.model.robot_settings import SensorSettings
from spacerobot_ros.model.settings import SimulatorSettings
from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries, Record
from spacerobot_ros.sensing.imperfections import StateHistory
from spacerobot_ros.sensing.sensor_faults import SensorFaults, corrected_record
from spacerobot_ros.sensing.sensors import SensorSuite

EXACT = SimulatorSettings(attitude_rate=100.0, noise=False)
STEPS = 60


def measure(entries, steps=STEPS, sensors=None, settings=EXACT):
    """True states, torques of the steps that ended, and samples, at every step of a moving arm."""
    plant = plant_with(table_one(), entries)
    faults = SensorFaults(plant.robot, plant.effects)
    suite = SensorSuite(sensors or SensorSettings(), settings, 3, 0, faults)
    states, efforts, samples = [], [], []
    for k in range(steps):
        states.append(plant.state)
        efforts.append(plant.effort)
        samples.append(suite.sample(k, plant.state, plant.effort, plant.hidden))
        plant.step(TORQUE * np.sin(0.05 * k + np.arange(3)))
    return states, efforts, samples


def rotation(q_xyzw):
    return Rotation.from_quat(q_xyzw)


@pytest.mark.parametrize(
    ('effect', 'values', 'expected'),
    [
        (
            'encoder_offset',
            {'offset': 0.01},
            ('position', lambda x: x + np.array([0.0, 0.01, 0.0])),
        ),
        ('encoder_scale', {'gain': 1.02}, ('position', lambda x: x * [1.0, 1.02, 1.0])),
        ('joint_rate_scale', {'gain': 0.97}, ('velocity', lambda x: x * [1.0, 0.97, 1.0])),
        (
            'torque_sensor_bias',
            {'bias': -0.3},
            ('effort', lambda x: x + np.array([0.0, -0.3, 0.0])),
        ),
    ],
)
def test_a_joint_sensor_is_wrong_at_its_joint_alone(effect, values, expected):
    entry = {'effect': effect, 'where': 'j_link_2', **values}
    states, efforts, samples = measure({'it': entry}, steps=10)
    name, change = expected
    for state, effort, sample in zip(states, efforts, samples, strict=True):
        true = {'position': state.q, 'velocity': state.qd, 'effort': effort}
        for channel, value in true.items():
            wanted = change(value) if channel == name else value
            np.testing.assert_allclose(
                getattr(sample.joints, channel), wanted, rtol=0, atol=1e-15
            )  # a rounding
        np.testing.assert_array_equal(sample.omega, state.omega_WB_B)


XYZ = {'x': 0.01, 'y': -0.02, 'z': 0.03}
VECTOR = np.array([0.01, -0.02, 0.03])


@pytest.mark.parametrize(
    ('effect', 'wanted'),
    [
        ('gyro_bias', lambda w: w + VECTOR),
        ('gyro_scale', lambda w: w * (1.0 + VECTOR)),
        # to first order omega + r x omega: the sign of the documentation
        ('gyro_misalignment', lambda w: Rotation.from_rotvec(VECTOR).apply(w)),
    ],
)
def test_a_gyro_is_wrong_as_documented(effect, wanted):
    states, _, samples = measure({'it': {'effect': effect, **XYZ}}, steps=5)
    for state, sample in zip(states, samples, strict=True):
        np.testing.assert_allclose(sample.omega, wanted(state.omega_WB_B), rtol=0, atol=1e-16)
    first = samples[0].omega - states[0].omega_WB_B
    if effect == 'gyro_misalignment':
        np.testing.assert_allclose(
            first, np.cross(VECTOR, states[0].omega_WB_B), rtol=0, atol=1.5e-4
        )  # r^2 / 2


def test_a_tracker_stands_turned_in_the_base():
    entry = {'effect': 'attitude_misalignment', **XYZ}
    states, _, samples = measure({'it': entry}, steps=5)
    for state, sample in zip(states, samples, strict=True):
        wanted = rotation(state.q_WB_xyzw) * Rotation.from_rotvec(VECTOR)
        error = (wanted.inv() * rotation(sample.attitude_xyzw)).magnitude()
        assert error < 1e-15


@pytest.mark.parametrize('delay', [0.02, 0.0137])
def test_a_late_sensor_shows_the_past_and_leaves_the_others_alone(delay):
    entries = {'it': {'effect': 'imu_delay', 'delay': delay}}
    states, _, samples = measure(entries)
    whole, share = divmod(delay / 0.01, 1.0)
    for k in range(5, STEPS):
        old = states[k - int(whole) - (share > 0)], states[k - int(whole)]
        # the torque is held: the rate is straight within a step but for 1e-7 of curvature
        wanted = old[1].omega_WB_B + share * (old[0].omega_WB_B - old[1].omega_WB_B)
        np.testing.assert_allclose(samples[k].omega, wanted, rtol=0, atol=2e-8)
        np.testing.assert_array_equal(samples[k].joints.position, states[k].q)
        np.testing.assert_allclose(
            samples[k].attitude_xyzw, states[k].q_WB_xyzw, rtol=0, atol=1e-15
        )  # a rounding


@pytest.mark.parametrize('delay', [0.03, 0.0137])
def test_interpolation_agrees_with_a_finer_integration(delay):
    """Held torques at 10 ms, states at every 0.1 ms."""
    entries = {
        'a': {'effect': 'joint_delay', 'delay': delay},
        'b': {'effect': 'attitude_delay', 'delay': delay},
        'c': {'effect': 'imu_delay', 'delay': delay},
    }
    fine = plant_with(table_one(), {})
    fine = type(fine)(fine.robot, fine.state, 1e-4, 1)
    truth = []
    for k in range(100 * STEPS):
        truth.append(fine.state)
        fine.step(TORQUE * np.sin(0.05 * (k // 100) + np.arange(3)))
    _, _, samples = measure(entries)
    for k in range(5, STEPS):
        then = truth[100 * k - round(delay * 1e4)]
        sample = samples[k]
        # fourth derivatives over 10 ms: rates to 1e-10, positions below
        np.testing.assert_allclose(sample.joints.position, then.q, rtol=0, atol=1e-11)
        np.testing.assert_allclose(sample.joints.velocity, then.qd, rtol=0, atol=1e-9)
        np.testing.assert_allclose(sample.omega, then.omega_WB_B, rtol=0, atol=1e-9)
        turned = rotation(then.q_WB_xyzw).inv() * rotation(sample.attitude_xyzw)
        assert turned.magnitude() < 1e-11


def test_efforts_are_later_than_the_joints_by_their_own_delay():
    entries = {
        'a': {'effect': 'joint_delay', 'delay': 0.01},
        'b': {'effect': 'effort_delay', 'delay': 0.02},
    }
    states, efforts, samples = measure(entries)
    for k in range(4, STEPS):
        np.testing.assert_allclose(samples[k].joints.position, states[k - 1].q, rtol=0, atol=0)
        np.testing.assert_array_equal(samples[k].joints.effort, efforts[k - 3])


def test_before_the_start_the_robot_coasted():
    entries = {'it': {'effect': 'joint_delay', 'delay': 0.02}}
    states, _, samples = measure(entries, steps=3)
    for sample in samples:
        np.testing.assert_array_equal(sample.joints.velocity, states[0].qd)
        np.testing.assert_allclose(sample.joints.position, states[0].q, rtol=0, atol=0)  # at rest
        np.testing.assert_array_equal(sample.joints.effort, np.zeros(3))


def test_a_model_that_knows_the_faults_undoes_them():
    entries = {
        'a': {'effect': 'encoder_offset', 'where': 'j_link_1', 'offset': 0.02},
        'b': {'effect': 'encoder_scale', 'where': 'j_link_3', 'gain': 1.01},
        'c': {'effect': 'joint_rate_scale', 'where': 'j_link_2', 'gain': 0.98},
        'd': {'effect': 'torque_sensor_bias', 'where': 'j_link_2', 'bias': 0.4},
        'e': {'effect': 'gyro_bias', **XYZ},
        'f': {'effect': 'gyro_scale', **XYZ},
        'g': {'effect': 'gyro_misalignment', **XYZ},
        'h': {'effect': 'attitude_misalignment', **XYZ},
    }
    states, efforts, samples = measure(entries, steps=20)
    robot = robot_of(table_one())
    faults = SensorFaults(robot, bind_effects(entries, robot))
    for state, effort, sample in zip(states, efforts, samples, strict=True):
        j = sample.joints
        q, qd, tau = faults.undo_joints(j.position, j.velocity, j.effort)
        # a fixed point of three passes: the fault's relative size to the fourth
        np.testing.assert_allclose(q, state.q, rtol=0, atol=1e-8)
        np.testing.assert_allclose(qd, state.qd, rtol=0, atol=1e-8)
        np.testing.assert_allclose(tau, effort, rtol=0, atol=1e-12)
        np.testing.assert_allclose(
            faults.undo_rate(sample.omega), state.omega_WB_B, rtol=0, atol=5e-6
        )
        found = rotation(faults.undo_attitude(sample.attitude_xyzw))
        assert (found.inv() * rotation(state.q_WB_xyzw)).magnitude() < 1e-14


def test_a_record_is_corrected_as_a_whole():
    entries = {
        'a': {'effect': 'encoder_offset', 'where': 'j_link_1', 'offset': 0.02},
        'b': {'effect': 'joint_delay', 'delay': 0.01},
        'c': {'effect': 'effort_delay', 'delay': 0.02},
        'd': {'effect': 'gyro_bias', **XYZ},
        'e': {'effect': 'imu_delay', 'delay': 0.03},
        'f': {'effect': 'attitude_misalignment', **XYZ},
    }
    states, efforts, samples = measure(entries)
    stamps = 10_000_000 * np.arange(STEPS)
    record = Record(
        joints=JointSeries(
            robot_of(table_one()).joints,
            stamps,
            *(
                np.array([getattr(s.joints, name) for s in samples])
                for name in ('position', 'velocity', 'effort')
            ),
        ),
        rates=RateSeries(stamps, np.array([s.omega for s in samples])),
        attitudes=AttitudeSeries(stamps, np.array([s.attitude_xyzw for s in samples])),
    )
    robot = robot_of(table_one())
    right = corrected_record(record, robot, bind_effects(entries, robot))
    np.testing.assert_array_equal(right.joints.stamp_ns, stamps - 10_000_000)
    np.testing.assert_array_equal(right.rates.stamp_ns, stamps - 30_000_000)
    for k in range(5, STEPS - 3):
        np.testing.assert_allclose(right.joints.position[k], states[k - 1].q, rtol=0, atol=1e-12)
        np.testing.assert_allclose(right.joints.effort[k], efforts[k - 3], rtol=0, atol=1e-12)
        np.testing.assert_allclose(right.effort_time[k], 1e-2 * (k - 3), rtol=0, atol=1e-15)
        np.testing.assert_allclose(
            right.rates.omega[k], states[k - 3].omega_WB_B, rtol=0, atol=1e-15
        )
        turned = rotation(right.attitudes.q_xyzw[k]).inv() * rotation(states[k].q_WB_xyzw)
        assert turned.magnitude() < 1e-14
    assert corrected_record(record, robot, ()) is record


def test_the_history_is_as_long_as_it_must_be():
    history, state = StateHistory(), plant_with(table_one(), {}).state
    for k in range(50):
        history.add(0.01 * k, state, np.zeros(3), np.zeros(0), 0.05)
    assert len(history) == 7  # the step that spans the oldest time, and all after


@pytest.mark.parametrize(
    ('entry', 'message'),
    [
        ({'effect': 'imu_delay', 'delay': -0.01}, r'-0\.01 s must be at least 0'),
        ({'effect': 'encoder_scale', 'where': 'j_link_1', 'gain': 0.0}, 'must be above 0'),
        (
            {'effect': 'encoder_offset', 'where': 'joint_9', 'offset': 0.1},
            r"no place 'joint_9' \(it has j_link_1, j_link_2, j_link_3\)",
        ),
        ({'effect': 'gyro_bias', **XYZ, 'w': 0.0}, r'it\.w: gyro_bias has no such parameter'),
        ({'effect': 'gyro_bias', **XYZ, 'x': float('nan')}, 'nan is not a finite number'),
    ],
)
def test_bad_input_is_refused_with_its_place(entry, message):
    with pytest.raises(ConfigurationError, match=message):
        bind_effects({'it': entry}, robot_of(table_one()))


def test_random_faults_need_noise():
    sensors = SensorSettings(imu_dropout=0.5, imu_jitter=0.005, gyro_bias_walk=1e-3)
    states, _, samples = measure({}, sensors=sensors)
    for state, sample in zip(states, samples, strict=True):
        np.testing.assert_array_equal(sample.omega, state.omega_WB_B)
    _, _, noisy = measure({}, sensors=sensors, settings=replace(EXACT, noise=True))
    assert any(sample.omega is None for sample in noisy)
