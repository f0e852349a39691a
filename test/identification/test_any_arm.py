"""Arms that nobody designed for it: the wheel momentum is told, from any file, and what is not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support.excitation import robot_file
from support.models import random_inertia, random_tree

from spacerobot_ros.effects.robot_file import RobotFile, load_robot_file
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.estimation.unknowns.body_coordinates import BodyCoordinates
from spacerobot_ros.identification.batch import identify
from spacerobot_ros.model.settings import IdentifierSettings
from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries, Record
from spacerobot_ros.simulation.closed_loop import ClosedLoop

FILE = Path(__file__).parents[2] / 'config' / 'seven_joints.yaml'
SETTINGS = IdentifierSettings()
H = np.array([1.6, -1.1, 1.9])  # N m s, of the captured wheels
SECONDS = 15.0
SIMULATOR = {'period': 0.01, 'joint_rate': 100.0, 'imu_rate': 100.0, 'attitude_rate': 10.0}


def seven_joints() -> RobotFile:
    """The packaged arm, whose URDF is off; its file believes the wheels at rest."""
    return load_robot_file(FILE)


def a_slide() -> RobotFile:
    """A drawn arm of three joints, one of which slides; its file's bodies are right."""
    rng = np.random.default_rng(5)
    parts = random_tree(rng, [0, 1, 2], prismatic=(2,))
    parts[0] = replace(parts[0], mass=200.0, inertia=random_inertia(rng, 20.0))
    parts[3] = replace(parts[3], mass=60.0, inertia=random_inertia(rng, 5.0))
    sine, cosine = (0.15 * rng.standard_normal((2, 9))).tolist()
    file = robot_file(
        parts,
        wheels=[3.0, -2.0, 4.0],
        reference={
            'kind': 'fourier',
            'duration': 20.0,
            'harmonics': 3,
            'sine': sine,
            'cosine': cosine,
        },
        simulator={**SIMULATOR, 'seed': 1},
        truth={'target_momentum': H.tolist()},
        initial={'angular_velocity': [0.01, -0.008, 0.012]},
    )
    return replace(file, robot=file.robot.with_target_momentum(np.zeros(3)))


ARMS = {'seven joints': seven_joints, 'a slide': a_slide}
arms = pytest.mark.parametrize('name', ARMS)


@cache
def flown(name: str, **changes) -> tuple[RobotFile, Record]:
    """An arm and fifteen seconds of it as its noisy sensors see them."""
    file = ARMS[name]()
    loop = ClosedLoop(file.robot, file.settings.changed(dict(changes)))
    steps = [(s.stamp_ns, s.measured) for s in loop.run(round(100 * SECONDS))]
    joints = [(ns, m.joints) for ns, m in steps if m.joints is not None]
    rates = [(ns, m.omega) for ns, m in steps if m.omega is not None]
    attitudes = [(ns, m.attitude_xyzw) for ns, m in steps if m.attitude_xyzw is not None]
    stamps = [np.array([ns for ns, _ in part]) for part in (joints, rates, attitudes)]
    q, qd = (np.array([getattr(j, x) for _, j in joints]) for x in ('position', 'velocity'))
    return file, Record(
        JointSeries(file.robot.joints, stamps[0], q, qd),
        RateSeries(stamps[1], np.array([w for _, w in rates])),
        AttitudeSeries(stamps[2], np.array([a for _, a in attitudes])),
    )


def off(robot, size, seed):
    """A file's robot whose bodies were drawn about another's, under the usual uncertainties."""
    bodies = BodyCoordinates(robot, 'generic')
    drawn = bodies.robot(size * np.random.default_rng(seed).standard_normal(bodies.size))
    return replace(drawn, uncertainties=())


def check_honest(estimate, h=H):
    """Valid, within four deviations, and what is said of it is in order."""
    estimate.check()
    assert estimate.valid, estimate.reason
    assert np.max(np.abs(estimate.aam - h) / estimate.std[:3]) <= 4.0
    assert 0.9 <= estimate.chi2_per_dof <= 1.1
    assert len(estimate.unexcited) <= 5
    assert set(estimate.sources) <= {'data', 'both', 'file'}


@arms
def test_the_wheel_momentum_is_told(name):
    file, record = flown(name)
    estimate = identify(record, file.robot, SETTINGS).estimate
    check_honest(estimate)
    assert np.linalg.norm(estimate.aam - H) < 0.02 * np.linalg.norm(H)
    assert estimate.sources[:3] == ('data',) * 3
    assert estimate.rank < estimate.unknowns
    assert estimate.unexcited  # no arm tells its mass


