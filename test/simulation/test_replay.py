"""A recording as a scene: shapes, tracks, and what is not there said."""

from __future__ import annotations

import struct
import sys
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from support.models import AXIS, H_BASE, Part, settings_of, to_urdf

from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.robot_file import RobotFile
from spacerobot_ros.errors import ConfigurationError, ModelError
from spacerobot_ros.model.body import Body, inertia_ellipsoid
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.urdf import parse_urdf
from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries, Record
from spacerobot_ros.simulation.plant import Plant
from spacerobot_ros.simulation.replay.scene import scene_of
from spacerobot_ros.simulation.replay.shapes import read_mesh, shapes_of

STEP = 0.02


def arm():
    """A base and two links whose centres of mass are off the joints."""
    along = np.array([0.4, 0.0, 0.0])
    return [
        Part('base_link', -1, 'base', 50.0, np.zeros(3), 8.0 * np.eye(3)),
        Part('first', 0, 'revolute', 5.0, along, 0.4 * np.eye(3), AXIS['z'], along),
        Part('second', 1, 'revolute', 8.0, along, 0.6 * np.eye(3), AXIS['y'], 2.0 * along),
    ]


def robot_file(urdf=None, folder=None):
    settings = settings_of(arm(), servicer_wheels={'momentum': [float(x) for x in H_BASE / 20]})
    robot = build_robot(settings, urdf or to_urdf(arm()))
    return RobotFile(robot, settings, (), folder) if folder else RobotFile(robot, settings)


@pytest.fixture(scope='module')
def flight():
    """5 s under held torques: the record, and its file."""
    file = robot_file()
    zero = np.zeros(2)
    start = State(
        np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), zero, np.zeros(3), np.zeros(3), zero
    )
    plant = Plant(file.robot, start, STEP, 2)
    rows = []
    for k in range(250):
        rows.append((plant.state, plant.effort))
        plant.step(np.array([1.5, -1.0]) * np.sin(0.05 * k + np.arange(2)))
    stamps = np.arange(250) * round(STEP * 1e9)
    states = [state for state, _ in rows]
    joints = JointSeries(
        file.robot.joints,
        stamps,
        np.array([s.q for s in states]),
        np.array([s.qd for s in states]),
        np.array([effort for _, effort in rows]),
    )
    rates = RateSeries(stamps, np.array([s.omega_WB_B for s in states]))
    attitudes = AttitudeSeries(stamps, np.array([s.q_WB_xyzw for s in states]))
    return file, Record(joints, rates, attitudes)


def test_a_right_model_predicts_what_was_measured(flight):
    file, record = flight
    scene = scene_of(record, file)
    assert np.ptp(scene.measured.q, axis=0).min() > 0.1
    # RK4 at 20 ms, and pictures between samples read off a straight line: 30 Hz, 0.5 rad/s^2
    np.testing.assert_allclose(scene.predicted.q, scene.measured.q, rtol=0, atol=2e-4)
    turned = Rotation.from_quat(scene.predicted.attitude_xyzw).inv()
    turned = (turned * Rotation.from_quat(scene.measured.attitude_xyzw)).magnitude()
    assert turned.max() < 2e-4
    assert scene.notes == ()


def test_a_wrong_model_goes_astray_and_begins_again(flight):
    file, record = flight
    heavier = replace(
        file,
        robot=file.robot.with_inertial_parameters(1.2 * file.robot.inertial_parameters),
    )
    scene = scene_of(record, heavier)
    off = np.abs(scene.predicted.q - scene.measured.q).max(axis=1)
    assert off.max() > 0.02
    restarts = scene.measured.time[off < 1e-12]
    np.testing.assert_allclose(restarts, [0.0, 2.0, 4.0], atol=0.07)  # two pictures


def test_a_model_that_is_lost_at_once_predicts_nothing(flight):
    file, record = flight
    light = replace(
        file,
        robot=file.robot.with_inertial_parameters(1e-3 * file.robot.inertial_parameters),
    )
    scene = scene_of(record, light)
    assert scene.predicted is None
    assert scene.notes == (
        'the model is 0.3 rad or m astray within a frame, and predicts nothing',
    )


def test_the_centre_of_mass_rests_and_total_momentum_stays(flight):
    file, record = flight
    scene = scene_of(record, file)
    rotation = Rotation.from_quat(scene.measured.attitude_xyzw)
    first = Rotation.from_rotvec(scene.measured.q[:, :1] * AXIS['z'])
    second = first * Rotation.from_rotvec(scene.measured.q[:, 1:] * AXIS['y'])
    along = np.array([0.4, 0.0, 0.0])
    at_first, at_second = (
        along + first.apply(along),
        along + first.apply(2.0 * along) + second.apply(along),
    )
    centre = (5.0 * at_first + 8.0 * at_second) / 63.0
    np.testing.assert_allclose(scene.measured.position + rotation.apply(centre), 0.0, atol=1e-12)
    wheels, total = scene.arrows
    np.testing.assert_allclose(wheels.values[0], H_BASE / 20)
    np.testing.assert_allclose(
        total.values, total.values[:1] + np.zeros((len(total.values), 1)), atol=5e-3
    )


def test_without_efforts_there_is_no_ghost(flight):
    file, record = flight
    scene = scene_of(replace(record, joints=replace(record.joints, effort=None)), file)
    assert scene.predicted is None
    assert scene.notes == ('no efforts were measured: the model predicts nothing',)


