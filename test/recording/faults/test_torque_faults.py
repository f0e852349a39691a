"""Slips that only torques show are named; friction and unknown wheels are no slips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import savgol_filter

mujoco = pytest.importorskip('mujoco')

from support.against_mujoco import point_mass  # noqa: E402

from spacerobot_ros.effects.robot_file import load_robot_file  # noqa: E402
from spacerobot_ros.recording.faults.torque_faults import _explains, find_torque_faults, smoothed  # noqa: E402
from spacerobot_ros.recording.record import JointSeries, Record  # noqa: E402
from validation.mujoco.truth import ROBOTS, generate  # noqa: E402

DEGREES = 180.0 / np.pi


@pytest.fixture(scope='module')
def known(tmp_path_factory):
    """Record and robot by name, ten seconds each."""
    out = {}
    for name in ROBOTS:
        case = generate(name, folder=tmp_path_factory.mktemp(name), seed=6, duration=10.0)
        out[name] = case.data, load_robot_file(case.robot).robot
    return out


def changed(record, position=1.0, effort=1.0, order=None, effort_order=None):
    """Position and rate, and effort, scaled and reordered."""
    j = record.joints
    same = list(range(len(j.names)))
    order, effort_order = order or same, effort_order or order or same
    return replace(
        record,
        joints=JointSeries(
            j.names,
            j.stamp_ns,
            j.position[:, order] * position,
            j.velocity[:, order] * position,
            j.effort[:, effort_order] * effort,
        ),
    )


def flip(n, i):
    return np.where(np.arange(n) == i, -1.0, 1.0)


SLIPS = {
    'mN m': ({'effort': 1000.0}, 'joint_torque', 'a thousand times too large'),
    'kN m': ({'effort': 1e-3}, 'joint_torque', 'a thousand times too small'),
    'sign': ({'effort': -1.0}, 'joint_torque', 'all efforts are of the wrong sign'),
    'degrees': ({'position': DEGREES}, 'joints', 'degrees instead of radians'),
}


@pytest.mark.parametrize('robot', ['servicer', 'ground'])
@pytest.mark.parametrize('slip', SLIPS)
def test_a_unit_or_a_sign_of_all(known, robot, slip):
    record, model = known[robot]
    changes, place, words = SLIPS[slip]
    (fault,) = find_torque_faults(changed(record, **changes), model)
    assert fault.place == place
    assert words in fault.message


PAIRS = [
    ('servicer', 0, 1),
    ('servicer', 1, 2),
    ('sixdof', 1, 2),
    ('sixdof', 4, 5),
    ('ground', 1, 2),
]


@pytest.mark.parametrize(('robot', 'i', 'j'), PAIRS)
def test_exchanged_and_flipped_joints(known, robot, i, j):
    record, model = known[robot]
    n = model.n_joints
    order = list(range(n))
    order[i], order[j] = j, i
    (fault,) = find_torque_faults(changed(record, order=order), model)
    assert (fault.kind, fault.place) == ('exchanged', 'joints')
    assert f'{model.joints[i]} and {model.joints[j]}' in fault.message
    (fault,) = find_torque_faults(changed(record, position=flip(n, j), effort=flip(n, j)), model)
    assert (fault.kind, fault.place) == ('sign', f'joints/{model.joints[j]}')
    (fault,) = find_torque_faults(changed(record, effort=flip(n, j)), model)
    assert (fault.kind, fault.place) == ('sign', f'joint_torque/{model.joints[j]}')


def weightless(record, model):
    """Efforts less what holds the arm, by MuJoCo."""
    machine = mujoco.MjModel.from_xml_string(model.urdf)
    state, order = mujoco.MjData(machine), [machine.joint(name).dofadr[0] for name in model.joints]
    held = []
    for q in record.q:
        state.qpos[order] = q
        mujoco.mj_forward(machine, state)
        held.append(state.qfrc_bias[order])
    return replace(record, joints=replace(record.joints, effort=record.effort - np.array(held)))


@pytest.mark.parametrize('robot', ['ground', 'pendulum'])
def test_gravity_that_is_taken_out_of_efforts(known, robot):
    record, model = known[robot]
    compensated = replace(model, effort_kinds=('gravity_compensated',) * model.n_joints)
    light = weightless(record, model)
    assert find_torque_faults(light, compensated) == ()
    (fault,) = find_torque_faults(light, model)
    assert (fault.kind, fault.message) == (
        'gravity',
        'gravity is not in them: robot.effort_kind gravity_compensated, by control or '
        'counterweights?',
    )  # fmt: skip
    (fault,) = find_torque_faults(record, compensated)
    assert (fault.kind, fault.message) == ('gravity', 'gravity is in them')


def test_joints_without_a_motor_have_no_efforts_that_lack_gravity(known):
    """Released, a servo fell on a stop and lay there; its efforts were said to lack gravity."""
    record, model = known['pendulum']
    light = weightless(record, model)
    off = np.ones(light.q.shape, dtype=bool)
    joints = replace(light.joints, effort=0.0 * light.effort)
    (fault,) = find_torque_faults(replace(light, joints=joints), model)
    assert fault.kind == 'gravity'
    assert not find_torque_faults(replace(light, joints=replace(joints, unpowered=off)), model)


@pytest.mark.parametrize('robot', ROBOTS)
def test_clean_data_have_no_slip(known, robot):
    assert find_torque_faults(*known[robot]) == ()


CAUSES = {
    'friction': [('joint_viscous_friction', 'joint_2', {'coefficient': 30.0})],
    'dry friction': [('joint_coulomb_friction', 'joint_2', {'torque': 2.0})],
    'payload': [('inertial_parameters', 'link_1', point_mass(3.0, (0.2, 0.1, 0.3)))],
    'torque constant': [('joint_torque_constant', 'joint_2', {'gain': 0.6})],
    'harness': [('joint_stiffness', 'joint_2', {'stiffness': 20.0, 'rest_angle': 0.5})],
}


@pytest.mark.parametrize('robot', ['servicer', 'ground'])
@pytest.mark.parametrize('cause', CAUSES)
def test_a_physical_cause_is_no_slip(tmp_path, robot, cause):
    case = generate(robot, CAUSES[cause], folder=tmp_path, seed=7, duration=5.0)
    assert find_torque_faults(case.data, load_robot_file(case.robot).robot) == ()


@pytest.mark.parametrize('robot', ['servicer', 'sixdof'])
def test_unknown_wheels_are_no_slip(tmp_path, robot):
    momentum = dict(zip('xyz', ROBOTS[robot].momentum, strict=True))
    wheels = [('target_wheel_momentum', ROBOTS[robot].target, momentum)]
    believed = replace(ROBOTS[robot], momentum=(0.0, 0.0, 0.0))
    case = generate(believed, wheels, folder=tmp_path, seed=7, duration=5.0)
    assert find_torque_faults(case.data, load_robot_file(case.robot).robot) == ()


def test_without_efforts_or_samples_there_is_nothing_to_say(known):
    record, model = known['servicer']
    j = record.joints
    assert find_torque_faults(replace(record, joints=None), model) == ()
    assert find_torque_faults(replace(record, rates=None), model) == ()
    bare = JointSeries(j.names, j.stamp_ns, j.position, j.velocity)
    assert find_torque_faults(replace(record, joints=bare), model) == ()
    few = JointSeries(j.names, j.stamp_ns[:60], j.position[:60], None, j.effort[:60])
    assert find_torque_faults(replace(record, joints=few), model) == ()
    assert find_torque_faults(Record(), model) == ()


def test_a_base_that_is_turned(known):
    record, model = known['ground']
    true = model.gravity
    believed = replace(model, gravity=np.array([true[2], true[0], true[1]]))
    (fault,) = find_torque_faults(record, believed)
    assert fault.place == 'joint_torque'
    told = np.array([float(x) for x in fault.message.split('[')[1].split(']')[0].split(',')])
    seen = np.abs(model_axes(model)) < 0.5  # a weight along all axes turns no joint
    np.testing.assert_allclose(told[seen], true[seen], rtol=0.0, atol=0.2)
    level = replace(model, gravity=true + np.array([0.5, 0.0, 0.0]))  # 3 degrees: a cause, no slip
    assert not find_torque_faults(record, level)


def model_axes(model):
    """(3,) mean direction of the joints' axes at zero, of a planar arm."""
    return np.mean([np.abs(body.axis) for body in model.bodies[1:]], axis=0)


