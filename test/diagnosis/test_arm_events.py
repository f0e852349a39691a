"""Events of an arm: pulses added to what real arms leave are found, and nothing else is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.signal import lfilter

from spacerobot_ros.diagnosis.answer.event_answer import with_events
from spacerobot_ros.diagnosis.answer.result import Diagnosis
from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.events.arm_events import arm_events
from spacerobot_ros.diagnosis.events.naming import together
from spacerobot_ros.diagnosis.events.rest import Rest
from spacerobot_ros.diagnosis.events.transient import Transient, place_of
from spacerobot_ros.diagnosis.limits import REST_SHARE
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.errors import RecordingError
from spacerobot_ros.estimation.balance.arm_levels import leftover_level
from spacerobot_ros.estimation.balance.arm_rows import ArmRows
from spacerobot_ros.estimation.balance.balance import balance_of
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps
from spacerobot_ros.report.event_tables import event_table
from validation.hidden.event_machines import MACHINES
from validation.hidden.real_arm import COULOMB, JOINTS, RATE, RealArm, arm_file

PULSES = ((1, 6.0, 1.0, 25.0), (3, 12.0, 0.6, -4.0), (0, 17.0, 1.5, 30.0))
"""Joint, start [s], duration [s], torque on the joint [N m]: 0.8 to 1.5 times its friction."""


def pushed(record, pulses):
    """The record of a machine on which somebody acts: its motors hold against it."""
    efforts, time = record.effort.copy(), record.effort_time
    for joint, start, duration, torque in pulses:
        phase = np.clip((time - start) / duration, 0.0, 1.0)
        efforts[:, joint] -= torque * np.sin(np.pi * phase) ** 2
    return replace(record, joints=replace(record.joints, effort=efforts))


@pytest.fixture(scope='module')
def moving():
    file = arm_file()
    record = RealArm(31).record(0, duration=20.0)
    return diagnose(pushed(record, PULSES), file.robot, file.effects)


def test_pulses_are_named_with_time_joint_and_size(moving):
    """Middle within 0.1 s, size within 15 %: what is asked from a signal-to-noise ratio of 20."""
    assert moving.verdict in ('explained', 'partly_explained')
    assert len(moving.events.named) == len(PULSES)
    for event, (joint, start, duration, torque) in zip(moving.events.named, PULSES, strict=True):
        name = JOINTS[joint]
        assert (event.effect, event.where, event.joints) == (
            'external_joint_torque',
            name,
            (name,),
        )
        assert abs(0.5 * (event.start + event.end) - start - 0.5 * duration) < 0.1
        assert event.peak[name] == pytest.approx(torque, rel=0.15)
        assert abs(event.peak[name] - torque) < 4.0 * event.peak_std[name] + 0.05 * abs(torque)
        assert event.p_value < 1e-6
        limit = moving.events.limits[name]
        assert abs(torque) > 0.5 * limit.peak  # they are no larger than what is promised


def test_all_else_is_as_without_them(moving):
    """The machine is as its file says: a push is no spring, and no bias."""
    assert not moving.causes
    assert moving.gain.before < 1.5  # held-out errors leave the events out


def test_pushes_that_fill_a_third_of_a_recording_do_not_hide_each_other():
    """None was even listed: the level was theirs, and beside it each was small."""
    file = arm_file()
    pulses = [(1, 2.2 + 1.4 * k, 0.5, 25.0 * s) for k, s in enumerate((1.0, -1.0, 1.1, -0.9, 1.0))]
    record = pushed(RealArm(35).record(0, duration=10.0), pulses)
    balance = balance_of(record, file.robot, file.effects)
    rows = ArmRows.of([balance], [CATALOGUE['joint_coulomb_friction']])
    named = arm_events([balance], rows).events.named
    assert [e.where for e in named] == ['joint_2'] * len(pulses)
    for event, (_, start, duration, torque) in zip(named, pulses, strict=True):
        assert abs(0.5 * (event.start + event.end) - start - 0.5 * duration) < 0.1
        assert event.peak['joint_2'] == pytest.approx(torque, rel=0.15)


def test_a_pass_over_a_recording_finds_again_only_what_changed(monkeypatch):
    """Every pass found the level of every joint: a second of CPU more for each."""
    file, found = arm_file(), []

    def counted(rows, j, priors, friction, own):
        found.append(j)
        return leftover_level(rows, j, priors, friction, own)

    monkeypatch.setattr('spacerobot_ros.diagnosis.events.joint_templates.leftover_level', counted)
    record = pushed(RealArm(31).record(0, duration=20.0), PULSES[:1])
    balance = balance_of(record, file.robot, file.effects)
    arm_events([balance], ArmRows.of([balance], [CATALOGUE['joint_coulomb_friction']]))
    counts = [found.count(j) for j in range(len(JOINTS))]
    assert min(counts) == 2 < counts[PULSES[0][0]]  # once before rows are divided anew


def test_what_may_come_from_outside_says_nothing_of_the_machine_either():
    """A burst below the limit of a name hid the viscous friction of its joint on a public arm."""
    file, weak = arm_file(), (3, 12.0, 0.6, -1.8)
    record = pushed(RealArm(31).record(0, duration=20.0), [PULSES[0], weak])
    balances = [balance_of(record, file.robot, file.effects)]
    kinds = ('joint_coulomb_friction', 'inertial_parameters')
    found = arm_events(balances, ArmRows.of(balances, [CATALOGUE[kind] for kind in kinds]))
    assert [e.where for e in found.events.named] == ['joint_2']
    assert [(e.joints, e.reason) for e in found.events.possible] == [(('joint_4',), 'weak')]
    ((first, second),) = found.left_out
    assert first[0] < 6.5 < first[1] < second[0] < 12.3 < second[1]


def test_quiet_machines_have_none():
    file = arm_file()
    for seed in (41, 42):
        found = diagnose(RealArm(seed).record(0, duration=12.0), file.robot, file.effects)
        assert not found.events.named
        assert set(found.events.limits) == set(JOINTS)


@pytest.mark.parametrize('seed', [34, 37])
def test_a_pause_of_a_recording_is_no_event(seed):
    """What filters make of its ends was named, z = 19 and 13, though nobody came."""
    file, whole = arm_file(), RealArm(seed).record(0, duration=20.0)
    seconds = 1e-9 * (whole.joints.stamp_ns - whole.joints.stamp_ns[0])
    kept = (seconds < 8.0) | (seconds > 13.37)
    series = {name: getattr(whole.joints, name) for name in ('stamp_ns', 'position', 'effort')}
    parts = {name: values[kept] for name, values in series.items()}
    record = replace(whole, joints=replace(whole.joints, velocity=None, **parts))
    balance = balance_of(record, file.robot, file.effects)
    rows = ArmRows.of([balance], [CATALOGUE['joint_coulomb_friction']])
    found = arm_events([balance], rows).events
    assert not found.named
    assert 'edge' in {e.reason for e in found.possible}


def test_what_comes_back_at_the_same_state_is_no_event():
    """Twice the same motion with the same torque at the same place of it: friction, a cable."""
    file, arm = arm_file(), RealArm(33)
    records = [
        pushed(arm.record(run, motion=5, duration=12.0), [(1, 5.0, 0.8, 25.0)]) for run in (0, 1)
    ]
    found = diagnose(records, file.robot, file.effects)
    assert not found.events.named
    assert {e.reason for e in found.events.possible} == {'recurs'}


def test_a_rough_recording_among_smooth_ones_has_none(rng):
    """A drive that chatters: a dozen were listed or named, by the level of all recordings."""
    file, arm = arm_file(), RealArm(33)
    smooth, rough = (arm.record(0, duration=12.0), arm.record(3, duration=5.0))
    keep = np.exp(-1.0 / (0.1 * RATE))  # in a tenth of a second
    noise = np.sqrt(1.0 - keep**2) * rng.standard_normal(rough.effort.shape)
    effort = rough.effort + 0.4 * COULOMB * lfilter([1.0], [1.0, -keep], noise, axis=0)
    rough = replace(rough, joints=replace(rough.joints, effort=effort))
    balances = [
        balance_of(record, file.robot, file.effects)
        for record in (pushed(smooth, PULSES[:1]), arm.record(1, duration=12.0), rough)
    ]
    kinds = ('joint_coulomb_friction', 'inertial_parameters')
    rows = ArmRows.of(balances, [CATALOGUE[kind] for kind in kinds])
    events = arm_events(balances, rows).events
    assert [(e.where, e.recording) for e in events.named] == [('joint_2', 0)]
    assert not any(e.recording == 2 for e in events.possible)
    answer = with_events(Diagnosis(verdict='consistent', sentence='Nothing else.'), events)
    assert 'at joint_2 in recording 1 from ' in answer.sentence
    assert event_table(events).rows[0][1] == 'joint_2 in recording 1'


HELD = ((1, 3.0, 1.0, 60.0), (0, 6.0, 0.8, -45.0))


def held(pulses, seed=2):
    """An arm that stands while somebody pushes."""
    return pushed(RealArm(seed).record(0, moving=(), duration=9.0), pulses)


def test_pushes_of_an_arm_held_still():
    file = arm_file()
    found = diagnose(held(HELD), file.robot, file.effects)
    assert found.verdict == 'explained'
    assert not found.causes
    assert [e.joints for e in found.events.named] == [('joint_2',), ('joint_1',)]
    for event, (joint, start, duration, torque) in zip(found.events.named, HELD, strict=True):
        assert start - 0.1 < event.start < event.end < start + duration + 0.1
        assert abs(event.peak[JOINTS[joint]] - torque) < COULOMB[joint]  # its friction's share


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_a_torque_that_creeps_at_rest_is_pushed_by_what_friction_does_not_hold_or_not_at_all(side):
    """It leaves what friction holds by little more in a second: a weight that is wrong does."""
    file = arm_file()
    record = RealArm(2).record(0, moving=(), duration=12.0)
    efforts, time = record.effort.copy(), record.effort_time
    efforts[:, 1] += side * 2.8 * COULOMB[1] * time / time[-1]
    creeping = replace(record, joints=replace(record.joints, effort=efforts))
    found = arm_events([balance_of(creeping, file.robot, file.effects)], None)
    assert all(abs(e.peak['joint_2']) > REST_SHARE * COULOMB[1] for e in found.events.named)


def test_friction_holds_what_is_within_its_bound():
    file = arm_file()
    with pytest.raises(RecordingError, match='no joint moves'):
        diagnose(held([(1, 3.0, 1.0, 15.0)]), file.robot, file.effects)


def test_without_friction_in_the_file_a_push_is_possible_unless_it_is_beyond_any_friction():
    """A tenth of the joint's 330 N m of the URDF, times 1.4."""
    robot = arm_file(has_friction=False).robot
    found = diagnose(held([(1, 3.0, 1.0, 35.0)]), robot)
    assert found.verdict == 'unexplained'
    assert [e.reason for e in found.events.possible] == ['friction']
    assert diagnose(held([(1, 3.0, 1.0, 60.0)]), robot).events.named