def test_ellipsoid_has_the_inertia_of_its_body(rng):
    turn = Rotation.random(random_state=7).as_matrix()
    half = np.array([0.5, 0.8, 1.1])
    moments = 3.0 / 5.0 * (np.sum(half**2) - half**2)  # of a homogeneous solid of 3 kg
    body = Body(
        'b',
        -1,
        np.eye(3),
        np.zeros(3),
        AXIS['z'],
        False,
        3.0,
        np.zeros(3),
        turn @ np.diag(moments) @ turn.T,
    )
    found, axes = inertia_ellipsoid(body)
    np.testing.assert_allclose(
        axes @ np.diag(found**2) @ axes.T, turn @ np.diag(half**2) @ turn.T, atol=1e-12
    )
    assert inertia_ellipsoid(replace(body, mass=0.0)) is None


def with_visuals(*visuals):
    """The arm's URDF, the first link with visuals."""
    text = to_urdf(arm())
    mark = '<link name="first">'
    assert mark in text
    return text.replace(mark, mark + ''.join(f'<visual>{v}</visual>' for v in visuals))


def test_visuals_of_the_urdf_and_meshes_that_are_missing(tmp_path):
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], dtype='<f4')
    triangle = b'\0' * 12 + corners.tobytes() + b'\0\0'
    (tmp_path / 'plate.stl').write_bytes(b'\0' * 80 + struct.pack('<I', 1) + triangle)
    urdf = with_visuals(
        '<origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/><geometry><box size="1 2 3"/>'
        '</geometry>'
        '<material name="red"><color rgba="1 0 0 1"/></material>',
        '<geometry><mesh filename="plate.stl" scale="2 2 2"/></geometry>',
        '<geometry><mesh filename="gone.dae"/></geometry>',
    )
    file = robot_file(urdf, tmp_path)
    shapes, notes = shapes_of(file.robot, tmp_path)
    box, mesh = shapes[1]
    assert (box.kind, box.size, box.color) == ('box', (1.0, 2.0, 3.0), (1.0, 0.0, 0.0))
    np.testing.assert_allclose(box.rotation @ AXIS['x'], AXIS['y'], atol=1e-12)
    np.testing.assert_allclose(mesh.triangles, 2.0 * corners)
    (note,) = notes
    assert note.startswith('mesh gone.dae: no such file')
    assert 'inertia is shown instead' in note
    assert [s.kind for s in shapes[2]] == ['ellipsoid']


def test_mesh_files(tmp_path):
    text = tmp_path / 'a.stl'
    facet = 'vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n'
    text.write_text(f'solid a\nfacet normal 0 0 1\nouter loop\n{facet}endloop\nendfacet\nendsolid')
    np.testing.assert_allclose(read_mesh(text), [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    quad = tmp_path / 'a.obj'
    quad.write_text('v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1/1 2/2 3/3 -1\n')
    assert read_mesh(quad).shape == (2, 3, 3)
    (tmp_path / 'cut.stl').write_bytes(b'\xff' * 100)
    with pytest.raises(ConfigurationError, match=r'mesh cut\.stl: is damaged'):
        read_mesh(tmp_path / 'cut.stl')
    with pytest.raises(ConfigurationError, match='convert it'):
        read_mesh(tmp_path / 'a.wrl')


DAMAGED = {
    'cut.stl': b'\0' * 80 + struct.pack('<I', 9) + b'\0' * 100,
    'nan.stl': b'solid a\nfacet\nvertex nan 0 0\nvertex 1 0 0\nvertex 0 1 0\nendfacet',
    'empty.stl': b'',
    'alone.obj': b'f 1 2 3\n',
    'text.obj': b'what is this',
    'cut.dae': b'<COLLADA',
    'other.dae': b'<html/>',
}


@pytest.mark.parametrize('name', DAMAGED)
def test_a_damaged_mesh_is_one_line(tmp_path, name):
    (tmp_path / name).write_bytes(DAMAGED[name])
    with pytest.raises(ConfigurationError, match=rf'^mesh {name}: is damaged: [^\n]+$'):
        read_mesh(tmp_path / name)


def test_the_units_of_a_collada_mesh_are_its_own(tmp_path):
    path = tmp_path / 'box.dae'
    trimesh.creation.box((1.0, 2.0, 3.0)).export(path)
    unit = '<unit name="centimeter" meter="0.01"/><up_axis>'
    path.write_text(path.read_text().replace('<up_axis>', unit))
    np.testing.assert_allclose(np.ptp(read_mesh(path), axis=(0, 1)), [0.01, 0.02, 0.03])


@pytest.mark.parametrize(('mesh', 'missing'), [('plate.stl', 'trimesh'), ('plate.dae', 'collada')])
def test_without_what_reads_meshes_the_inertia_is_seen(tmp_path, monkeypatch, mesh, missing):
    monkeypatch.setitem(sys.modules, missing, None)
    (tmp_path / mesh).write_bytes(b'')
    urdf = with_visuals(f'<geometry><mesh filename="{mesh}"/></geometry>')
    shapes, (note,) = shapes_of(robot_file(urdf, tmp_path).robot, tmp_path)
    remedy = f"{missing} is not installed: pip install 'spacerobot_ros[meshes]'"
    assert note.startswith(f'mesh {mesh}: {remedy}; the inertia is shown')
    assert [s.kind for s in shapes[1]] == ['ellipsoid']


@pytest.mark.parametrize('inner', ['<xacro:arm/>', '<link name="${prefix}base"/>'])
def test_xacro_is_told_from_urdf(inner):
    with pytest.raises(ModelError, match='is xacro, not URDF: convert it'):
        parse_urdf(f'<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro">{inner}</robot>')