def test_joints_at_rest_hold_any_torque(known):
    """Motors that are idle while brakes hold: their efforts are no weight, and no slip."""
    record, model = known['ground']
    still = np.tile(record.q[:1], (len(record.q), 1))
    at_rest = JointSeries(record.joints.names, record.joints.stamp_ns, still, effort=0.0 * still)
    assert not find_torque_faults(replace(record, joints=at_rest), model)


def test_a_joint_in_jerks_holds_any_torque_between_them(known):
    """Another one is touched by them; neither says that weight is not in the efforts."""
    record, model = known['ground']
    time = record.joint_time
    q = np.tile(record.q[:1], (len(record.q), 1))
    jerks = np.floor(time / 2.0) + np.minimum(np.mod(time, 2.0) / 0.15, 1.0)
    q += np.outer(jerks, np.eye(q.shape[1])[1] * 0.1 + np.eye(q.shape[1])[0] * 2e-3)
    idle = JointSeries(record.joints.names, record.joints.stamp_ns, q, effort=0.0 * q)
    assert not find_torque_faults(replace(record, joints=idle), model)


@pytest.mark.parametrize('span', [5, 21, 41])
def test_smoothed_is_the_filter_of_savitzky_and_golay(span, rng):
    values, step = rng.normal(size=(200, 2)), 0.01
    rows = np.arange(span, 200 - span, 7)
    expected = [
        savgol_filter(values, span, 3, order, step, axis=0)[rows] * step**order
        for order in range(3)
    ]
    found = (
        smoothed(values[rows[:, None] + np.arange(span) - span // 2], step)
        * step ** np.arange(3.0)[:, None, None]
    )
    # numbers of one and below, whose windows of cubics are conditioned like span^3
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


WRONG = {
    'signs': ({'effort': -1.0}, 'all efforts are of the wrong sign'),
    'a sign': ({'effort': flip(3, 1)}, 'of the wrong sign'),
    'mN m': ({'effort': 1000.0}, 'a thousand times too large'),
    'x 100': ({'effort': 100.0}, 'a hundred times too large'),
    'exchanged': ({'effort_order': [1, 0, 2]}, 'joint_1 and joint_2 are exchanged'),
}


@pytest.mark.parametrize('slip', WRONG)
def test_slips_are_named_beside_unknown_wheels_and_bodies_that_are_a_quarter_off(known, slip):
    record, model = known['servicer']
    changes, words = WRONG[slip]
    wheels = np.concatenate([g.momentum for g in model.target_wheels])
    unknown = model.with_target_momentum(0.0 * wheels)
    lighter = unknown.with_inertial_parameters(
        model.inertial_parameters * np.array([1.0, 0.8, 1.25, 0.8])[:, None]
    )
    for believed in (unknown, lighter):
        assert find_torque_faults(record, believed) == ()
        (fault,) = find_torque_faults(changed(record, **changes), believed)
        assert words in fault.message


def test_joints_that_a_slip_did_not_change_do_not_name_it():
    before, after = np.array([0.03, 1.1, 1.1]), np.array([0.001, 0.9, 0.9])
    assert not _explains(before, after, np.array([False, True, True]))
    assert _explains(before, after, np.array([True, True, True]))
