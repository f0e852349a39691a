"""The loop without ROS: tracks, keeps momentum, and records the same bytes for the same seed."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from support.models import (
    WHEEL_SPIN,
    robot_of,
    settings_of,
    table_one,
    wheel_joints,
    with_wheels,
)

from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import ConfigurationError, RecordingError, SimulationDivergedError
from spacerobot_ros.recording.bags.bag import read_bag
from spacerobot_ros.recording.bags.message_types import typestore
from spacerobot_ros.simulation.closed_loop import ClosedLoop, record_run

CONFIG = Path(__file__).resolve().parents[2] / 'config' / 'servicer.yaml'


@pytest.fixture(scope='module')
def servicer():
    """Return the robot file of the paper's servicer."""
    return load_robot_file(CONFIG)


def changed(settings, **sections):
    """Settings with some entries of some sections changed."""
    return replace(
        settings, **{k: replace(getattr(settings, k), **v) for k, v in sections.items()}
    )


def knowing(file):
    """Settings under which the model is the truth and the sensors are exact."""
    momentum = file.settings.truth.target_momentum
    settings = changed(file.settings, simulator={'noise': False})
    return file.robot.with_target_momentum(np.array(momentum)), settings


def digest(folder):
    content = hashlib.sha256()
    for path in sorted(folder.iterdir()):
        content.update(path.name.encode() + b'\0' + path.read_bytes())
    return content.hexdigest()


def test_whoever_knows_the_wheels_tracks_and_whoever_does_not_is_off(servicer, tmp_path):
    robot, settings = knowing(servicer)
    right = record_run(ClosedLoop(robot, settings), 1000, tmp_path / 'right')
    wrong = record_run(ClosedLoop(servicer.robot, settings), 1000, tmp_path / 'wrong')
    # the regime of the paper: degrees without the AAM; with it, what sampling at 100 Hz leaves
    assert np.degrees(wrong.max_joint_error) > 1.0
    assert right.max_joint_error < wrong.max_joint_error / 200
    for run in (right, wrong):
        assert run.momentum_drift < 1e-10
        assert run.steps == 1000
        assert run.duration == 10.0
        assert run.saturated == 0


def test_same_seed_same_bag_and_another_seed_another(servicer, tmp_path):
    digests = []
    for name, seed in (('a', 1), ('b', 1), ('c', 2)):
        settings = changed(servicer.settings, simulator={'seed': seed})
        record_run(ClosedLoop(servicer.robot, settings), 100, tmp_path / name)
        digests.append(digest(tmp_path / name))
    assert digests[0] == digests[1]
    assert digests[0] != digests[2]


def test_the_bag_holds_what_the_sensors_said(servicer, tmp_path):
    settings = changed(servicer.settings, simulator={'attitude_rate': 5.0, 'joint_rate': 50.0})
    steps = list(ClosedLoop(servicer.robot, settings).run(40))
    record_run(ClosedLoop(servicer.robot, settings), 40, tmp_path / 'bag')
    record = read_bag(tmp_path / 'bag', servicer.robot)
    np.testing.assert_array_equal(record.joints.stamp_ns, np.arange(0, 41, 2) * 10**7)
    np.testing.assert_array_equal(record.attitudes.stamp_ns, np.arange(3) * 2 * 10**8)
    np.testing.assert_array_equal(record.rates.omega, [s.measured.omega for s in steps])
    joints = [s.measured.joints for s in steps if s.measured.joints is not None]
    np.testing.assert_array_equal(record.joints.effort, [j.effort for j in joints])
    np.testing.assert_array_equal(record.joints.position, [j.position for j in joints])


def test_measured_effort_is_the_command_of_the_sample_before(servicer):
    settings = changed(servicer.settings, simulator={'noise': False})
    steps = list(ClosedLoop(servicer.robot, settings).run(20))
    np.testing.assert_array_equal(steps[0].measured.joints.effort, np.zeros(3))
    for before, now in pairwise(steps):
        np.testing.assert_array_equal(now.measured.joints.effort, before.command.tau)


def test_torque_is_held_between_joint_samples(servicer):
    settings = changed(servicer.settings, simulator={'noise': False, 'joint_rate': 50.0})
    loop = ClosedLoop(servicer.robot, settings)
    efforts = [loop.plant.effort for _ in loop.run(6)]
    for k in (1, 3, 5):
        np.testing.assert_array_equal(efforts[k], efforts[k + 1])
    assert np.any(efforts[1] != efforts[3])


def test_ledger_in_the_bag_ends_with_the_run(servicer, tmp_path):
    loop = ClosedLoop(servicer.robot, servicer.settings)
    record_run(loop, 25, tmp_path / 'bag')
    with Reader(tmp_path / 'bag') as reader:
        wanted = [c for c in reader.connections if c.topic == '/simulator/ledger']
        rows = [
            (stamp, typestore().deserialize_cdr(data, c.msgtype))
            for c, stamp, data in reader.messages(wanted)
        ]
    assert [stamp for stamp, _ in rows] == [0, 10**8, 2 * 10**8, 25 * 10**7]
    last, truth = rows[-1][1], loop.plant.ledger()
    assert last.kinetic_energy == truth.kinetic
    assert last.angular_momentum.x == truth.angular[0]
    assert last.joint_work == truth.joint_work


def test_wheels_of_the_servicer_have_tachometers(tmp_path):
    wheels = {
        'servicer_wheels': {'joints': wheel_joints(0), 'rates': [250.0, 270.0, 280.0]},
        'target_wheels': {'joints': wheel_joints(3), 'rates': [420.0, 490.0, 410.0]},
    }
    parts = with_wheels(table_one())
    settings = changed(settings_of(parts, **wheels), simulator={'substeps': 10})
    robot = robot_of(parts, **wheels)
    loop = ClosedLoop(robot, settings)
    start = loop.plant.state
    record_run(loop, 10, tmp_path / 'bag')
    record = read_bag(tmp_path / 'bag', robot)
    assert record.wheels.names == tuple(wheel_joints(0))  # and not the captured body's
    assert len(record.wheels.stamp_ns) == 11
    axial = WHEEL_SPIN * (record.wheels.velocity[-1] + loop.plant.state.omega_WB_B)
    before = WHEEL_SPIN * (record.wheels.velocity[0] + start.omega_WB_B)
    np.testing.assert_allclose(axial, before, rtol=1e-9)  # nothing drives the rotors


def test_a_reference_from_a_topic_needs_ros(servicer):
    settings = changed(servicer.settings, reference={'kind': 'topic'})
    with pytest.raises(ConfigurationError, match=r"reference\.kind: 'topic' needs the nodes"):
        ClosedLoop(servicer.robot, settings)


def test_a_run_that_fails_leaves_no_bag(servicer, tmp_path):
    loop = ClosedLoop(servicer.robot, servicer.settings)

    def fail(step):
        if step == 5:
            raise SimulationDivergedError(0.05, 'on purpose')

    with pytest.raises(SimulationDivergedError):
        record_run(loop, 10, tmp_path / 'bag', progress=fail)
    assert not list(tmp_path.iterdir())
    with pytest.raises(RecordingError, match='can not be written'):
        record_run(loop, 10, CONFIG / 'bag')