def test_friction_that_may_hold_anything_tells_of_nobody():
    """A joint that stands, whose friction nobody knows and whose motor has no limit."""
    time = np.arange(300) / 100.0
    rest = Rest(0, 0, time, np.full(300, 50.0), np.full(300, np.inf), 0.1)
    assert [list(rest.cores(share)) for share in (0.0, REST_SHARE)] == [[], []]


def test_friction_of_another_recording_serves():
    file, arm = arm_file(has_friction=False), RealArm(2)
    found = diagnose([held([(1, 3.0, 1.0, 35.0)]), arm.record(1)], file.robot)
    assert [(e.recording, e.joints) for e in found.events.named] == [(0, ('joint_2',))]
    assert RATE == 100.0


@pytest.mark.parametrize('seed', [90, 140])
def test_noise_that_grows_with_the_speed_is_no_event(seed):
    machine = MACHINES['moving'](seed)
    assert machine.words.startswith('speed')
    assert not machine.found(()).named


def test_a_motor_that_gives_more_one_way_hides_no_push():
    """15 % of an elbow's torque, by the sign of its rate: limits were twice those without."""
    file, record = arm_file(), RealArm(33).record(0, duration=12.0)
    gains = np.ones(record.effort.shape)
    gains[:, 2] += 0.15 * np.sign(np.gradient(record.q[:, 2]))
    uneven = replace(record, joints=replace(record.joints, effort=record.effort / gains))
    kinds = [CATALOGUE[f'joint_{kind}_friction'] for kind in ('coulomb', 'load')]
    limits = []
    for own in (record, uneven):
        balances = [balance_of(own, file.robot, file.effects)]
        limits.append(arm_events(balances, ArmRows.of(balances, kinds)).events.limits['joint_3'])
    assert limits[1].peak < 1.2 * limits[0].peak


