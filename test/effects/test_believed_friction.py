"""Friction of a URDF is believed, replaced by what is named, and stays what it is in exports."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import yaml

from spacerobot_ros.diagnosis.answer.extended_model import write_extended_model
from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.quality.quality import check_record
from spacerobot_ros.effects.believed_friction import extended, totals
from spacerobot_ros.effects.catalogue import bind_effect
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.model.writer import write_robot_file
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps
from spacerobot_ros.simulation.export.mjcf import to_mjcf
from spacerobot_ros.simulation.export.plain_urdf import to_urdf

URDF = """<robot name="lone"><link name="floor"/>
  <link name="body"><inertial><mass value="3"/>
    <inertia ixx="0.05" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tip"/>
  <joint name="joint" type="revolute"><parent link="floor"/><child link="body"/>
    <axis xyz="0 0 1"/><limit lower="-6" upper="6" effort="100" velocity="5"/>
    <dynamics damping="2.0" friction="0.5"/></joint>
  <joint name="flange" type="fixed"><parent link="body"/><child link="tip"/>
    <dynamics damping="-1" friction="7"/></joint>
</robot>"""
LAWS = ('joint_viscous_friction', 'joint_coulomb_friction')


def written(folder, effects=None, urdf=URDF):
    (folder / 'lone.urdf').write_text(urdf)
    robot = {'urdf': 'lone.urdf', 'base': 'fixed', 'joints': ['joint']}
    robot['gravity'] = [0.0, 0.0, -9.81]
    content = {'robot': robot, **({'effects': effects} if effects else {})}
    path = folder / 'lone.yaml'
    path.write_text(yaml.safe_dump({'/**': {'ros__parameters': content}}))
    return path


def friction(path):
    """Of each law, all effects together, and how many these are."""
    effects = load_robot_file(path).effects
    sizes = ([v for e in effects if e.id == law for v in e.values.values()] for law in LAWS)
    return [(sum(own), len(own)) for own in sizes]


def recorded(rng, viscous, coulomb):
    time = np.arange(3000)[:, None] / 100.0
    terms = ((0.6, 1.3, 0.0), (0.4, 3.1, 1.0), (0.1, 5.3, 0.3))
    q, qd, qdd = (
        sum(a * w**k * np.sin(w * time + phase + 0.5 * np.pi * k) for a, w, phase in terms)
        for k in range(3)
    )
    effort = 0.05 * qdd + viscous * qd + coulomb * np.sign(qd)
    noise = np.array([[[1e-5]], [[0.03]]]) * rng.standard_normal((2, *q.shape))
    stamps = to_stamps(time[:, 0])
    return Record(joints=JointSeries(('joint',), stamps, q + noise[0], None, effort + noise[1]))


def test_the_urdf_is_believed_where_the_file_does_not_state_it(tmp_path):
    assert friction(written(tmp_path)) == [(2.0, 1), (0.5, 1)]
    own = {'mine': {'effect': LAWS[0], 'where': 'joint', 'coefficient': 3.0}}
    assert friction(written(tmp_path, own)) == [(3.0, 1), (0.5, 1)]
    law = {'coulomb': 1.0, 'static': 1.5, 'velocity': 0.01}
    own = {'mine': {'effect': 'joint_stribeck_friction', 'where': 'joint', **law}}
    assert friction(written(tmp_path, own)) == [(2.0, 1), (0, 0)]


def test_what_is_named_is_the_total(tmp_path):
    robot = load_robot_file(written(tmp_path)).robot
    believed = load_robot_file(written(tmp_path)).effects
    law = {'coulomb': 0.25, 'static': 0.75, 'velocity': 0.01}
    found = [bind_effect('found', 'joint_stribeck_friction', 'joint', law, robot)]
    (total,) = totals(found, believed)
    assert dict(total.values) == {'coulomb': 0.75, 'static': 1.25, 'velocity': 0.01}
    assert [e.id for e in extended(believed, [total])] == [LAWS[0], 'joint_stribeck_friction']


@pytest.mark.parametrize(
    ('viscous', 'coulomb', 'names'),
    [
        (2.0, 0.5, {}),
        (1.2, 0.5, {LAWS[0]: 1.2}),
        (3.0, 0.5, {LAWS[0]: 3.0}),
        (2.0, 0.1, {LAWS[1]: 0.1}),
        (0.0, 0.5, {LAWS[0]: 0.0}),
    ],
)
def test_a_diagnosis_names_totals_more_and_less(viscous, coulomb, names, rng, tmp_path):
    path, record = written(tmp_path), recorded(rng, viscous, coulomb)
    file = load_robot_file(path)
    found = diagnose(record, file.robot, file.effects)
    sizes = {c.applied.id: next(iter(c.parameters.values())) for c in found.causes}
    assert sizes.keys() == names.keys()
    for name, truth in names.items():
        assert abs(sizes[name].value - truth) < 4.0 * sizes[name].std < 0.4
    causes = [*(c.applied for c in found.causes), *found.calibration]
    model = write_extended_model(path, causes, tmp_path / 'extended.yaml')
    assert [count for _, count in friction(model)] == [1, 1]
    again = load_robot_file(model)
    assert not diagnose(record, again.robot, again.effects).causes


def test_check_says_it(rng, tmp_path):
    quality = check_record(recorded(rng, 2.0, 0.5), load_robot_file(written(tmp_path)))
    said = 'friction of the URDF is believed: joint viscous 2 N m s/rad, Coulomb 0.5 N m'
    assert said in quality.notes


@pytest.mark.parametrize('own', [{}, {LAWS[0]: {'coefficient': 1.25}, LAWS[1]: {'torque': 0.0}}])
def test_exports_and_written_files_keep_it(own, tmp_path):
    effects = {law: {'effect': law, 'where': 'joint', **values} for law, values in own.items()}
    path, sizes = written(tmp_path, effects), [1.25, 0.0] if own else [2.0, 0.5]
    file = load_robot_file(path)
    urdf, mjcf = to_urdf(file), to_mjcf(file)
    assert not [line for line in (*urdf.lost, *mjcf.lost) if 'friction' in line]
    (tmp_path / 'again').mkdir()
    again = written(tmp_path / 'again', {}, urdf.text)
    assert [size for size, _ in friction(again)] == sizes
    theirs = pin.buildModelFromXML(urdf.text)
    assert [theirs.damping[0], theirs.friction[0]] == sizes
    model = mujoco.MjModel.from_xml_string(mjcf.text)
    assert [*model.dof_damping, *model.dof_frictionloss] == sizes
    back = mujoco.MjModel.from_xml_string(urdf.text)
    assert [*back.dof_damping, *back.dof_frictionloss] == sizes
    yaml_path, _ = write_robot_file(file.robot, path, tmp_path / 'new.yaml')
    assert [size for size, _ in friction(yaml_path)] == sizes
