"""What commands print of a joint that slides: ways and forces, nowhere angles and torques."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from support.contracts import keeps

from spacerobot_ros.cli.main import main
from spacerobot_ros.diagnosis import diagnose
from spacerobot_ros.diagnosis.discovery.possible_laws import Extent, joint_laws
from spacerobot_ros.diagnosis.events.transient import Transient, event_of
from spacerobot_ros.diagnosis.flight.probes import probes_of
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.recording.npz import save_npz
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps

TURNING = re.compile(r'\bN m\b|\brad\b|\bdeg\b')
INERTIAL = (
    '<inertial><mass value="3"/><inertia ixx="0.05" iyy="0.05" izz="0.05" ixy="0" ixz="0" '
    'iyz="0"/></inertial>'
)
JOINT = (
    '<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
    '<axis xyz="1 0 0"/><limit lower="-6" upper="6" effort="100" velocity="5"/></joint>'
)
YAML = """/**:
  ros__parameters:
    robot: {{urdf: {urdf}, base: fixed, base_link: floor, gravity: [0.0, 0.0, -9.81],
      joints: [{joints}]}}
"""


def robot_file(folder, *kinds):
    """A chain of joints along and about x."""
    links = ['floor', *(f'link_{k}' for k in range(len(kinds)))]
    parts = ['<link name="floor"/>', *(f'<link name="{n}">{INERTIAL}</link>' for n in links[1:])]
    for k, kind in enumerate(kinds):
        name = f'{kind}_{k}'
        parts.append(JOINT.format(name=name, kind=kind, parent=links[k], child=links[k + 1]))
    urdf, path = folder / 'robot.urdf', folder / 'robot.yaml'
    urdf.write_text(f'<robot name="rail">{"".join(parts)}</robot>')
    names = ', '.join(f'{kind}_{k}' for k, kind in enumerate(kinds))
    path.write_text(YAML.format(urdf=urdf, joints=names))
    return path


def recorded(path, rng, friction):
    """A carriage of 3 kg with dry friction [N], for 12 s at 100 Hz."""
    time = np.arange(1200)[:, None] / 100.0
    terms = ((0.3, 1.3, 0.0), (0.2, 3.1, 1.0))
    q, qd, qdd = (
        sum(a * w**k * np.sin(w * time + phase + 0.5 * np.pi * k) for a, w, phase in terms)
        for k in range(3)
    )
    effort = 3.0 * qdd + friction * np.sign(qd) + 0.05 * rng.standard_normal(q.shape)
    noisy = q + 1e-5 * rng.standard_normal(q.shape)
    series = JointSeries(('prismatic_0',), to_stamps(time[:, 0]), noisy, qd, effort)
    save_npz(Record(joints=series), path)
    return str(path)


@pytest.fixture
def rail(tmp_path, rng):
    """A robot file and two recordings of its carriage, the second with more friction."""
    runs = [recorded(tmp_path / f'{name}.npz', rng, f) for name, f in (('a', 5.0), ('b', 12.0))]
    return str(robot_file(tmp_path, 'prismatic')), *runs


def said(capsys):
    text = capsys.readouterr().out
    assert not [line for line in text.splitlines() if TURNING.search(line)]
    return text


def test_what_a_diagnosis_prints_and_writes(rail, tmp_path, capsys, monkeypatch):
    few = [CATALOGUE[f'joint_{name}_friction'] for name in ('coulomb', 'viscous')]
    monkeypatch.setattr(diagnose, 'kinds_beside', lambda believed: few)
    robot, first, second = rail
    options = ['--robot', robot, '--score', second, '--no-closed-loop']
    assert main(['diagnose', first, *options, '--out', str(tmp_path / 'dia')]) == 1
    assert re.search(r'torque (5|4\.99)\S* \+- \S+ N\)', said(capsys))
    found = keeps('diagnose', (tmp_path / 'dia' / 'diagnosis.json').read_text())
    assert not TURNING.search(json.dumps(found))
    assert found['score']['unit'] == found['score']['joints']['prismatic_0']['unit'] == 'N'
    assert found['event_limits']['prismatic_0']['unit'] == 'N'
    assert [(law['unit'], law['viscous_unit']) for law in found['friction']] == [('N', 'N s/m')]


def test_what_a_comparison_prints_and_writes(rail, tmp_path, capsys):
    robot, first, second = rail
    assert main(['compare', first, second, '--robot', robot, '--out', str(tmp_path / 'week')]) == 1
    assert re.search(r'left unexplained, rms: prismatic_0 \S+ N$', said(capsys), re.MULTILINE)
    found = keeps('compare', (tmp_path / 'week' / 'comparison.json').read_text())
    assert found['left_unexplained']['units'] == {'prismatic_0': 'N'}
    assert not TURNING.search(json.dumps(found))


def test_what_a_check_prints(rail, capsys):
    robot, first, _ = rail
    assert main(['check', first, '--robot', robot]) == 0
    assert 'joint_velocity/prismatic_0' in said(capsys)
    assert main(['check', first, '--robot', robot, '--json']) == 0
    found = keeps('check', said(capsys))
    units = {one['channel'].split('/')[0]: one['unit'] for one in found['channels']}
    assert units == {'joint_position': 'm', 'joint_velocity': 'm/s', 'joint_effort': 'N'}
    assert {one['unit'] for one in (*found['delays'], *found['allan'])} <= {'m'}


def test_without_a_robot_file_nobody_knows_which_it_is(rail, capsys):
    assert main(['check', rail[1], '--json']) == 0
    found = keeps('check', capsys.readouterr().out)
    assert found['channels'][0]['unit'] == 'rad or m'


def test_the_error_of_a_simulated_run(rail, tmp_path, capsys):
    options = ['-o', str(tmp_path / 'run'), '--duration', '0.1']
    assert main(['simulate', '--robot', rail[0], *options]) == 0
    assert ' mm, momentum' in said(capsys)


def test_joints_of_both_kinds_have_each_their_own(tmp_path):
    robot = load_robot_file(robot_file(tmp_path, 'revolute', 'prismatic')).robot
    turns, slides = robot.joints
    assert (robot.unit_of('N m'), robot.unit_of('N m', slides)) == ('N m or N', 'N')
    units = {probe.name: probe.unit for probe in probes_of(robot)}
    assert units[f'{turns} rate'] == 'rad/s'
    assert units[f'{slides} rate'] == 'm/s'
    assert units[f'{slides} torque'] == 'N'
    pulses = [Transient.on_joint(j, 0, (1.0, 2.0, 0.5), 3.0, 0.1) for j in range(2)]
    event = event_of(robot, pulses, None, 5.0)
    assert event.units == {turns: 'N m', slides: 'N'}
    assert event.unit == 'N m or N'


def test_causes_at_a_free_robot_that_slides_are_told_apart(tmp_path, capsys):
    """The command that a diagnosis prints beside rivals, on the robots that it takes."""
    path = robot_file(tmp_path, 'revolute', 'prismatic')
    free = path.read_text().replace('base: fixed', 'base: free').replace('-9.81', '0.0')
    path.write_text(free + '    excitation: {starts: 1, iterations: 1, duration: 5.0}\n')
    (tmp_path / 'robot.urdf').write_text(
        (tmp_path / 'robot.urdf').read_text().replace('"floor"/>', f'"floor">{INERTIAL}</link>', 1)
    )
    causes = [f'joint_{kind}_friction@prismatic_1' for kind in ('viscous', 'coulomb')]
    out = tmp_path / 'separate.yaml'
    assert main(['excite', '--robot', str(path), '-o', str(out), '--separate', *causes]) == 0
    assert load_robot_file(out).settings.reference.kind == 'fourier'
    capsys.readouterr()


def test_rates_of_both_kinds_do_not_add_up(tmp_path):
    """A motor that turns a sum of them is none: in millimetres it would be another sum."""
    kinds = ('revolute', 'prismatic', 'prismatic', 'revolute', 'revolute')
    robot = load_robot_file(robot_file(tmp_path, *kinds)).robot
    places = CATALOGUE['joint_coupled_friction'].places(robot)
    assert places == ('prismatic_2', 'revolute_4')
    at = Extent.of(robot.joints, np.zeros((2, 5)), np.ones((2, 5)), 10.0)
    summed = {
        frozenset(name.partition('/')[2] for name in law.inputs)
        for law in joint_laws('prismatic_1', robot.ways(robot.joints), (), at)
        if re.search(r'x [+-] y', law.form.name)
    }
    assert summed == {frozenset({'prismatic_1', 'prismatic_2'})}
