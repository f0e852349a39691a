"""Joints that need next to no torque, where noise is no misfit; forces of joints that slide."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from spacerobot_ros.diagnosis.answer.cause import Estimated
from spacerobot_ros.diagnosis.answer.result import Leftover
from spacerobot_ros.diagnosis.arms.arm_verdict import Left, full_scale, sentence
from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.events.rest import rest_events
from spacerobot_ros.diagnosis.events.transient import Transient, event_of
from spacerobot_ros.diagnosis.quality.readings import readings
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.balance.balance import balance_of, own_noise_in_band
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps

URDF = """<robot name="lift">
  <link name="base_link"/>
  <link name="car"><inertial><mass value="6"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="table"><inertial><mass value="2"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="lift" type="prismatic"><parent link="base_link"/><child link="car"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="300" velocity="1"/></joint>
  <joint name="turn" type="revolute"><parent link="car"/><child link="table"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="20" velocity="3"/></joint>
</robot>"""
SCALE = np.array([80.0, 0.5])  # N, N m
LAW = CATALOGUE['joint_coulomb_friction'](name='x', where='lift', values={'torque': 1.0})
NOISE = 0.05  # N, N m: the table needs 0.006 N m


@pytest.fixture(scope='module')
def robot():
    own = {'base': 'fixed', 'joints': ['lift', 'turn'], 'gravity': [0.0, 0.0, -9.81]}
    return build_robot(parse_settings({'robot': own}), URDF)


def record_of(robot, rng, moving, gain=1.0):
    """A lift under its weight and a table on it, both moving for so long [s] of 20."""
    t = np.arange(2000) / 100.0
    rate = 2.0 * np.pi * np.array([0.23, 0.31])
    angle = np.minimum(t, moving)[:, None] * rate  # it stops short: an impact of its own
    q, on = [0.3, 0.9] * np.sin(angle), (t < moving)[:, None]
    qdd = -q * rate**2 * on
    effort = [gain, 1.0] * (qdd * [8.0, 0.01] + [8.0 * 9.81, 0.0])
    effort += NOISE * rng.standard_normal(q.shape)
    q = q + 1e-5 * rng.standard_normal(q.shape)
    return Record(joints=JointSeries(robot.joints, to_stamps(t), q, None, effort))


def test_noise_of_a_joint_without_torque_is_no_misfit(robot, rng):
    """Beside a motor that is 4 % off, as any may be: the whole is no record of noise alone."""
    found = diagnose(record_of(robot, rng, moving=20.0, gain=1.04), robot)
    assert found.verdict == 'consistent'
    assert found.sentence.startswith('The model explains the data up to ')
    assert found.sentence.count(' N m') == found.sentence.count(' N and') == 1


def test_what_noise_leaves_is_known_of_each_joint(robot, rng):
    """The filter passes 13 % less than all below its band; 80 degrees of freedom in 20 s: 8 %."""
    balance = balance_of(record_of(robot, rng, moving=20.0), robot, ())
    counts = balance.arm.is_known[:: balance.arm.stride]
    left = np.sqrt(np.mean(balance.torque[counts] ** 2, axis=0))
    np.testing.assert_allclose(left, own_noise_in_band(balance), rtol=0.3)


def test_noise_at_rest_is_no_event_where_friction_is_next_to_nothing(robot, rng):
    """Nor is what rings when a motion ends; a push of more than both is one."""
    record, nearly = record_of(robot, rng, moving=12.0), np.array([1e-3, 1e-3])
    assert not rest_events(balance_of(record, robot, ()), 0, nearly).named
    effort = record.effort.copy()
    effort[1600:1700, 1] -= np.sin(np.pi * np.arange(100) / 100.0) ** 2
    pushed = replace(record, joints=replace(record.joints, effort=effort))
    (event,) = rest_events(balance_of(pushed, robot, ()), 0, nearly).named
    assert event.where == 'turn'
    assert event.peak['turn'] == pytest.approx(1.0, abs=4.0 * NOISE)


def test_friction_of_the_load_holds_a_joint_at_rest(robot, rng):
    """A drive whose integral winds up to friction's bound and slips, again and again: no push.

    A tenth of the weight of 78.5 N is held beside dry friction of 2 N; a push of more is one.
    """
    record, dry = record_of(robot, rng, moving=10.0), np.array([2.0, 1.0])
    effort = record.effort.copy()
    effort[1000:, 0] += 9.0 * (np.linspace(0.0, 6.0, 1000) % 2.0 - 1.0)
    held = replace(record, joints=replace(record.joints, effort=effort))
    balance, of_load = balance_of(held, robot, ()), np.array([0.1, 0.0])
    assert rest_events(balance, 0, dry).named
    assert not rest_events(balance, 0, dry, of_load).named
    effort = effort.copy()
    effort[1400:1500, 0] += 60.0 * np.sin(np.pi * np.arange(100) / 100.0) ** 2
    pushed = replace(record, joints=replace(record.joints, effort=effort))
    (event,) = rest_events(balance_of(pushed, robot, ()), 0, dry, of_load).named
    assert 14.0 < event.start < 15.0


def test_forces_of_joints_that_slide_are_no_torques(robot):
    each = [Transient.on_joint(j, 0, (1.0, 2.0, 0.5), 9.0, 0.1) for j in range(2)]
    units = [event_of(robot, some, None, 9.0).unit for some in (each[:1], each[1:], each)]
    assert units == ['N', 'N m', 'N or N m']


def test_readings_of_joints_that_slide_are_ways_and_forces(robot, rng):
    units = {one.channel: one.unit for one in readings(record_of(robot, rng, moving=20.0), robot)}
    assert units == {
        'joint_position/lift': 'm',
        'joint_position/turn': 'rad',
        'joint_effort/lift': 'N',
        'joint_effort/turn': 'N m',
    }


def test_the_sentence_says_what_is_left_where(robot):
    left = Left(robot, np.array([5.0, 0.3]), np.array([0.1, 0.2]), np.array([1.0, 0.1]), SCALE)
    assert sentence('unexplained', [], left) == (
        'The model does not explain the data (0.1 of 5 N (rms) and 0.2 of 0.3 N m (rms) is left, '
        'more than usual at turn: 0.2 of 0.3 N m), and no known effect does.'
    )


def test_a_joint_that_stands_is_not_spoken_of(robot):
    before, after, usual = np.array([[np.nan, 0.3], [np.nan, 0.02], [np.nan, 0.1]])
    left = Left(robot, before, after, usual, SCALE)
    assert left.unusual == []
    assert sentence('consistent', [], left) == 'The model explains the data up to 0.02 N m (rms).'


def test_a_law_of_next_to_nothing_that_is_not_applied_is_none_of_the_verdict(robot):
    """One that is applied, or clear and of a joint with more than a hundredth left, is."""
    left = Left(robot, np.array([5.0, 0.3]), np.array([0.5, 0.1]), np.ones(2), SCALE)
    clear, unclear = ((Estimated(value=v, std=1.0, unit=''),) for v in (-3.0, -1.5))
    laws = [
        Leftover(
            channel=f'joint_torque/{joint}',
            depends_on=(f'rate/{joint}',),
            form=form,
            coefficients=coefficients,
        )
        for joint, form, coefficients in (
            ('lift', 'x', clear),
            ('turn', 'x', clear),
            ('turn', 'x', unclear),
            ('turn', None, ()),
        )
    ]
    assert [left.matters(law) for law in laws] == [False, True, False, False]
    assert left.matters(replace(laws[0], applied=LAW))


@pytest.mark.parametrize(
    ('limit', 'scale'), [(28.0, 28.0), (1e3, 50.0), (np.inf, 0.02)], ids=['its', 'made up', 'none']
)
def test_full_scale_is_the_limit_where_that_is_no_mere_number(robot, limit, scale):
    """Of a wrist that needs 20 mN m on an arm that needs 50 N m; a lift's newtons are others."""
    effort = np.array([[900.0, -50.0, 0.02], [-700.0, 10.0, -0.01]])
    arm = SimpleNamespace(
        effort_limits=np.array([300.0, 330.0, limit]),
        bodies=[robot.bodies[0], *(SimpleNamespace(is_prismatic=k == 0) for k in range(3))],
    )
    balance = SimpleNamespace(arm=SimpleNamespace(effort=effort))
    np.testing.assert_allclose(full_scale(arm, [balance]), [900.0, 50.0, scale])
