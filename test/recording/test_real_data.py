"""The documented mappings on real data (docs/data.md); skipped where the data are not there."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import savgol_filter

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import RecordingError
from spacerobot_ros.recording.faults.data_faults import data_faults
from spacerobot_ros.recording.read import read_record, read_records

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get('SPACEROBOT_DATA', ROOT.parent / 'shared' / 'data'))
EXAMPLES = ROOT / 'config' / 'examples'


def data_set(name):
    """A folder of measured data, or a skip."""
    if not (DATA / name).is_dir():
        pytest.skip(f'no measured data in {DATA / name} (set SPACEROBOT_DATA)')
    return DATA / name


@pytest.fixture
def kuka(tmp_path):
    """The KUKA's robot, its URDF copied beside the example."""
    folder = data_set('kuka_lwr4')
    for path in (folder / 'kuka_lwr4.urdf', EXAMPLES / 'kuka_lwr4.yaml'):
        shutil.copyfile(path, tmp_path / path.name)
    return folder, load_robot_file(tmp_path / 'kuka_lwr4.yaml').robot


def torques(record, robot):
    """Torques that the model asks for along a measured motion, and the measured ones."""
    joints, n = record.joints, robot.n_joints
    dynamics = Dynamics(robot)
    step = float(np.median(np.diff(joints.stamp_ns))) / 1e9
    span = 2 * round(0.05 / step) + 1  # 0.1 s: below it encoders of these robots are noise
    q, qd, qdd = (savgol_filter(joints.position, span, 3, d, step, axis=0) for d in range(3))
    zero, level = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
    rows = np.arange(span, len(q) - span, 7)
    model = np.empty((len(rows), n))
    for out, k in enumerate(rows):
        state = State(zero, level, q[k], zero, zero, qd[k])
        model[out] = dynamics.inverse(state, np.zeros(6), qdd[k])[1]
    return model, joints.effort[rows]


@pytest.mark.parametrize('run', [1, 2])
def test_kuka_lwr4(kuka, run):
    folder, robot = kuka
    path = folder / f'measurements_{run}.npz'
    record = read_record(path, robot, EXAMPLES / 'kuka_lwr4_map.yaml')
    joints = record.joints
    assert joints.names == robot.joints
    assert joints.position.shape == joints.velocity.shape == joints.effort.shape == (5027, 7)
    assert (record.rates, record.attitudes) == (None, None)
    seconds = (joints.stamp_ns[-1] - joints.stamp_ns[0]) / 1e9
    assert 25.0 < seconds < 25.3
    model, measured = torques(record, robot)
    rms = float(np.sqrt(np.mean((model - measured) ** 2)))
    assert 0.9 < rms < 1.3  # the data's notes: 1.081 N m for the URDF without friction
    assert rms < 0.25 * float(np.sqrt(np.mean(measured**2)))


@pytest.fixture
def ur10e(tmp_path):
    """The UR10e's robot, its URDF copied beside the example."""
    folder = data_set('ur10e')
    for path in (folder / 'ur10e.urdf', EXAMPLES / 'ur10e.yaml'):
        shutil.copyfile(path, tmp_path / path.name)
    return folder, load_robot_file(tmp_path / 'ur10e.yaml').robot


@pytest.mark.parametrize(
    ('name', 'samples'),
    [('20_01_22-joint_1', 5889), ('20_01_22-push_pose_1', 1727), ('20_02_19_14harm50sec', 5375)],
)
def test_ur10e(ur10e, name, samples):
    folder, robot = ur10e
    paths = [folder / f'ur-{name}.csv.gz']
    (record,) = read_records(paths, robot, EXAMPLES / 'ur10e_map.yaml')
    assert record.q.shape == record.qd.shape == record.effort.shape == (samples, 6)
    raw = np.loadtxt(paths[0], delimiter=',')
    np.testing.assert_array_equal(record.q, raw[:, 1:7])
    np.testing.assert_allclose(
        record.effort, raw[:, 13:19] * [14.87, 13.26, 11.13, 10.62, 11.03, 11.47], rtol=1e-15
    )
    assert data_faults(record, robot) == ()  # joints that flicker at rest included


def test_the_torques_of_the_ur10e_are_those_of_its_urdf_and_friction(ur10e):
    folder, robot = ur10e
    path = folder / 'ur-20_02_19_14harm50sec.csv.gz'
    record = read_record(path, robot, EXAMPLES / 'ur10e_map.yaml')
    model, measured = torques(record, robot)
    heavy = slice(1, 3)  # shoulder and elbow, where gravity is large beside friction
    for one, other in zip(model.T[heavy], measured.T[heavy], strict=True):
        assert np.corrcoef(one, other)[0, 1] > 0.9


def test_xl330_pendulum():
    folder = data_set('bam_xl330_pendulum')
    robot = load_robot_file(EXAMPLES / 'xl330_pendulum.yaml').robot
    paths = sorted(folder.glob('*.json'))
    assert len(paths) == 8
    for path in paths:
        record = read_record(path, robot, EXAMPLES / 'xl330_pendulum_map.yaml')
        step = np.diff(record.joints.stamp_ns) / 1e9
        assert 0.003 < step.min() < step.max() < 0.008
        assert np.max(np.abs(record.joints.effort)) < 0.72  # the servo's stall torque is 0.6 N m
    free_swing = read_record(paths[0], robot, EXAMPLES / 'xl330_pendulum_map.yaml')
    model, measured = (values[:, 0] for values in torques(free_swing, robot))
    slope = float(model @ measured / (measured @ measured))
    assert 0.7 < slope < 1.1  # friction takes part of the motor's torque
    assert np.corrcoef(model, measured)[0, 1] > 0.9


def test_airbearing_satellite():
    path = data_set('airbearing_satellite') / 'real_test_data.csv'
    robot = load_robot_file(EXAMPLES / 'airbearing_satellite.yaml').robot
    record = read_record(path, robot, EXAMPLES / 'airbearing_satellite_map.yaml')
    q = record.attitudes.q_xyzw
    assert q.shape == (3270, 4)
    np.testing.assert_array_equal(q[:, :2], 0.0)
    yaw = np.unwrap(2.0 * np.arctan2(q[:, 2], q[:, 3]))
    assert abs(np.degrees(yaw[0]) + 172.294) < 1e-3
    assert np.max(np.abs(np.diff(yaw))) < 0.06  # rad a sample: no wrap, no unit slipped


def test_suchai3_cubesat(tmp_path):
    folder = data_set('suchai3_cubesat')
    robot = load_robot_file(ROOT / 'config' / 'servicer.yaml').robot  # gives only names
    record = read_record(folder / '2023-11-13.csv', robot, EXAMPLES / 'suchai3_cubesat_map.yaml')
    assert record.rates.omega.shape == (997, 3)
    spin = np.degrees(record.rates.omega[:, 1])
    assert -32.0 < spin.mean() < -27.0
    mended = read_record(folder / '2024-03.csv', robot, EXAMPLES / 'suchai3_cubesat_map.yaml')
    assert any('34 of 2157 stamps rebuilt' in note for note in mended.notes)
    one_pass = tmp_path / 'map.yaml'
    text = (EXAMPLES / 'suchai3_cubesat_map.yaml').read_text()
    one_pass.write_text(text.replace('sample_index', '# '))
    with pytest.raises(RecordingError, match=r'line 1530: the clock stands still'):
        read_record(folder / '2024-03.csv', robot, one_pass)
    one_pass.write_text(text + "select: {sheet: '15032024'}\n")
    assert len(read_record(folder / '2024-03.csv', robot, one_pass).rates.omega) == 200
