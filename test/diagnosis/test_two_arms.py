"""A load in the hand of one of two arms: found there, declared or not, torques by Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest

from spacerobot_ros.diagnosis.comparison.compare import compare
from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps

NAMES = ('left_1', 'left_2', 'right_1', 'right_2')
LOAD = 0.8  # kg
LINK = """
<link name="{name}_link"><inertial><origin xyz="0.1 0 0.1"/><mass value="{mass}"/>
<inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{name}_link"/>
<origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
<limit lower="-6" upper="6" effort="99" velocity="9"/></joint>"""


def urdf(load=0.0):
    """Two arms of two links each, a load added to the mass of the left one's last link."""
    masses, parents = (
        (3.0, 1.5 + load, 3.0, 1.5),
        ('torso', 'left_1_link', 'torso', 'right_1_link'),
    )
    every = zip(NAMES, masses, parents, strict=True)
    links = [LINK.format(name=name, mass=mass, parent=parent) for name, mass, parent in every]
    return '\n'.join(['<robot name="two"><link name="torso"/>', *links, '</robot>'])


def record(load, seed):
    """12 s of friction of 1 N m, a torque that nobody knows, and encoders of 1e-5 rad."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 12.0, 0.01)
    w, size = rng.uniform(1.0, 2.5, 4), rng.uniform(0.4, 0.7, 4)
    phase = w * time[:, None] + rng.uniform(0.0, 6.0, 4)
    q, qd, qdd = size * np.sin(phase), size * w * np.cos(phase), -size * w**2 * np.sin(phase)
    model = pin.buildModelFromXML(urdf(load))
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    assert tuple(model.names)[1:] == NAMES
    data = model.createData()
    torque = np.array([pin.rnea(model, data, *at) for at in zip(q, qd, qdd, strict=True)])
    torque += np.sign(qd) + 0.01 * np.cumsum(rng.normal(size=q.shape), axis=0)
    q = q + 1e-5 * rng.normal(size=q.shape)
    return Record(joints=JointSeries(NAMES, to_stamps(time), q, None, torque), source=f'{seed}')


@pytest.fixture(scope='module')
def robot():
    entries = {'base': 'fixed', 'base_link': 'torso', 'joints': list(NAMES)}
    return build_robot(parse_settings({'robot': entries | {'gravity': [0.0, 0.0, -9.81]}}), urdf())


def test_a_load_that_is_declared(robot):
    found = diagnose([record(0.0, 1), record(LOAD, 2)], robot, loaded=[1])
    (load,) = [c for c in found.causes if c.applied.id == 'inertial_parameters']
    assert (load.applied.where, load.applied.recordings) == ('left_2_link', (1,))
    mass = load.parameters['mass']
    assert abs(mass.value - LOAD) < 3.0 * mass.std < LOAD


def test_a_load_between_two_recordings(robot):
    found = compare([record(0.0, 1)], [record(LOAD, 2)], robot)
    (change,) = found.changes
    assert (change.effect, change.where) == ('inertial_parameters', 'left_2_link')
