"""Samples that contradict their forerunners: left out at once, and no real motion is."""

import numpy as np
import pytest

from spacerobot_ros.control.command import Feedback
from spacerobot_ros.control.sample_screen import ErrorScale, SampleScreen
from spacerobot_ros.model.control_settings import ControllerSettings
from spacerobot_ros.model.robot_settings import SensorSettings

PERIOD, MS = 0.01, 1_000_000
STD = {'joint_position_std': 2e-5, 'joint_velocity_std': 2e-4, 'gyro_std': 2e-5}
NOISE = SensorSettings(**STD, attitude_std=3e-5)


def screen(sensors=NOISE):
    return SampleScreen(sensors, ControllerSettings(state_timeout=0.05))


def motion(k):
    t = PERIOD * k
    return np.array([0.4 * np.sin(2 * t), 0.3 * np.cos(3 * t)]), np.array(
        [0.8 * np.cos(2 * t), -0.9 * np.sin(3 * t)]
    )


def measured(rng, count):
    for k in range(count):
        q, qd = motion(k)
        yield k, q + 2e-5 * rng.standard_normal(2), qd + 2e-4 * rng.standard_normal(2)


@pytest.mark.parametrize('sensors', [NOISE, SensorSettings()])
@pytest.mark.parametrize('size', [0.05, 1e300])
def test_single_samples_of_any_size_never_reach_the_law(rng, sensors, size):
    gate, bad, worst = screen(sensors), 0, np.zeros(2)
    for k, q, qd in measured(rng, 600):
        if k > 60 and k % 17 == 0:
            bad += 1
            (q if k % 2 else qd)[k % 3 % 2] += size * (1 if k % 4 < 2 else -20)
        got = gate.joints(k * 10 * MS, q, qd)
        worst = np.maximum(
            worst, [np.abs(x - y).max() for x, y in zip(got, motion(k), strict=True)]
        )
    # what stands in is off by noise and by acceleration x period, at most 3 rad/s^2 x 10 ms
    assert np.all(worst < [5e-4, 0.03])
    assert bad <= gate.left_out['joints'] <= bad + 10


def test_good_samples_are_taken_as_they_are(rng):
    gate = screen()
    for k, q, qd in measured(rng, 1000):
        got_q, got_qd = gate.joints(k * 10 * MS, q, qd)
        assert got_q is q
        assert got_qd is qd
    assert gate.left_out['joints'] == 0


@pytest.mark.parametrize('rate', [10, 25, 100])
def test_torques_that_set_in_cost_nothing(rng, rate):
    gate = SampleScreen(NOISE, ControllerSettings(state_timeout=5.0 / rate))
    q, qd, worst = np.zeros(3), np.zeros(3), 0.0
    for k in range(400):  # a loop holds its torques from sample to sample
        noisy = q + 2e-5 * rng.standard_normal(3), qd + 2e-4 * rng.standard_normal(3)
        got = gate.joints(round(k * 1e9 / rate), *noisy)
        worst = max(worst, *np.abs(got[0] - q), *np.abs(got[1] - qd))
        if k % 9 == 0:
            acceleration = np.clip(rng.uniform(-5.0, 5.0, 3) - 2.0 * qd, -5.0, 5.0)
        q = q + qd / rate + 0.5 * acceleration / rate**2
        qd = qd + acceleration / rate
    # of 45 torques those may be doubted, for two samples, that noise hides: T d / 2 < 10 std
    assert gate.left_out['joints'] <= 8
    assert worst < max(40.0 * np.sqrt(2.0) * 2e-5 * rate, 16.0 * 2e-4)


@pytest.mark.parametrize('rate', [10, 50, 200, 1000])
@pytest.mark.parametrize('lost', [0.05, 0.3])
def test_seldom_and_unsteady_samples_are_good_ones(rng, rate, lost):
    gate = SampleScreen(NOISE, ControllerSettings(state_timeout=20.0 / rate))
    ticks = np.arange(600.0)[rng.random(600) > lost]
    bad = 0
    for k, t in enumerate((ticks + rng.uniform(-0.4, 0.4, len(ticks))) / rate):
        turn = t * np.array([2.0, 6.0, 9.0])
        q = 0.3 * np.sin(turn) + 2e-5 * rng.standard_normal(3)
        qd = 0.3 * np.array([2.0, 6.0, 9.0]) * np.cos(turn) + 2e-4 * rng.standard_normal(3)
        if k > 60 and k % 23 == 0:
            bad += 1
            (q if k % 2 else qd)[k % 3] += 50.0
        gate.joints(round(1e9 + t * 1e9), q, qd)
    assert bad <= gate.left_out['joints'] <= bad + 2


def test_what_was_foretold_is_believed_and_no_fault_is():
    still, taken = np.zeros(2), []
    for turn, fault in ((0.5, 0.0), (0.0, 0.5), (0.5, 0.5)):
        gate = screen()
        for k in range(20):
            gate.joints(k * 10 * MS, still + 1e-7 * k, still)
            gate.takes_rate(k * 10 * MS, np.zeros(3))
        # the rate turns within the period, so that positions don't tell
        rate, omega = np.array([turn, 0.0]), np.array([0.0, turn, 0.0])
        foretold = Feedback(still, 1.1 * rate, 1.1 * omega, np.zeros(3))
        measured = rate + np.array([0.0, fault])
        taken.append(gate.joints(200 * MS, still, measured, foretold)[1] is measured)
        taken.append(gate.takes_rate(200 * MS, omega + np.array([0.0, 0.0, fault]), foretold))
    assert taken == [True, True, False, False, False, False]


def test_an_encoder_that_stands_still_while_its_rate_moves_is_lost(rng):
    gate, stuck, lost = screen(), None, []
    for k, q, qd in measured(rng, 100):
        stuck = q if k <= 50 else stuck
        gate.joints(k * 10 * MS, stuck, qd)
        lost.append(gate.is_lost(k * 10 * MS))
    assert not any(lost[:54])
    assert all(lost[57:])


def test_what_comes_after_a_pause_is_compared_with_nothing(rng):
    gate = screen()
    for k, q, qd in measured(rng, 50):
        gate.joints(k * 10 * MS, q, qd)
    far = np.array([2.0, -2.0])
    assert gate.joints(700 * MS, far, far)[0] is far
    assert not gate.is_lost(700 * MS)


def test_gyro_and_tracker(rng):
    gate, axis = screen(), np.array([1.0, 0.0, 0.0])
    for k in range(300):
        omega = 0.1 * np.sin(0.05 * k) * axis + 2e-5 * rng.standard_normal(3)
        if k in (120, 250):
            omega = omega + 1e200
        assert gate.takes_rate(k * 10 * MS, omega) == (k not in (120, 250))
    level = np.array([0.0, 0.0, 0.0, 1.0])
    tilted = np.array([np.sin(0.05), 0.0, 0.0, np.cos(0.05)])
    answers = []
    for k in range(300, 310):  # from 306 on the tracker really is turned
        seen = tilted if k in (303, 306, 307, 308, 309) else level
        predicted = tilted if k >= 308 else level
        answers.append(gate.takes_attitude(k * 100 * MS, seen, predicted))
    assert answers == [True, True, True, False, True, True, False, True, True, True]
    assert gate.left_out == {'imu': 2, 'attitude': 2}


def test_without_a_stated_noise_that_of_the_data_counts():
    scale = ErrorScale(0.0)
    for error in (0.1, -0.1, 0.12, -0.09, 0.1):
        scale.limit(np.array([error]), 1.0)
    assert 0.6 < scale.limit(np.array([50.0]), 1.0)[0] < 1.2