def test_a_contact_at_the_last_link_is_a_wrench():
    """Torques J' w by Pinocchio; forces and torques within their deviations."""
    arm, file = RealArm(35), arm_file()
    record = arm.record(0)
    wrench = np.array([60.0, -80.0, 50.0, 4.0, -3.0, 5.0])
    model, efforts, time = arm.model, record.effort.copy(), record.effort_time
    data = model.createData()
    for i in np.flatnonzero((time > 8.0) & (time < 9.0)):
        pin.computeJointJacobians(model, data, record.q[i])
        jacobian = pin.getJointJacobian(model, data, 6, pin.LOCAL)
        efforts[i] -= np.sin(np.pi * (time[i] - 8.0)) ** 2 * (jacobian.T @ wrench)
    held = replace(record, joints=replace(record.joints, effort=efforts))
    rows = ArmRows.of([balance_of(held, file.robot, file.effects)], list(CATALOGUE.values()))
    (event,) = arm_events(rows.balances, rows).events.named
    assert (event.effect, event.where) == ('external_wrench', 'link_6 or beyond')
    values, stds = np.array(list(event.wrench.values())).T
    assert np.all(np.abs(values - wrench) < 4.0 * stds + 0.05 * np.abs(wrench))
    assert np.all(stds[:3] < 30.0)
    (applied,) = event.applied
    assert applied.where == 'link_6'