def test_what_only_the_file_tells_is_said_in_few_words():
    file, record = flown('seven joints')
    estimate = identify(record, file.robot, SETTINGS).estimate
    assert 'file' in estimate.sources[3:]
    links = {body.name for body in file.robot.bodies}
    for line in estimate.unexcited:
        named, parts = line.split(': ')
        assert set(named.split(', ')) <= links
        assert set(parts.split(', ')) <= {'mass', 'centre of mass', 'inertia'}


@arms
@pytest.mark.parametrize('seed', range(4))
def test_a_file_that_is_surer_than_it_may_be_is_found_out(name, seed):
    file, record = flown(name)
    estimate = identify(record, off(file.robot, 0.3, seed), SETTINGS).estimate
    check_honest(estimate)
    assert 1.5 < estimate.prior_factor < 5.0
    listed = [note for note in estimate.notes if note.startswith('the file is contradicted: ')]
    assert len(listed) <= 5
    # where a number is said to be off the data tell it: by four deviations and more
    for note in listed:
        assert float(note.rsplit(', ', 1)[1].split()[0]) > 4.0
    if listed:
        assert any('robot.uncertainty' in note for note in estimate.notes)


@arms
def test_wheels_at_rest_are_found_at_rest(name):
    file, record = flown(name, **{'truth.target_momentum': (0.0, 0.0, 0.0)})
    estimate = identify(record, file.robot, SETTINGS).estimate
    check_honest(estimate, np.zeros(3))
    assert any(note.startswith('wheel momentum: none, within +- ') for note in estimate.notes)


@arms
def test_joints_at_rest_do_not_tell_it(name):
    file = ARMS[name]()
    count = len(file.settings.reference.sine)
    still = {f'reference.{part}': (0.0,) * count for part in ('sine', 'cosine')}
    file, record = flown(name, **still, **{'initial.angular_velocity': (0.0, 0.0, 0.0)})
    estimate = identify(record, file.robot, SETTINGS).estimate
    estimate.check()
    assert not estimate.valid
    assert 'wheel momentum is known to' in estimate.reason
    assert np.max(np.abs(estimate.aam - H) / estimate.std[:3]) <= 4.0
    assert len(estimate.unexcited) <= 5


@arms
def test_least_squares_are_for_joints_that_turn(name):
    file, record = flown(name)
    if name == 'a slide':
        with pytest.raises(ConfigurationError, match=r"joint 'j_link_2': slides.*`ml`") as refusal:
            identify(record, file.robot, SETTINGS, 'ls')
        assert '\n' not in str(refusal.value)
    else:
        assert not identify(record, file.robot, SETTINGS, 'ls').estimate.valid  # 136 numbers


@arms
@pytest.mark.parametrize('until', [11.0, 12.5, 14.0])
def test_the_recursion_ends_where_the_batch_ends(name, until):
    file, record = flown(name)
    online = identify(record.between(-1.0, until), file.robot, SETTINGS, 'recursive').estimate
    end = (online.stamp_ns - record.origin_ns) * 1e-9
    assert end == pytest.approx(until - 0.5, abs=0.02)
    batch = identify(record.between(-1.0, end), file.robot, SETTINGS).estimate
    assert np.max(np.abs(online.aam - batch.aam) / batch.std[:3]) < 0.1
    np.testing.assert_allclose(online.std[:3], batch.std[:3], rtol=0.03, atol=0)


@pytest.mark.parametrize(
    ('name', 'pair'), [('seven joints', (1, 3)), ('seven joints', (4, 6)), ('a slide', (0, 2))]
)
def test_swapped_encoders_are_no_estimate(name, pair):
    file, record = flown(name)
    order = np.arange(file.robot.n_joints)
    order[list(pair)] = pair[::-1]
    joints = record.joints
    swapped = replace(
        joints, position=joints.position[:, order], velocity=joints.velocity[:, order]
    )
    estimate = identify(replace(record, joints=swapped), file.robot, SETTINGS).estimate
    assert not estimate.valid


@arms
@pytest.mark.parametrize('factor', [10.0, 50.0, 0.02])
def test_a_file_of_another_robot_is_said(name, factor):
    """The last body's mass and inertia are off by as much."""
    file, record = flown(name)
    factors = np.ones(len(file.robot.bodies))
    factors[-1] = factor
    pi = file.robot.inertial_parameters * factors[:, None]
    estimate = identify(record, file.robot.with_inertial_parameters(pi), SETTINGS).estimate
    assert any(note.startswith('the file is contradicted: ') for note in estimate.notes)
    assert estimate.prior_factor > 1.5
    if estimate.valid:  # found all the same
        check_honest(estimate)
    else:
        assert 'the data contradict the bodies of the robot file' in estimate.reason
