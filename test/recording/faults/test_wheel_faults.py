"""Telemetry of own wheels against the conservation of momentum, in closed form."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation
from support.models import AXIS, Part, to_urdf

from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.recording.faults.data_faults import data_faults
from spacerobot_ros.recording.faults.wheel_faults import wheel_faults
from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries, Record
from spacerobot_ros.recording.robot_inputs import in_robot_order

WHEELS = ('w_x', 'w_y', 'w_z')
AXIAL, RPM = 0.02, 30.0 / np.pi
INERTIA = np.array([[3.0, 0.2, -0.1], [0.2, 4.0, 0.3], [-0.1, 0.3, 5.0]])


@pytest.fixture(scope='module')
def robot(tmp_path_factory):
    parts = [Part('base_link', -1, 'base', 50.0, np.zeros(3), INERTIA)]
    for axis in 'xyz':
        own = AXIAL * (0.5 * np.eye(3) + 0.5 * np.diag(AXIS[axis]))
        parts.append(Part(f'w_{axis}', 0, 'continuous', 1.0, np.zeros(3), own, AXIS[axis]))
    folder = tmp_path_factory.mktemp('body')
    (folder / 'body.urdf').write_text(to_urdf(parts))
    wheels = {'joints': [f'j_{wheel}' for wheel in WHEELS], 'rates': [0.0, 0.0, 0.0]}
    settings = {'robot': {'urdf': 'body.urdf', 'joints': [], 'servicer_wheels': wheels}}
    (folder / 'body.yaml').write_text(yaml.safe_dump({'/**': {'ros__parameters': settings}}))
    return load_robot_file(folder / 'body.yaml').robot


def record_of(robot, factors, seconds=20.0):
    """A body that swings about an oblique axis as its wheels make it, and they say `factors`."""
    time = np.arange(0.0, seconds, 0.02)
    axis = np.array([0.6, -0.48, 0.64])
    angle, rate = 0.5 * np.sin(0.4 * time), 0.2 * np.cos(0.4 * time)
    rotation = Rotation.from_rotvec(angle[:, None] * axis)
    omega = rate[:, None] * axis
    total = rotation.inv().apply([2.0, -1.0, 1.5])
    spins = (total - omega @ robot.bodies[0].inertia.T) / AXIAL
    stamps = (1e9 * time).astype(int)
    names = tuple(f'j_{wheel}' for wheel in WHEELS)
    wheels = JointSeries(names, stamps, np.zeros_like(spins), spins * factors)
    rates, attitudes = RateSeries(stamps, omega), AttitudeSeries(stamps, rotation.as_quat())
    return in_robot_order(Record(None, rates, attitudes, wheels=wheels), robot)


@pytest.mark.parametrize(
    ('factors', 'words'),
    [
        ([1.0, -1.0, 1.0], 'wheels/j_w_y: of the wrong sign'),
        ([-1.0, -1.0, -1.0], 'wheels: all rates are of the wrong sign'),
        ([RPM, RPM, RPM], 'wheels: all rates are in rpm instead of rad/s'),
        ([1.0, 1.0, 1.0 / RPM], 'wheels/j_w_z: rates are converted as if they were in rpm'),
    ],
)
def test_a_slip_of_wheels_is_named(robot, factors, words):
    assert data_faults(record_of(robot, factors), robot) == (words,)


def test_right_wheels_have_no_slip_nor_have_bodies_that_are_off(robot):
    record = record_of(robot, [1.0, 1.0, 1.0])
    assert wheel_faults(record, robot) == ()
    for share in (0.7, 1.4):
        other = robot.with_inertial_parameters(share * robot.inertial_parameters)
        assert wheel_faults(record, other) == ()
    assert wheel_faults(record_of(robot, [1.0, 1.1, 1.0]), robot) == ()  # a scale is a cause


def test_a_slip_is_named_beside_a_body_that_is_a_quarter_off(robot):
    other = robot.with_inertial_parameters(1.25 * robot.inertial_parameters)
    (fault,) = wheel_faults(record_of(robot, [1.0, -1.0, 1.0]), other)
    assert fault.place == 'wheels/j_w_y'
