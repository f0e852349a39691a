"""What a recording is worth, against signals whose errors are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation
from support.models import AXIS, Part, settings_of, to_urdf

from spacerobot_ros.diagnosis.quality.allan import allan
from spacerobot_ros.diagnosis.quality.excited import excited
from spacerobot_ros.diagnosis.quality.quality import check_record
from spacerobot_ros.diagnosis.quality.readings import readings
from spacerobot_ros.diagnosis.quality.sampling import delay_of, discrepancies, samplings
from spacerobot_ros.effects.robot_file import RobotFile
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries, Record

STEP = 0.01


def stamps(time):
    return np.round(np.asarray(time) * 1e9).astype(np.int64)


def joints(time, q, qd=None, effort=None):
    names = tuple(f'joint_{i + 1}' for i in range(q.shape[1]))
    return JointSeries(names, stamps(time), q, qd, effort)


def channel(record, name, robot=None):
    return next(one for one in readings(record, robot) if one.channel == name)


@pytest.mark.parametrize(('white', 'walk'), [(1e-3, 0.0), (1e-3, 3e-4)])
def test_white_noise_and_random_walk_of_a_rate_are_told_apart(rng, white, walk):
    time = np.arange(0.0, 400.0, STEP)
    bias = np.cumsum(walk * np.sqrt(STEP) * rng.standard_normal((len(time), 3)), axis=0)
    rate = bias + white / np.sqrt(STEP) * rng.standard_normal((len(time), 3))
    found = allan('gyro', time, STEP * np.cumsum(rate, axis=0))
    # 40,000 samples an axis tell the white part within a per cent, 20 stretches the walk in 15 %
    assert found.white == pytest.approx(white, rel=0.05)
    if walk:
        assert found.random_walk == pytest.approx(walk, rel=0.4)
    else:
        assert found.random_walk is None
        assert found.most_walk < 1e-4


def test_noise_of_the_angle_is_no_noise_of_the_rate(rng):
    time = np.arange(0.0, 100.0, 0.1)
    found = allan('gyro', time, 2e-4 * rng.standard_normal((len(time), 3)))
    assert found.angle == pytest.approx(2e-4, rel=0.1)
    assert found.random_walk is None


def test_gaps_lost_samples_and_jitter(rng):
    time = np.arange(0.0, 20.0, STEP)
    late = np.clip(3e-4 * rng.standard_normal(len(time)), -4e-3, 4e-3)
    kept = (time < 5.0) | (time > 6.0)
    kept[::50] = False
    record = Record(joints((time + late + 1.0)[kept], np.zeros((kept.sum(), 1))))
    one = samplings(record)[0]
    assert one.rate == pytest.approx(100.0, rel=0.01)
    assert one.jitter == pytest.approx(3e-4, rel=0.1)
    assert (one.gaps, one.longest_gap) == (1, pytest.approx(1.0, abs=0.03))
    assert one.lost == pytest.approx(1.0 - kept.sum() / len(time), abs=0.002)


@pytest.fixture(scope='module')
def turning():
    """Times and attitudes of a base that turns in every direction, at 500 Hz, and its rates."""
    time = np.arange(0.0, 40.0, 2e-3)
    omega = 0.3 * np.sin(np.outer(time, [0.7, 1.1, 1.7]) + np.arange(3.0))
    attitude = [Rotation.identity()]
    middle = 0.5 * (omega[1:] + omega[:-1])
    for turn in Rotation.from_rotvec(2e-3 * middle):
        attitude.append(attitude[-1] * turn)
    return time, omega, Rotation.concatenate(attitude)


@pytest.mark.parametrize('late', [0.0, 0.02, -0.013])
def test_delay_of_the_attitude_is_found_beside_bias_scale_and_axes(turning, rng, late):
    time, omega, attitude = turning
    error = 1e-3 * rng.standard_normal((3, 3))
    gyro = omega @ (np.eye(3) + error).T + [1e-3, -2e-3, 5e-4]
    own = slice(500, -500, 50)
    noise = Rotation.from_rotvec(3e-5 * rng.standard_normal((len(time[own]), 3)))
    record = Record(
        rates=RateSeries(stamps(time[::5]), gyro[::5]),
        attitudes=AttitudeSeries(stamps(time[own] + late), (attitude[own] * noise).as_quat()),
    )
    (pair,) = discrepancies(record)
    found = delay_of(pair)
    # 380 attitudes within 3e-5 rad at 0.3 rad/s: 1e-5 s; the scale's rest is second order
    assert found.delay == pytest.approx(late, abs=1e-4)
    assert found.std < 1e-4


def test_joint_rates_that_were_filtered_are_late():
    time = np.arange(0.0, 30.0, STEP)
    q = np.column_stack([np.sin(time), np.cos(1.7 * time)])
    rate = np.column_stack([np.cos(time), -1.7 * np.sin(1.7 * time)])
    # first-order low-pass at 0.04 s: a delay of as much for slow motions
    pole = np.exp(-STEP / 0.04)
    slow = lfilter([1.0 - pole], [1.0, -pole], rate - rate[0], axis=0) + rate[0]
    found = check_record(Record(joints(time, q, slow)))
    (line,) = (line for line in found.findings if 'later' in line)
    assert line.startswith('joint_velocity is 0.0')
    assert found.delays[0].delay == pytest.approx(-0.04 + STEP / 2, rel=0.1)


@pytest.mark.parametrize('scale', [1.66, 0.5, 1.0])
def test_rates_of_a_wrong_scale_are_said(rng, scale):
    """As of a driver that was told of another motor; a joint that stands has none."""
    time = np.arange(0.0, 60.0, STEP)
    turned = np.sin(time) + 0.3 * time
    rate = (np.cos(time) + 0.3) / scale + 0.01 * rng.standard_normal(len(time))
    still = 1e-4 * rng.standard_normal(len(time))
    q = np.column_stack([turned + 1e-4 * rng.standard_normal(len(time)), still])
    qd = np.column_stack([rate, 0.01 * rng.standard_normal(len(time))])
    found = [f for f in check_record(Record(joints=joints(time, q, qd))).findings if 'as far' in f]
    assert len(found) == (scale != 1.0)
    if found:
        assert found[0].startswith('joint_velocity/joint_1: the positions go ')
        said = float(found[0].split(' go ')[1].split()[0])
        assert said == pytest.approx(scale, rel=0.01)


def test_cut_off_readings_are_saturated_and_resting_ones_are_not():
    time = np.arange(0.0, 20.0, STEP)
    wave = np.sin(time)[:, None] * [1.0, 1.0, 1.0]
    wave[:, 0] = np.clip(wave[:, 0], -0.6, 0.6)
    wave[:, 1] = np.round(wave[:, 1] / 0.02) * 0.02  # rests on its top step as it turns back
    wave[:, 2] = np.sin(np.minimum(time, 0.5 * np.pi))  # comes to rest at its top
    record = Record(rates=RateSeries(stamps(time), wave))
    assert channel(record, 'gyro/x').saturated == pytest.approx(0.6, abs=0.02)  # 1 - 2/pi asin .6
    assert channel(record, 'gyro/y').saturated == 0.0
    assert channel(record, 'gyro/z').saturated == 0.0
    assert channel(record, 'gyro/y').step == pytest.approx(0.02)


def arm():
    """Two balanced bodies about axes at right angles: I q'' is all the torque there is."""
    zero = np.zeros(3)
    base = Part('base_link', -1, 'base', 10.0, zero, np.eye(3))
    first = Part('first', 0, 'revolute', 1.0, zero, 0.3 * np.eye(3), AXIS['z'])
    second = Part('second', 1, 'revolute', 1.0, zero, 0.2 * np.eye(3), AXIS['x'])
    settings = settings_of([base, first, second], base='fixed')
    return RobotFile(build_robot(settings, to_urdf([base, first, second])), settings)


def swung(rng, moves):
    """20 s of the arm with friction of 0.1 N m s/rad and white noise of 5 mN m."""
    time = np.arange(0.0, 20.0, STEP)[:, None]
    amplitude, pace = np.array([0.8, 0.6]) * moves, np.array([2.1, 3.3])
    q = amplitude * np.sin(pace * time)
    rate = amplitude * pace * np.cos(pace * time)
    torque = -(pace**2) * q * [0.5, 0.2] + 0.1 * rate
    effort = torque + 5e-3 * rng.standard_normal(torque.shape)
    q = q + 1e-6 * rng.standard_normal(q.shape)
    names = ('j_first', 'j_second')
    return Record(JointSeries(names, stamps(time[:, 0]), q, rate, effort))


def test_unknowns_of_a_joint_at_rest_are_not_seen(rng):
    file = arm()
    found = {(one.effect, one.where): one for one in excited(swung(rng, [1.0, 1.0]), file)}
    for joint in file.robot.joints:
        one = found['joint_viscous_friction', joint]
        assert one.status == 'told'
        # noise of the sensors alone would leave 5e-3 / (rate's rms ~ 1.2 * sqrt(2000)) = 9e-5
        assert 5e-5 < one.alone < 0.02
    quality = check_record(swung(rng, [1.0, 0.0]), file)
    assert [line for line in quality.findings if 'none of its effects' in line] == [
        'j_second: the motion shows none of its effects'
    ]


def test_faults_are_named_and_leave_no_excitation(rng):
    record = swung(rng, [1.0, 1.0])
    wrong = replace(record.joints, velocity=np.degrees(record.joints.velocity))
    quality = check_record(replace(record, joints=wrong), arm())
    assert 'degrees instead of radians' in quality.findings[0]
    assert quality.excitation is None
    assert quality.to_json()['excitation_not_computed'] == 'the data are faulty'


def test_noise_is_held_against_what_is_stated(rng):
    file = arm()
    sensors = replace(file.robot.sensors, joint_velocity_std=1e-4, joint_effort_std=0.05)
    robot = replace(file.robot, sensors=sensors)
    record = swung(rng, [1.0, 1.0])
    noisy = record.joints.velocity + 1e-3 * rng.standard_normal(record.joints.velocity.shape)
    quality = check_record(
        replace(record, joints=replace(record.joints, velocity=noisy)), replace(file, robot=robot)
    )
    assert (
        sum('joint_velocity/' in line and 'states 0.0001' in line for line in quality.findings)
        == 2
    )
    assert sum('joint_effort/' in line and 'filtered' in line for line in quality.findings) == 2
    seen = channel(record, 'joint_effort/j_first', robot)
    assert (seen.noise, seen.stated) == (pytest.approx(5e-3, rel=0.1), 0.05)
