"""Exported models: MuJoCo plays them, and comes to where our own simulation comes."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.contracts import keeps
from support.models import quaternion_matrix

from spacerobot_ros.cli import main
from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.simulation.export.mjcf import to_mjcf
from spacerobot_ros.simulation.export.plain_urdf import to_urdf
from spacerobot_ros.simulation.plant import Plant

mujoco = pytest.importorskip('mujoco')
CONFIG = Path(__file__).resolve().parents[2] / 'config'
PERIOD, SECONDS = 0.01, 3.0
SMOOTH = {
    'viscous': {'effect': 'joint_viscous_friction', 'where': 'joint_2', 'coefficient': 20.0},
    'spring': {
        'effect': 'joint_stiffness',
        'where': 'joint_1',
        'stiffness': 30.0,
        'rest_angle': 0.3,
    },
    'gain': {'effect': 'joint_torque_constant', 'where': 'joint_3', 'gain': 1.1},
    'rotor': {'effect': 'motor_inertia', 'where': 'joint_3', 'inertia': 5.0},
    'mass': {
        'effect': 'inertial_parameters',
        'where': 'link_2',
        **{'mass': 10.0, 'mx': 10.0, 'iyy': 10.0, 'izz': 10.0},  # a point at x = 1 m
    },
    'wheels': {
        'effect': 'target_wheel_momentum',
        'where': 'link_3',
        'x': 42.0,
        'y': 49.0,
        'z': 41.0,
    },
}
LOST = {
    'ripple': {
        'effect': 'joint_torque_ripple',
        'where': 'joint_1',
        'amplitude': 1.0,
        'harmonic': 4.0,
    },
    'bias': {'effect': 'gyro_bias', 'x': 1e-3},
}


def written(folder, effects):
    content = yaml.safe_load((CONFIG / 'servicer.yaml').read_text())
    content['/**']['ros__parameters']['effects'] = effects
    path = folder / 'robot.yaml'
    path.write_text(yaml.safe_dump(content))
    return path


def torque(k):
    return np.array([200.0, -300.0, 120.0]) * np.sin(0.02 * k + np.arange(3.0))


def ours(file):
    initial = file.settings.initial
    q = np.array(initial.attitude_xyzw)
    zero = np.zeros(3)
    omega = np.array(initial.angular_velocity)
    start = State(zero, q / np.linalg.norm(q), zero, zero, omega, zero)
    plant = Plant(file.believed, start, PERIOD, 1, file.effects)
    for k in range(round(SECONDS / PERIOD)):
        plant.step(torque(k))
    state = plant.state
    return state.q, quaternion_matrix(state.q_WB_xyzw)


def theirs(text, names):
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key('start').id)
    for k in range(round(SECONDS / PERIOD)):
        data.ctrl[:] = torque(k)
        for _ in range(round(PERIOD / model.opt.timestep)):
            mujoco.mj_step(model, data)
    q = np.array([data.qpos[model.joint(name).qposadr[0]] for name in names])
    return q, quaternion_matrix(np.roll(data.qpos[3:7], -1))


@pytest.mark.parametrize(
    ('effects', 'tolerance'),
    [
        # two integrators at 1 ms and 10 ms; a ball of a millionth of the host beside a gyrostat
        (SMOOTH, 1e-6),
        # MuJoCo's friction is a constraint, ours goes through zero over 2 mrad/s
        (
            {
                **SMOOTH,
                'dry': {'effect': 'joint_coulomb_friction', 'where': 'joint_1', 'torque': 15.0},
            },
            2e-3,
        ),
    ],
    ids=['smooth', 'dry'],
)
def test_mujoco_comes_to_where_we_come(tmp_path, effects, tolerance):
    file = load_robot_file(written(tmp_path, effects))
    exported = to_mjcf(file)
    assert exported.lost == ()
    (q, attitude), (their_q, their_attitude) = ours(file), theirs(exported.text, file.robot.joints)
    joints, base = np.abs(q - their_q).max(), np.abs(attitude - their_attitude).max()
    print(  # noqa: T201  what the next run is compared with
        f'joints within {joints:.2g} rad of {np.abs(q).max():.2g}, base within {base:.2g} rad'
    )
    assert np.abs(q).max() > 0.2
    assert max(joints, base) < tolerance


def link(name, mass, place, moment):
    parts = {'ixx': moment, 'iyy': 1.3 * moment, 'izz': 1.1 * moment, 'ixy': 0.01, 'ixz': 0}
    inertia = ' '.join(f'{key}="{value}"' for key, value in {**parts, 'iyz': 0.02}.items())
    inner = f'<origin xyz="{place}"/><mass value="{mass}"/><inertia {inertia}/>'
    return f'<link name="{name}"><inertial>{inner}</inertial></link>'


def joint(child, parent, side, kind, axis):
    inner = f'<parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
    place = f'<origin xyz="0.5 {side} 0.1" rpy="0.3 -0.2 0.5"/>'
    limit = '<limit effort="500" velocity="9" lower="-2" upper="2"/>'
    return f'<joint name="j_{child}" type="{kind}">{inner}{place}{limit}</joint>'


TORQUE = {'r0': 5.0, 'l0': -4.0, 'l1': 3.0, 'r1': 10.0, 'l2': -1.5, 'r2': 1.0}  # N m, N


def two_arms(folder, names):
    """A free base called `world` with wheels and a thruster, two arms, one of which slides."""
    urdf = link('world', 200, '0.1 0 0', 40)
    for arm, side, second in (('l', 0.6, 'revolute'), ('r', -0.6, 'prismatic')):
        parent = 'world'
        for k, kind in enumerate(('revolute', second, 'revolute')):
            axis = ' '.join('1' if i == (2 - k) else '0' for i in range(3))
            child = f'{arm}{k}'
            urdf += link(child, 10 + k, '0.3 0 0.1', 1.0) + joint(child, parent, side, kind, axis)
            parent = child
    (folder / 'two.urdf').write_text(f'<robot name="two">{urdf}</robot>')
    wheels = {'links': ['world'], 'momentum': [10.0, 5.0, -8.0]}
    thruster = {'at': [1.0, 0.0, 0.0], 'direction': [0.0, 1.0, 0.0], 'force': 2.0}
    order = [f'j_{name}' for name in names]
    robot = {'urdf': 'two.urdf', 'base': 'free', 'base_link': 'world', 'joints': order}
    robot |= {'servicer_wheels': wheels, 'thrusters': {'base': thruster}}
    effects = {
        'oil': {'effect': 'joint_viscous_friction', 'where': 'j_r1', 'coefficient': 5.0},
        'gain': {'effect': 'joint_torque_constant', 'where': 'j_r1', 'gain': 1.2},
        'weak': {'effect': 'thruster_gain', 'where': 'base', 'gain': 0.5},
        'late': {'effect': 'command_delay', 'delay': 0.1},
    }
    initial = {'angular_velocity': [0.01, 0.02, -0.01]}
    content = {'robot': robot, 'effects': effects, 'initial': initial}
    path = folder / 'two.yaml'
    path.write_text(yaml.safe_dump({'/**': {'ros__parameters': content}}))
    return load_robot_file(path)


@pytest.mark.parametrize('names', [list(TORQUE), sorted(TORQUE, reverse=True)])
def test_two_arms_slides_and_thrusters(tmp_path, names):
    """In whatever order the robot file names its joints."""
    file = two_arms(tmp_path, names)
    exported = to_mjcf(file)
    assert exported.lost == ('command_delay (delay 0.1 s)',)
    initial, size = file.settings.initial, file.robot.n_joints
    zero, none = np.zeros(3), np.zeros(size)
    attitude, omega = np.array(initial.attitude_xyzw), np.array(initial.angular_velocity)
    torque = np.array([TORQUE[name] for name in names])
    forces = [effect for effect in file.effects if effect.acts('force')]
    start = State(zero, attitude, none, zero, omega, none)
    plant = Plant(file.believed, start, PERIOD, 1, forces)
    wrench = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 1.0])  # half of 2 N at 1 m
    model = mujoco.MjModel.from_xml_string(exported.text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(100):
        plant.step(torque, wrench)
        data.ctrl[:] = [*torque, 1.0]
        for _ in range(round(PERIOD / model.opt.timestep)):
            mujoco.mj_step(model, data)
    q = [data.qpos[model.joint(name).qposadr[0]] for name in file.robot.joints]
    base = quaternion_matrix(np.roll(data.qpos[3:7], -1))
    assert np.abs(plant.state.q).max() > 0.05
    np.testing.assert_allclose(q, plant.state.q, rtol=0, atol=1e-6)
    ours_base = quaternion_matrix(plant.state.q_WB_xyzw)
    np.testing.assert_allclose(base, ours_base, rtol=0, atol=1e-6)
    np.testing.assert_allclose(data.qpos[:3], plant.state.p_WB, rtol=0, atol=1e-6)


def test_a_body_that_no_rigid_body_is_like_is_changed_and_said(tmp_path):
    # of a body that a motion shows one moment of, a diagnosis knows no more
    thin = {'effect': 'inertial_parameters', 'where': 'link_2', 'ixx': 80.0}
    file = load_robot_file(written(tmp_path, {'thin': thin}))
    a, b, c = np.linalg.eigvalsh(file.believed.bodies[2].inertia)
    assert c > a + b
    for exported in (to_mjcf(file), to_urdf(file)):
        words = (
            f'inertia of link_2 as it is: no rigid body has it, its smallest .* {c - a - b:.6g} '
        )
        assert [line for line in exported.lost if re.match(words, line)]
    mujoco.MjModel.from_xml_string(to_mjcf(file).text)


SOLID = (2.0, 'ixx="0.02" iyy="0.03" izz="0.025" ixy="0.001" ixz="-0.002" iyz="0.003"')
NOTHING = (0.0, 'ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"')
POINT, ROD = (2.0, NOTHING[1]), (2.0, 'ixx="0.1" iyy="0" izz="0.1" ixy="0" ixz="0" iyz="0"')


def two_links(folder, first, second, **robot):
    """Two joints on a free base, the second across the first."""

    def link(name, mass, inertia):
        own = f'<origin xyz="0.1 0.02 -0.03"/><mass value="{mass}"/><inertia {inertia}/>'
        return f'<link name="{name}"><inertial>{own}</inertial></link>'

    def joint(name, parent, child, axis):
        limits = '<limit lower="0" upper="0" effort="50" velocity="2"/>'
        place = '<origin xyz="0.3 -0.1 0.2" rpy="0.4 0.2 -0.3"/>'
        ends = f'<parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
        return f'<joint name="{name}" type="revolute">{ends}{place}{limits}</joint>'

    base = (20.0, 'ixx="2" iyy="2" izz="2" ixy="0" ixz="0" iyz="0"')
    links = [link('base_link', *base), link('a', *first), link('b', *second)]
    joints = [joint('j1', 'base_link', 'a', '0 0 1'), joint('j2', 'a', 'b', '0 1 0')]
    (folder / 'two.urdf').write_text(f'<robot name="two">{"".join(links + joints)}</robot>')
    settings = {'robot': {'urdf': 'two.urdf', 'joints': ['j1', 'j2'], **robot}}
    path = folder / 'two.yaml'
    path.write_text(yaml.safe_dump({'/**': {'ros__parameters': settings}}))
    return load_robot_file(path)


@pytest.mark.parametrize(
    ('first', 'second', 'lost'),
    [
        (NOTHING, SOLID, 'that a has no mass: MuJoCo needs some'),
        (SOLID, POINT, 'that b has no inertia about every axis'),
        (ROD, SOLID, 'that a has no inertia about every axis'),
    ],
    ids=['massless link', 'point mass', 'thin rod'],
)
def test_mujoco_holds_what_it_is_given_and_has_the_same_mass_matrix(tmp_path, first, second, lost):
    file = two_links(tmp_path, first, second)
    exported = to_mjcf(file)
    assert any(line.startswith(lost) for line in exported.lost)
    assert sum(line.startswith('limits of j') for line in exported.lost) == 2  # of one place
    model = mujoco.MjModel.from_xml_string(exported.text)
    data = mujoco.MjData(model)
    q = np.array([0.4, -0.7])
    data.qpos[:] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, *q]
    mujoco.mj_forward(model, data)
    theirs = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, theirs)
    M = Dynamics(file.robot).mass_matrix(q)
    np.testing.assert_allclose(theirs, M, rtol=1e-7, atol=1e-8 * np.max(M))


def test_wheels_on_a_link_without_inertia_are_refused_by_name(tmp_path):
    wheels = {'links': ['b'], 'momentum': [1.0, 0.0, 2.0]}
    file = two_links(tmp_path, SOLID, POINT, target_wheels=wheels)
    with pytest.raises(ConfigurationError, match="link 'b': has wheels and no inertia"):
        to_mjcf(file)


def test_delays_noise_and_limits_are_in_the_file(tmp_path):
    effects = {'late': {'effect': 'attitude_delay', 'delay': 0.02}}
    file = load_robot_file(written(tmp_path, effects))
    text = to_mjcf(file).text
    mujoco.MjModel.from_xml_string(text)  # its own compiler takes it
    root = ET.fromstring(text)
    attitude = root.find('sensor/framequat')
    assert float(attitude.get('delay')) == 0.02
    assert float(attitude.get('noise')) == file.robot.sensors.attitude_std
    assert root.find('sensor/gyro').get('delay') is None
    assert root.find('actuator/motor').get('ctrlrange') == '-3000.0 3000.0'


def test_what_a_format_lacks_is_said_and_counted(tmp_path, capsys):
    path = written(tmp_path, {**SMOOTH, **LOST})
    target = tmp_path / 'model.xml'
    arguments = ['export', '--robot', str(path), '--to', 'mjcf', '-o', str(target)]
    assert main.main(arguments) == 0
    printed = capsys.readouterr().out
    assert '6 effects written, 2 things lost' in printed
    assert 'lost: joint_torque_ripple@joint_1 (amplitude 1 N m, harmonic 4' in printed
    assert 'lost: gyro_bias (x 0.001 rad/s' in printed
    assert main.main([*arguments, '--force', '--json']) == 0
    assert len(keeps('export', capsys.readouterr().out)['lost']) == 2
    assert main.main(arguments) == 2
    assert 'is already there; --force replaces it' in capsys.readouterr().err


def test_urdf_has_bodies_and_joints_and_says_the_rest(tmp_path):
    file = load_robot_file(written(tmp_path, SMOOTH))
    exported = to_urdf(file)
    root = ET.fromstring(exported.text.encode())
    dynamics = root.find("joint[@name='joint_2']/dynamics")
    assert float(dynamics.get('damping')) == 20.0
    second = root.find("link[@name='link_2']/inertial")
    assert float(second.find('mass').get('value')) == 110.0
    words = ' '.join(exported.lost)
    for lost in (
        'wheel momentum of link_3',
        'motor inertia of joint_3',
        'joint_stiffness@joint_1',
    ):
        assert lost in words
    again = tmp_path / 'again.urdf'
    again.write_text(exported.text)
    content = yaml.safe_load((CONFIG / 'servicer.yaml').read_text())
    content['/**']['ros__parameters']['robot']['urdf'] = str(again)
    (tmp_path / 'again.yaml').write_text(yaml.safe_dump(content))
    np.testing.assert_allclose(
        load_robot_file(tmp_path / 'again.yaml').robot.inertial_parameters,
        file.believed.inertial_parameters,
        rtol=1e-12,
        atol=1e-12,
    )
