"""A joint that touches its limit: right samples, no cause, momentum kept."""

from dataclasses import replace

import numpy as np
import pytest
from support.identification import STOPS, measure, servicer, simulate
from support.models import H_TARGET

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.quality.quality import check_record
from spacerobot_ros.dynamics.equations import joint_torques
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.identification.batch import identify
from spacerobot_ros.model.settings import IdentifierSettings
from spacerobot_ros.recording.faults.joint_limits import with_stops
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps

TIME = np.arange(2001) / 100.0
LIMITS = np.array([-0.4, 0.5])


def limited(low, high):
    """Table I's robot, limits at its second joint."""
    robot = servicer()
    limits = robot.position_limits.copy()
    limits[1] = low, high
    return replace(robot, position_limits=limits)


def record_of(q, time=TIME):
    """Positions of the second joint; the others turn."""
    others = np.column_stack([np.sin(time), np.cos(time)])
    position = np.column_stack([others[:, 0], q, others[:, 1]])
    return Record(JointSeries(('joint_1', 'joint_2', 'joint_3'), to_stamps(time), position))


SWING = 0.45 * np.sin(TIME)


@pytest.mark.parametrize(
    ('q', 'limits', 'note'),
    [
        (np.minimum(1.2 * SWING, 0.5), (-0.6, 0.5), 'joint_2 reaches its limit 3 times'),
        (np.maximum(SWING, -0.4), LIMITS, 'joint_2 reaches its limit 3 times'),
        (np.full_like(TIME, 0.5002), LIMITS, 'joint_2 rests on its limit throughout'),
        (np.where(TIME < 1.0, 0.9, 0.3 + 0.1 * SWING), LIMITS, 'joint_2 reaches its limit 1 time'),
        (0.8 * SWING, LIMITS, None),  # turns before the limit
        (2.0 * SWING, LIMITS, None),  # goes on beyond: no stop
        (np.degrees(SWING), LIMITS, None),  # another unit
        (SWING, (-np.inf, np.inf), None),
    ],
)
def test_moments_at_a_limit_are_counted(q, limits, note):
    seen = with_stops(record_of(q), limited(*limits))
    if note is None:
        assert seen.notes == ()
        assert seen.joints.stopped is None
    else:
        (said,) = seen.notes
        assert said.startswith(note)


def test_a_bounce_between_two_samples_is_seen():
    """At 2 rad/s a joint comes no nearer than 5 mrad to its limit in any sample."""
    q = 0.5 - np.abs(2.0 * (TIME - 10.0025)) / (1.0 + np.abs(TIME - 10.0))
    assert np.max(q) < 0.5 - 4e-3
    where = np.flatnonzero(with_stops(record_of(q), limited(*LIMITS)).joints.stopped[:, 1])
    assert {1000, 1001} <= set(where)
    assert len(where) < 6


def test_momentum_is_found_although_a_joint_is_thrown_back():
    """A stop is an inner torque: without its limit the model does not explain the data."""
    record = measure(simulate('zyx', 20.0, 'thrown_back'), seed=1)
    known = identify(record, limited(*STOPS), IdentifierSettings()).estimate
    assert known.valid, known.reason
    assert np.all(np.abs(known.aam - H_TARGET) < 3.0 * known.std[:3])
    assert any('j_link_2 reaches its limit 14 times' in note for note in known.notes)
    assert not identify(record, servicer(), IdentifierSettings()).estimate.valid


ARM = """<robot name="arm">
  <link name="base_link"/>
  <link name="upper"><inertial><origin xyz="0.3 0 0"/><mass value="5"/>
    <inertia ixx="0.02" iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.25 0 0"/><mass value="3"/>
    <inertia ixx="0.01" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base_link"/><child link="upper"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="100" velocity="5"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.6 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="0.3" effort="60" velocity="5"/></joint>
</robot>"""
FILE = """/**:
  ros__parameters:
    robot:
      urdf: arm.urdf
      base: fixed
      base_link: base_link
      gravity: [0.0, 0.0, -9.81]
      joints: [shoulder, elbow]
    sensors: {joint_position_std: 2.0e-5, joint_velocity_std: 2.0e-4, joint_effort_std: STD}
"""


def arm_file(folder, std=0.02):
    (folder / 'arm.urdf').write_text(ARM)
    text = FILE.replace('STD', str(std)) if std else FILE.replace(', joint_effort_std: STD', '')
    (folder / 'arm.yaml').write_text(text)
    return load_robot_file(folder / 'arm.yaml')


def thrown_back(robot, seed=1):
    """20 s of both joints, the elbow reflected at its limit, which no motor does."""
    time, rng = np.arange(2001) / 100.0, np.random.default_rng(seed)
    waves = np.array([[0.5, 0.7], [0.45, 1.1]]), np.array([[0.2, 1.9], [0.2, 2.3]])
    q, qd, qdd = (
        sum(
            w[:, 0] * w[:, 1] ** k * np.sin(w[:, 1] * time[:, None] + k * np.pi / 2.0)
            for w in waves
        )
        for k in range(3)
    )
    over = q[:, 1] > 0.3
    q[over, 1] = 0.6 - q[over, 1]
    qd[over, 1], qdd[over, 1] = -qd[over, 1], -qdd[over, 1]
    tau = joint_torques(robot, q, qd, qdd, np.zeros((len(time), 3)))
    noise = [s * rng.standard_normal(q.shape) for s in (2e-5, 2e-4, 0.02)]
    joints = JointSeries(
        ('shoulder', 'elbow'), to_stamps(time), q + noise[0], qd + noise[1], tau + noise[2]
    )
    return Record(joints)


@pytest.mark.parametrize('std', [0.02, None])
def test_an_arm_that_touches_its_limit_is_consistent(tmp_path, std):
    """By prediction and by the balance of torques."""
    file = arm_file(tmp_path, std)
    record = with_stops(thrown_back(file.robot), file.robot)
    assert 'elbow reaches its limit' in record.notes[0]
    found = diagnose(record, file.robot)
    assert (found.verdict, found.causes) == ('consistent', ())
    assert not found.events.all


def test_check_finds_no_delay_in_a_bounce(tmp_path):
    file = arm_file(tmp_path)
    quality = check_record(with_stops(thrown_back(file.robot), file.robot), file)
    assert not [
        line for line in quality.findings if 'later than' in line or 'times as far' in line
    ]
    assert not quality.faults
    assert any('elbow reaches its limit' in note for note in quality.notes)
