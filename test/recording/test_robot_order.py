"""Joints of a recording in the robot's order: all that belongs to one goes with it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from spacerobot_ros.errors import RecordingError
from spacerobot_ros.recording.record import JointSeries, RateSeries, Record
from spacerobot_ros.recording.robot_inputs import in_robot_order

STAMPS = np.arange(4) * 10_000_000
ARM = SimpleNamespace(arm=('a', 'b', 'c'))


def test_every_column_follows_its_joint():
    value = np.arange(12.0).reshape(4, 3)
    off = np.zeros((4, 3), bool)
    off[:, 0] = True  # of c
    joints = JointSeries(('c', 'a', 'b'), STAMPS, value, value + 20.0, value + 40.0, unpowered=off)
    found = in_robot_order(Record(joints=joints), ARM).joints
    assert found.names == ARM.arm
    np.testing.assert_array_equal(found.position[0], [1.0, 2.0, 0.0])
    np.testing.assert_array_equal(found.velocity[0], [21.0, 22.0, 20.0])
    np.testing.assert_array_equal(found.effort[0], [41.0, 42.0, 0.0])  # no motor, no torque
    np.testing.assert_array_equal(found.unpowered.all(axis=0), [False, False, True])


def test_absent_columns_stay_absent():
    found = in_robot_order(Record(joints=JointSeries(ARM.arm[::-1], STAMPS, np.eye(4, 3))), ARM)
    assert (found.joints.velocity, found.joints.effort, found.joints.unpowered) == (None,) * 3


def test_without_joints_the_base_gives_the_times():
    rates = RateSeries(STAMPS, np.ones((4, 3)))
    found = in_robot_order(Record(rates=rates), SimpleNamespace(arm=()))
    np.testing.assert_array_equal(found.joints.stamp_ns, STAMPS)
    assert found.joints.position.shape == (4, 0)


def test_other_joints_are_refused_by_name():
    record = Record(
        joints=JointSeries(('a', 'b', 'd'), STAMPS, np.zeros((4, 3))), source='run.csv'
    )
    with pytest.raises(RecordingError, match=r'run.csv: joints.*the robot has a, b, c'):
        in_robot_order(record, ARM)
