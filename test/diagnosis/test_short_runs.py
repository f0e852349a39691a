"""Many short runs of two joints that turn alike, each at one speed, from a start with a jump."""

import numpy as np
import pinocchio as pin
import pytest

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.recording.faults.torque_faults import find_torque_faults
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps

URDF = """<robot name="swing"><link name="base_link"/>
<link name="upper"><inertial><origin xyz="0 0 -0.1"/><mass value="20"/>
<inertia ixx="1.1" iyy="1.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base_link"/><child link="upper"/>
<axis xyz="0 1 0"/><limit lower="-9" upper="9" effort="150" velocity="9"/></joint>
<link name="lower"><inertial><origin xyz="0 0 -0.05"/><mass value="4"/>
<inertia ixx="0.09" iyy="0.09" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="elbow" type="revolute"><origin xyz="0 0 -0.45"/><parent link="upper"/>
<child link="lower"/><axis xyz="0 1 0"/><limit lower="-9" upper="9" effort="15" velocity="9"/>
</joint></robot>"""
DRY, WET = np.array([12.0, 1.7]), np.array([2.5, 0.25])
STEP, LENGTH = 0.015, 4.0
SPEEDS = (0.003, 0.004, 0.005, 0.007, 0.1, 0.3)


def run(rng, speed):
    """One run: the rate jumps to its speed within 60 ms, and wanders about it.

    What friction is at the start of a run is another thing in each, and decays within 0.2 s.
    """
    model = pin.buildModelFromXML(URDF)
    data = model.createData()
    time = np.arange(0.0, LENGTH, STEP / 5.0)
    slow = np.cumsum(rng.normal(size=(len(time), 2)), axis=0) * STEP**0.5
    wander = 0.2 * abs(speed) * np.sin(3.0 * time[:, None] + 0.2 * slow)
    rate = (speed + wander) * -np.expm1(-time[:, None] / 0.02)
    q = np.cumsum(rate, axis=0) * STEP / 5.0
    bend = np.gradient(rate, STEP / 5.0, axis=0)
    dynamics = np.array([pin.rnea(model, data, *s) for s in zip(q, rate, bend, strict=True)])
    friction = DRY * np.sign(rate) + WET * rate
    friction *= 1.0 + rng.uniform(-0.3, 0.3) * np.exp(-time[:, None] / 0.2)
    effort = dynamics + friction + 0.003 * DRY * rng.normal(size=q.shape)
    joints = JointSeries(('shoulder', 'elbow'), to_stamps(time[::5]), q[::5], effort=effort[::5])
    return Record(joints, source=f'run of {speed:g} rad/s')


@pytest.fixture(scope='module')
def robot():
    own = {'base': 'fixed', 'gravity': [0.0, 0.0, -9.81], 'joints': ['shoulder', 'elbow']}
    return build_robot(parse_settings({'robot': own}), URDF)


@pytest.fixture(scope='module')
def runs():
    rng = np.random.default_rng(8)
    return [run(rng, sign * speed) for speed in SPEEDS for sign in (1.0, -1.0)]


def test_friction_is_each_joints_own_and_nothing_else_has_a_name(runs, robot):
    """Two joints that always turn alike do not tell friction of the sum of their rates."""
    found = diagnose(runs, robot)
    named = {(c.applied.id, c.applied.where): c.applied for c in found.causes}
    viscous = {('joint_viscous_friction', joint) for joint in ('shoulder', 'elbow')}
    dry = [named.pop(('joint_coulomb_friction', joint)) for joint in ('shoulder', 'elbow')]
    assert set(named) <= viscous
    assert [effect['torque'] for effect in dry] == pytest.approx(
        DRY, rel=0.05
    )  # and what viscous friction adds
    assert not found.events.named


def test_friction_of_one_way_is_no_turned_base(runs, robot):
    """Of a joint that turns by some degrees it is a torque like that of a weight."""
    assert [find_torque_faults(record, robot) for record in runs] == [()] * len(runs)
