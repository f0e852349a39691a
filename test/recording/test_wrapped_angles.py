"""Angles that begin anew go on; what slides, jumps or turns too fast stays."""

from dataclasses import replace

import numpy as np
import pytest

from spacerobot_ros.recording.faults.wrapped_angles import with_turns_counted
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps
from validation.hidden.diagnosis_scenario import packaged

TIME = np.arange(0.0, 20.0, 0.01)


@pytest.fixture(scope='module')
def robot():
    """Return a robot with three joints that turn."""
    return packaged('servicer').robot


def record_of(robot, angle):
    """One of its joints goes along an angle (N,), the others stand."""
    q = np.zeros((len(angle), robot.n_joints))
    q[:, 1] = angle
    time = to_stamps(TIME[: len(angle)])
    return Record(joints=JointSeries(robot.joints, time, q, None, None), source='run')


def wrapped(angle, start):
    """The angle within the turn that begins there."""
    return start + np.mod(angle - start, 2.0 * np.pi)


@pytest.mark.parametrize('start', [-np.pi, 0.0, 1.0])
@pytest.mark.parametrize(
    'angle', [3.0 * TIME, 4.0 * np.sin(TIME), -2.9 + 0.5 * np.sin(5.0 * TIME)]
)
def test_turns_are_counted(robot, start, angle):
    logged = wrapped(angle, start)
    counted = with_turns_counted(record_of(robot, logged), robot)
    assert counted.joints is not None
    went_round = bool(np.any(np.abs(np.diff(logged)) > np.pi))
    np.testing.assert_allclose(
        np.diff(counted.joints.position[:, 1]), np.diff(angle), rtol=0.0, atol=1e-12
    )
    assert (f'{robot.joints[1]}: angles begin anew' in ''.join(counted.notes)) == went_round


@pytest.mark.parametrize('span', [25.0, 4.0 * np.pi, 1.3])
@pytest.mark.parametrize('speed', [0.8, -0.8, 0.05])
def test_any_range_is_counted(robot, rng, span, speed):
    """What a driver's whole numbers can say, or a turn of a motor before its gear."""
    angle = speed * span * TIME + 0.1 * span * np.sin(0.7 * TIME)
    step = span / 65535.0
    read = step * np.round((angle + rng.normal(0.0, step, len(TIME))) / step)
    counted = with_turns_counted(record_of(robot, np.mod(read + 0.4 * span, span)), robot)
    turned = counted.q[:, 1] - angle
    # a range is as well known as the way between two samples: some steps and noise, each time
    np.testing.assert_allclose(turned, turned[0], rtol=0.0, atol=6.0 * 17 * step)
    assert 'joint_2: angles begin anew after ' in ''.join(counted.notes)


@pytest.mark.parametrize(
    'angle',
    [
        np.where(np.abs(TIME - 10.0) < 0.5, 0.0, 3.0 * TIME),  # reads nothing for a second
        np.where(TIME > 10.0, 3.0 * TIME - 9.0, 3.0 * TIME),  # set anew on its way
        np.where(TIME > 10.0, 0.3 * TIME - 4.0, 3.0 * TIME),  # another joint from there on
        30.0 * np.sign(np.sin(TIME)) + 0.1 * TIME,  # from end to end, but not going on
    ],
)
def test_other_jumps_stay(robot, angle):
    record = record_of(robot, angle)
    assert with_turns_counted(record, robot).notes == ()


@pytest.mark.parametrize(
    'angle',
    [
        wrapped(200.0 * TIME, -np.pi),  # a third of a turn from sample to sample
        np.where(TIME > 10.0, 4.0, 0.0),  # one jump
        7.0 * np.sin(TIME),  # more than a turn: none begins anew
    ],
)
def test_what_is_of_no_turn_stays(robot, angle):
    record = record_of(robot, angle)
    kept = with_turns_counted(record, robot)
    np.testing.assert_array_equal(kept.q, record.q)
    assert kept.notes == ()


def test_a_bad_sample_does_not_hide_the_turns(robot):
    logged = wrapped(3.0 * TIME, -np.pi)
    logged[500] = 0.9 * logged[500] + 2.0
    counted = with_turns_counted(record_of(robot, logged), robot)
    others = np.arange(len(TIME)) != 500
    turned = counted.q[others, 1] - 3.0 * TIME[others]
    np.testing.assert_allclose(turned - turned[0], 0.0, rtol=0.0, atol=1e-9)


def test_after_a_pause_the_next_turn_is_as_good_as_any(robot):
    """Nobody saw how often it went round meanwhile: angles are the same but for whole turns."""
    logged = wrapped(3.0 * TIME, -np.pi)
    record = record_of(robot, logged)
    kept = np.abs(TIME - 10.0) > 1.0
    record = replace(record, joints=record.joints.at(kept))
    counted = with_turns_counted(record, robot)
    turns = (counted.q[:, 1] - 3.0 * TIME[kept]) / (2.0 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), rtol=0.0, atol=1e-9)
    assert counted.notes
