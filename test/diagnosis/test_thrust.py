"""Thrusters of a platform whose pose is measured by cameras, without a gyro."""

from __future__ import annotations

import itertools
import os
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import RecordingError
from spacerobot_ros.inference.decisive import MISFIT
from spacerobot_ros.recording.read import read_record
from spacerobot_ros.recording.record import AttitudeSeries, Record
from spacerobot_ros.recording.robot_inputs import in_robot_order
from spacerobot_ros.recording.series import InputSeries
from test.support.lone_body import box_file

MASS, INERTIA, COM = 23.0, 0.40, np.array([0.01, -0.004])
PLACES = {
    'T1': ([0.15, 0.06], [-1.0, 0.0]),
    'T2': ([-0.15, -0.06], [1.0, 0.0]),
    'T3': ([0.06, -0.15], [0.0, 1.0]),
    'T4': ([-0.06, 0.15], [0.0, -1.0]),
}
FORCE, PERIOD = 0.45, 0.06
EXAMPLES = Path(__file__).parents[2] / 'config' / 'examples'
DATA = Path(os.environ.get('SPACEROBOT_DATA', EXAMPLES.parents[2] / 'shared' / 'data'))


@pytest.fixture(scope='module')
def platform(tmp_path_factory):
    thrusters = {
        name: {'at': [*at, 0.0], 'direction': [*direction, 0.0], 'force': FORCE}
        for name, (at, direction) in PLACES.items()
    }
    folder = tmp_path_factory.mktemp('platform')
    return box_file(folder, com=f'{COM[0]} {COM[1]} 0', robot={'thrusters': thrusters}).robot


def slid(rng, gains=(1.0,) * 4, late=0.0, push=(0.0, 0.0), duration=90.0):
    """A planar body under held commands, by SciPy from switch to switch; pose at 17 Hz."""
    count = round(duration / PERIOD)
    commands = np.repeat(rng.random((count // 3, 4)) < 0.15, 3, axis=0).astype(float)
    time = PERIOD * np.arange(len(commands))
    edges = np.unique(np.concatenate([[0.0, time[-1]], time + late, time]).clip(0.0, time[-1]))
    x, states = np.array([0.3, -0.2, 0.4, 0.01, 0.02, 0.05]), {0.0: None}
    states[0.0] = x
    for start, end in itertools.pairwise(edges):
        k = int(np.searchsorted(time + late, start + 1e-9)) - 1
        shares = FORCE * np.array(gains) * (commands[k] if k >= 0 else 0.0)
        force, torque = np.zeros(2), 0.0
        for share, (at, direction) in zip(shares, PLACES.values(), strict=True):
            pull, arm = share * np.array(direction), np.array(at) - COM
            force, torque = force + pull, torque + arm[0] * pull[1] - arm[1] * pull[0]

        def rate(_, x, force=force, torque=torque):
            c, s = np.cos(x[2]), np.sin(x[2])
            a = np.array([c * force[0] - s * force[1], s * force[0] + c * force[1]]) / MASS
            return np.concatenate([x[3:], a + push, [torque / INERTIA]])

        x = solve_ivp(rate, (start, end), x, rtol=1e-9, atol=1e-12).y[:, -1]
        states[float(end)] = x
    centre = np.array([states[float(t)] for t in time])
    yaw = centre[:, 2] + 1e-3 * rng.standard_normal(len(time))
    turned = Rotation.from_euler('z', centre[:, 2:3])
    origin = centre[:, :2] - turned.apply([*COM, 0.0])[:, :2]
    stamps = np.round(time * 1e9).astype(int)
    return Record(
        attitudes=AttitudeSeries(stamps, Rotation.from_euler('z', yaw[:, None]).as_quat()),
        inputs={
            'thrusters': InputSeries(tuple(PLACES), stamps, commands),
            'base_position': InputSeries(
                ('x', 'y'), stamps, origin + 1e-4 * rng.standard_normal(origin.shape), ('m', 'm')
            ),
        },
        source='made',
    )


def test_a_right_platform_has_no_cause(platform, rng):
    found = diagnose(in_robot_order(slid(rng), platform), platform)

    assert found.verdict == 'consistent', found.sentence
    assert found.causes == ()
    assert found.method == 'pose'
    assert found.fit_p > MISFIT


def test_dead_thruster_delay_and_a_table_that_is_not_level(platform, rng):
    record = slid(rng, gains=(1.0, 0.0, 1.0, 0.6), late=0.127, push=(0.02, 0.0))

    found = diagnose(in_robot_order(record, platform), platform)

    assert found.verdict == 'explained', found.sentence
    assert {(c.applied.id, c.applied.where) for c in found.causes} == {
        ('command_delay', None),
        ('thruster_gain', 'T2'),
        ('thruster_gain', 'T4'),
        ('gravity_error', None),
    }
    values = {
        (c.applied.id, c.applied.where, name): e
        for c in found.causes
        for name, e in c.parameters.items()
    }
    assert abs(values['command_delay', None, 'delay'].value - 0.127) < 0.01
    dead, weak = (values['thruster_gain', name, 'gain'] for name in ('T2', 'T4'))
    assert abs(dead.value) < max(4.0 * dead.std, 0.02)
    assert abs(weak.value - 0.6) < 4.0 * weak.std < 0.2
    # a table that leans by 2 mrad
    assert abs(values['gravity_error', None, 'x'].value - 0.02) < 1e-3


def test_too_short_a_record_is_refused(platform, rng):
    record = in_robot_order(slid(rng, duration=15.0), platform)

    with pytest.raises(RecordingError, match='windows with a pose, at least 20 are needed'):
        diagnose(record, platform)


@pytest.mark.skipif(
    not (DATA / 'airbearing_satellite').is_dir(),
    reason=f'no measured data in {DATA}/airbearing_satellite (set SPACEROBOT_DATA)',
)
def test_airbearing_satellite():
    robot = load_robot_file(EXAMPLES / 'airbearing_satellite.yaml').robot
    path = DATA / 'airbearing_satellite' / 'real_test_data.csv'

    found = diagnose(read_record(path, robot, EXAMPLES / 'airbearing_satellite_map.yaml'), robot)

    named = {(c.applied.id, c.applied.where): c.parameters for c in found.causes}
    assert 0.10 < named['command_delay', None]['delay'].value < 0.14
    dead = named['thruster_gain', 'T2']['gain']
    assert dead.value < 4.0 * dead.std < 0.3
    (note,) = (note for note in found.notes if note.startswith('thrust over'))
    gains = {
        t: (float(x), float(std)) for t, x, std in re.findall(r'(T.) (\S+) \+- ([\d.]+)', note)
    }
    value, std = gains.pop('T2')  # beside the gains of all others
    assert value < 2.0 * std < 0.3
    assert len(gains) == 7
    assert all(0.7 < gain < 1.5 for gain, _ in gains.values())
    tilt = next(c.parameters for c in found.minor if c.applied.id == 'gravity_error')
    assert 1e-3 < np.hypot(tilt['x'].value, tilt['y'].value) < 2e-3
