"""Exported models: MuJoCo plays them, and comes to where our own simulation comes."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.contracts import keeps
from support.models import quaternion_matrix

from spacerobot_ros.cli import main
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.robot_file import load_robot_file
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