@pytest.fixture(scope='module')
def twin():
    """Two arms on the ground, their joints in no order."""
    urdf = (Path(__file__).parents[2] / 'config/twin.urdf').read_text()
    joints = ['right_joint_3', 'left_joint_1', 'right_joint_1', 'left_joint_3', 'left_joint_2']
    own = {'base': 'fixed', 'joints': [*joints, 'right_joint_2']}
    settings = parse_settings({'robot': own})
    return build_robot(settings, urdf)


def test_a_contact_is_on_one_branch_however_joints_are_numbered(twin):
    right, left = [2, 5, 0], [1, 4, 3]
    assert place_of(twin, right)[1] == 'right_3 or beyond'
    assert place_of(twin, [1, 4])[1] == 'left_2 or beyond'
    assert place_of(twin, [2, 4])[1] == 'right_1 and left_2 or beyond'
    pulses = [Transient.on_joint(j, 0, (1.0, 2.0, 0.5), 20.0 - j, 1.0) for j in range(6)]
    assert [{p.joint for p in own} for own in together(twin, pulses)] == [set(right), set(left)]


def test_two_arms_that_are_held_feel_two_pushes_at_one_time(twin, rng):
    time = np.arange(900) / 100.0
    q, effort = np.array([[[2e-5]], [[0.01]]]) * rng.standard_normal((2, len(time), 6))
    series = JointSeries(twin.joints, to_stamps(time), q, None, effort)
    pushes = [(0, 4.0, 1.0, 30.0), (5, 4.0, 1.0, 40.0), (2, 4.0, 1.0, 50.0), (4, 4.1, 1.0, 60.0)]
    friction = [
        CATALOGUE['joint_coulomb_friction'](name=j, where=j, values={'torque': 5.0})
        for j in twin.joints
    ]
    found = diagnose(pushed(Record(joints=series), pushes), twin, friction)
    felt = {e.where: set(e.joints) for e in found.events.named}
    assert felt == {
        'left_joint_2': {'left_joint_2'},
        'right_3 or beyond': {'right_joint_1', 'right_joint_2', 'right_joint_3'},
    }
