"""A platform on a table whose gyro has one axis."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spacerobot_ros.cli.main import main
from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import RecordingError
from spacerobot_ros.recording.read import read_record
from spacerobot_ros.recording.record import AttitudeSeries, RateSeries, Record
from spacerobot_ros.recording.robot_inputs import in_robot_order
from test.support.lone_body import box_file

ARMS = {'T1': 0.06, 'T2': -0.06, 'T3': 0.09, 'T4': -0.04}
THRUSTERS = {
    name: {'at': [0.15, arm, 0.0], 'direction': [-1.0, 0.0, 0.0], 'force': 0.45}
    for name, arm in ARMS.items()
}
TORQUES = 0.45 * np.array([*ARMS.values()])
NAMES = [*ARMS]
MAPPING = {
    'time': {'columns': 't', 'unit': 's'},
    'gyro': {'columns': [None, None, 'wz'], 'unit': 'deg/s'},
    'attitude': {'columns': 'yaw', 'order': 'yaw', 'unit': 'deg'},
    'thrusters': {'names': NAMES, 'command': {'columns': NAMES}},
}


@pytest.fixture(scope='module')
def table(tmp_path_factory):
    """Folder with a robot file, a mapping and 30 s in which T2 gives 0.7 of its force."""
    folder, rng = tmp_path_factory.mktemp('table'), np.random.default_rng(7)
    box_file(folder, robot={'thrusters': THRUSTERS}, sensors={})
    step, every = 0.05, 20
    commands = np.repeat(rng.random((30, 4)) < 0.3, every, axis=0).astype(float)
    rate = (
        0.1
        + np.append(0.0, np.cumsum(commands @ (TORQUES * [1.0, 0.7, 1.0, 1.0]) / 0.40 * step))[:-1]
    )
    yaw = np.append(0.0, np.cumsum(rate * step + 0.5 * step * np.diff(rate, append=rate[-1])))[:-1]
    columns = {
        't': step * np.arange(len(rate)),
        'wz': np.degrees(rate + 3e-3 + 1e-3 * rng.standard_normal(len(rate))),
        'yaw': np.degrees(yaw + 1e-3 * rng.standard_normal(len(rate))),
        **dict(zip(NAMES, commands.T, strict=True)),
    }
    with (folder / 'run.csv').open('w', newline='') as file:
        writer = csv.writer(file)
        writer.writerows([columns, *np.column_stack([*columns.values()]).tolist()])
    (folder / 'map.yaml').write_text(json.dumps(MAPPING))
    blind = {key: MAPPING[key] for key in MAPPING if key != 'attitude'}
    (folder / 'blind.yaml').write_text(json.dumps(blind))
    return folder


def read(folder, mapping='map.yaml'):
    robot = box_file(folder, robot={'thrusters': THRUSTERS}, sensors={}).robot
    return read_record(folder / 'run.csv', robot, folder / mapping), robot


def test_its_bias_and_a_weak_thruster_are_named(table):
    record, robot = read(table)
    found = diagnose(record, robot)

    assert 'the gyro measures z alone' in record.notes
    assert found.verdict == 'explained', found.sentence
    causes = {(c.applied.id, c.applied.where): c.parameters for c in found.causes}
    assert set(causes) == {('gyro_bias', None), ('thruster_gain', 'T2')}
    for key, name, true in (
        (('gyro_bias', None), 'z', 3e-3),
        (('thruster_gain', 'T2'), 'gain', 0.7),
    ):
        assert abs(causes[key][name].value - true) < 4.0 * causes[key][name].std
    assert not any(r.channel in ('gyro/x', 'gyro/y') for r in found.residuals)


def test_alone_it_shows_a_weak_thruster_too(table):
    found = diagnose(*read(table, 'blind.yaml'))

    gain = next(c.parameters['gain'] for c in found.causes if c.applied.id == 'thruster_gain')
    assert found.verdict == 'explained', found.sentence
    assert abs(gain.value - 0.7) < 4.0 * gain.std < 0.2


@pytest.mark.parametrize('mapping', ['map.yaml', 'blind.yaml'])
def test_every_command_takes_it(table, mapping, capsys, tmp_path):
    given = [table / 'run.csv', '--robot', table / 'box.yaml', '--map', table / mapping]
    for command, line in (
        ('check', 'gyro/z'),
        ('identify', 'not valid: '),  # a turn about one axis tells few ratios
        ('diagnose', 'hits are looked for where the rates about all three axes are measured'),
    ):
        out = ['--out', str(tmp_path / 'out')] if command == 'diagnose' else []
        main([command, *map(str, given), *out])
        said = ' '.join(capsys.readouterr().out.split())
        assert line in said
        assert 'gyro/x' not in said


def test_too_few_axes_are_one_line():
    with pytest.raises(RecordingError, match='no axis is measured'):
        RateSeries(np.arange(3), np.full((3, 3), np.nan))
    arm = load_robot_file(Path(__file__).parents[2] / 'config' / 'minisat.yaml').robot
    record = Record(rates=RateSeries(np.arange(3), np.full((3, 3), [np.nan, 0.1, 0.2])))
    with pytest.raises(RecordingError, match='measures y, z alone: a free base with joints needs'):
        in_robot_order(record, arm)


def test_a_tumble_is_told_by_the_attitude_where_the_gyro_is_blind():
    """Rates about the other axes are those of the attitude."""
    time, turn = 0.1 * np.arange(50), Rotation.from_rotvec([0.02, -0.03, 0.05])
    attitude = Rotation.concatenate([turn**k for k in range(len(time))])
    stamps = np.round(1e9 * time).astype(int)
    omega = np.full((len(time), 3), [np.nan, np.nan, 0.5])

    rates = RateSeries(stamps, omega).completed(AttitudeSeries(stamps, attitude.as_quat()))

    assert rates.axes == (2,)
    np.testing.assert_allclose(rates.omega, np.tile([0.2, -0.3, 0.5], (len(time), 1)), atol=1e-9)
