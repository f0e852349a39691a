"""Arms whose noise nobody knows: right names at the right joints, nothing where none is."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from spacerobot_ros.diagnosis.answer.extended_model import effects_section, named
from spacerobot_ros.diagnosis.answer.output import to_dict
from spacerobot_ros.diagnosis.arms.fitted_arm import FittedArm
from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effects, changed_robot
from spacerobot_ros.errors import RecordingError
from spacerobot_ros.estimation.balance.arm_levels import leftover_levels
from spacerobot_ros.estimation.balance.arm_rows import ArmRows
from spacerobot_ros.estimation.balance.balance import balance_of, rms
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps
from validation.hidden.diagnosis_scenario import packaged
from validation.hidden.real_arm import (
    COULOMB,
    JOINTS,
    VISCOUS,
    RealArm,
    arm_file,
    arm_urdf,
)

PAYLOAD = {'mass': 3.0, 'mx': 0.0, 'my': 0.45, 'mz': 0.0}
PAYLOAD |= {'ixx': 0.07, 'ixy': 0.0, 'iyy': 0.004, 'ixz': 0.0, 'iyz': 0.0, 'izz': 0.07}


def bound(kind, where=None, **values):
    """An effect at a place."""
    return CATALOGUE[kind](name='hidden', where=where, values=values)


def payload():
    """A body of 3 kg, 15 cm from the last link's origin."""
    return bound('inertial_parameters', 'link_6', **PAYLOAD)


def causes_of(diagnosis):
    """Effects and places, with their parameters."""
    return {(c.applied.id, c.applied.where): c.parameters for c in diagnosis.causes}


def test_friction_of_every_joint_that_the_file_has_none_of():
    """Within 15 % of the machine's: 5 % from run to run, 5 % that drifts, at three deviations."""
    file = arm_file(has_friction=False)
    found = diagnose(RealArm(1).record(0), file.robot)
    assert found.verdict == 'explained'
    laws = {law.joint: law for law in found.friction}
    assert list(laws) == list(JOINTS)
    for joint, coulomb, viscous in zip(JOINTS, COULOMB, VISCOUS, strict=True):
        speed = 0.5  # rad/s, where both count
        law = laws[joint].coulomb + laws[joint].viscous * speed
        assert law == pytest.approx(coulomb + viscous * speed, rel=0.15)
    assert {kind for kind, _ in causes_of(found)} <= {
        'joint_coulomb_friction',
        'joint_viscous_friction',
        'joint_stribeck_friction',
    }


def test_joints_that_stand_are_left_alone():
    file = arm_file(has_friction=False)
    found = diagnose(RealArm(2).record(0, moving=('joint_2',)), file.robot)
    assert {'joint_2'} == {where for _, where in causes_of(found)}


@pytest.mark.parametrize('joint', ['joint_5', 'joint_6'])
def test_the_rotor_of_a_wrist_is_no_body_of_ten_numbers(joint):
    """Its reflected inertia is a hundred times that of the link, as on a geared wrist."""
    arm = RealArm(3, [bound('motor_inertia', joint, inertia=0.7)])
    file = arm_file()
    found = causes_of(diagnose(arm.record(0, moving=(joint,)), file.robot, file.effects))
    assert list(found) == [('motor_inertia', joint)]
    rotor = found['motor_inertia', joint]['inertia']
    assert abs(rotor.value - 0.7) < 3.0 * rotor.std < 0.7


def test_coulomb_friction_of_two_sizes():
    bias = CATALOGUE['torque_sensor_bias'](name='bias', where='joint_1', values={'bias': 4.0})
    arm, moving = RealArm(4, [bias]), ('joint_1', 'joint_4')
    records = [arm.record(run, moving, duration=6.0) for run in range(6)]
    found = diagnose(records, arm_file(has_friction=False).robot)
    laws = {law.joint: law for law in found.friction}
    assert laws['joint_1'].coulomb_forward == pytest.approx(COULOMB[0] + 4.0, rel=0.15)
    assert laws['joint_1'].coulomb_backward == pytest.approx(COULOMB[0] - 4.0, rel=0.15)
    assert laws['joint_4'].coulomb_forward == laws['joint_4'].coulomb_backward


def test_a_recording_in_which_nothing_moves_is_refused():
    still = RealArm(2).record(0, moving=(), duration=6.0)
    with pytest.raises(RecordingError, match='no joint moves: at rest friction holds any torque'):
        diagnose(still, arm_file().robot)


def test_a_recording_that_tells_less_than_may_be_wrong_is_refused():
    """In 2 s of six joints a rotor or a body was named in half of the machines."""
    short = RealArm(9000).record(1, duration=2.0)
    with pytest.raises(RecordingError, match=r'too short: 90 torques .*; record \d s or'):
        diagnose(short, arm_file(has_friction=False).robot)


def in_jerks(record, joint):
    """The record with a joint that goes by 0.05 rad in a tenth of a second, once a second."""
    time, j = record.joint_time, record.joints.names.index(joint)
    q = record.q.copy()
    q[:, j] = q[0, j] + 0.05 * (np.floor(time) + np.minimum(np.mod(time, 1.0) / 0.1, 1.0))
    return replace(record, joints=replace(record.joints, position=q))


def test_a_joint_that_moves_in_jerks_is_not_judged_which_is_said():
    robot = arm_file().robot
    arm, name = RealArm(2), robot.joints[3]
    with pytest.raises(RecordingError, match=rf'no joint moves but in jerks \({name}\): at rest'):
        diagnose(in_jerks(arm.record(0, moving=(), duration=6.0), name), robot)
    record = in_jerks(arm.record(0, moving=(robot.joints[0],), duration=12.0), name)
    assert any(
        note.startswith(f'{name}: moves, in jerks') for note in diagnose(record, robot).notes
    )


def with_efforts(record, efforts):
    """The record with other efforts."""
    return replace(record, joints=replace(record.joints, effort=efforts))


def test_efforts_without_gravity_are_judged_beside_the_weight_of_the_file():
    record, model = RealArm(5, [payload()]).record(0), pin.buildModelFromXML(arm_urdf())
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    data = model.createData()
    weight = [pin.computeGeneralizedGravity(model, data, q).copy() for q in record.q]
    whole = balance_of(record, arm_file().robot, ()).torque
    robot = arm_file(effort_kind='gravity_compensated').robot
    compensated = with_efforts(record, record.effort - np.array(weight))
    np.testing.assert_allclose(balance_of(compensated, robot, ()).torque, whole, atol=0.02)
    assert np.sqrt(np.mean(whole[:, 1] ** 2)) > 10.0  # the payload's weight stays


@pytest.mark.parametrize(
    ('kind', 'where', 'values', 'share'),
    [
        ('encoder_offset', 'joint_2', {'offset': 0.002}, 0.01),
        ('effort_delay', None, {'delay': 5e-4}, 0.15),  # its column is of torques that are needed
    ],
)
def test_faults_of_sensors_act_as_they_are_looked_for_beside_the_weight(
    kind, where, values, share
):
    """What holds the arm is told by the file at the angles that are read, and is never late."""
    file = arm_file(effort_kind='gravity_compensated')
    model, record = pin.buildModelFromXML(arm_urdf()), RealArm(5).record(0, duration=8.0)
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    data = model.createData()
    weight = [pin.computeGeneralizedGravity(model, data, q).copy() for q in record.q]
    light = with_efforts(record, record.effort - np.array(weight))
    fault = CATALOGUE[kind](name='x', where=where, values=values)
    as_it_is = balance_of(light, file.robot, file.effects)
    undone = balance_of(light, file.robot, (*file.effects, fault))
    (size,) = values.values()
    column = size * as_it_is.columns([(fault, size)])[:, :, 0]
    moving = as_it_is.arm.is_moving[:: as_it_is.arm.stride]
    acts = np.where(moving, as_it_is.torque - undone.torque, 0.0)[:, 1]
    looked_for = np.where(moving, column, 0.0)[:, 1]
    assert np.linalg.norm(acts - looked_for) < share * np.linalg.norm(looked_for)


def test_a_joint_without_efforts_is_left_out():
    record, file = RealArm(1).record(0), arm_file(has_friction=False)
    efforts = record.effort.copy()
    efforts[:, 3] = np.nan
    found = diagnose(with_efforts(record, efforts), file.robot)
    assert {law.joint for law in found.friction} == set(JOINTS) - {'joint_4'}
    assert 'joint_4' not in {where for _, where in causes_of(found)}
    assert np.isnan(found.residuals[3].rms_after)


def test_a_machine_as_its_file_says_has_no_cause():
    file = arm_file()
    assert not causes_of(diagnose(RealArm(3).record(0), file.robot, file.effects))


def test_a_payload_in_two_recordings():
    """Held out on whole recordings; its mass within three standard deviations."""
    file, arm = arm_file(), RealArm(4, [payload()])
    found = diagnose([arm.record(0), arm.record(1)], file.robot, file.effects)
    causes = causes_of(found)
    assert list(causes) == [('inertial_parameters', 'link_6')]
    mass = causes['inertial_parameters', 'link_6']['mass']
    assert abs(mass.value - PAYLOAD['mass']) < 3.0 * mass.std < PAYLOAD['mass']
    assert len(found.causes[0].held_out_recordings) == 2
    assert all(r.rms_after < r.rms_before for r in found.recordings)


def test_a_payload_of_one_recording_beside_what_both_share():
    """Also where the fit that suits all joints together would leave 2.3 % more of the last one."""
    file = arm_file()
    stiff = bound('joint_viscous_friction', 'joint_2', coefficient=12.0)
    records = [RealArm(4, [stiff]).record(0), RealArm(4, [stiff, payload()]).record(1)]
    found = diagnose(records, file.robot, file.effects, loaded=[1])
    causes = {c.applied.id: c for c in found.causes}
    assert list(causes) == ['inertial_parameters', 'joint_viscous_friction']
    load, friction = causes.values()
    assert (load.applied.where, load.applied.recordings) == ('link_6', (1,))
    assert (friction.applied.where, friction.applied.recordings) == ('joint_2', None)
    for cause, name, truth in ((load, 'mass', 3.0), (friction, 'coefficient', 12.0)):
        said = cause.parameters[name]
        assert abs(said.value - truth) < 3.0 * said.std < truth
    assert all(r.rms_after <= 1.02 * r.rms_before for r in found.residuals)
    assert all(not r.worse for r in found.recordings)
    assert 'link_6 in recording 2' in found.sentence
    assert [c['name'] for c in to_dict(found)['causes']] == [None, friction.applied.name]


def test_no_joint_of_any_recording_gets_worse():
    """Friction of one recording alone: half of it would suit both, and spoil the other by half."""
    more = bound('joint_coulomb_friction', 'joint_2', torque=10.0)
    machines = enumerate((RealArm(4), RealArm(4, [more])))
    records = [arm.record(run, duration=12.0) for run, arm in machines]
    file = arm_file()
    found = diagnose(records, file.robot, file.effects)
    robot = [balance_of(r, file.robot, file.effects) for r in records]
    effects = (*file.effects, *(c.applied for c in found.causes), *found.calibration)
    extended = [balance_of(r, file.robot, effects) for r in records]
    for before, after in zip(robot, extended, strict=True):
        assert np.all(rms([after]) <= 1.02 * rms([before]))


def test_a_load_is_of_arms_alone():
    record = Record(joints=None, source='flight')
    with pytest.raises(RecordingError, match='flight: has a free base'):
        diagnose([record, record], packaged('servicer').robot, loaded=[1])


def test_blocks_have_as_much_motion_each():
    """Of 24 s of motion and 24 s of rest after it no quarter is without."""
    record, file = RealArm(3).record(0), arm_file()
    time = record.joint_time
    still = [np.concatenate([x, np.tile(x[-1:], (len(x), 1))]) for x in (record.q, record.effort)]
    stamps = to_stamps(np.concatenate([time, time + time[-1] + time[1]]))
    longer = replace(record, joints=JointSeries(JOINTS, stamps, still[0], None, still[1]))
    balance = balance_of(longer, file.robot, file.effects)
    rows = ArmRows.of([balance], [CATALOGUE['torque_sensor_bias']])
    (blocks,) = rows.blocks
    moving = balance.arm.is_moving[:: balance.arm.stride].any(axis=1)
    counts = np.bincount(blocks[moving], minlength=4)
    assert len(counts) == len(rows.recording) == 4
    assert np.ptp(counts) <= 1


def test_an_offset_of_one_recording():
    file, offset = arm_file(), bound('torque_sensor_bias', 'joint_3', bias=4.0)
    records = [RealArm(3).record(0), RealArm(3, [offset]).record(1)]
    (cause,) = diagnose(records, file.robot, file.effects).causes
    assert (cause.applied.id, cause.applied.where) == ('torque_sensor_bias', 'joint_3')
    assert cause.applied.recordings == (1,)
    assert abs(cause.parameters['bias'].value - 4.0) < 3.0 * cause.parameters['bias'].std < 4.0


@pytest.mark.parametrize(
    ('effect', 'name'),
    [
        (bound('joint_coulomb_friction', 'joint_4', torque=3.0), 'torque'),
        (bound('torque_sensor_bias', 'joint_4', bias=-2.5), 'bias'),
        (bound('effort_delay', delay=0.015), 'delay'),
        (bound('joint_stiffness', 'joint_1', stiffness=40.0, rest_angle=0.0), 'stiffness'),
    ],
    ids=lambda given: getattr(given, 'id', None),
)
def test_a_single_cause_is_the_first_name(effect, name):
    """A spring brings a bias: its rest angle is taken to be the joint's mean angle."""
    file = arm_file()
    found = diagnose(RealArm(5, [effect]).record(0), file.robot, file.effects)
    causes = causes_of(found)
    assert next(iter(causes)) == (effect.id, effect.where)
    assert {kind for kind, _ in causes} <= {effect.id, 'torque_sensor_bias'}
    value = causes[effect.id, effect.where][name]
    assert abs(value.value - effect[name]) < 3.0 * value.std


def test_a_gain_beyond_the_tolerance_of_a_torque_sensor():
    """Efforts of a sensor behind the gear are right within 3 %, a data sheet's within 8 %."""
    file = arm_file(effort_kind='link')
    assert file.robot.effort_kinds == ('link',) * 6
    gain = bound('joint_torque_constant', 'joint_2', gain=1.25)
    found = diagnose(RealArm(6, [gain]).record(0), file.robot, file.effects)
    assert ('joint_torque_constant', 'joint_2') in causes_of(found)


def test_the_extended_model_loads_round_after_round():
    """Each round starts from what the last one wrote."""
    file, arm = arm_file(has_friction=False), RealArm(7, [payload()])
    believed, left = (), []
    for turn in range(3):
        found = diagnose(arm.record(turn, duration=10.0), file.robot, believed)
        (own,) = found.recordings
        assert own.rms_after <= own.rms_before
        left.append(own.rms_before)
        more = named((*(c.applied for c in found.causes), *found.calibration), believed)
        believed = bind_effects(effects_section((*believed, *more)), file.robot)
    # the model of the first round explains the second recording
    assert left[1] < 0.3 * left[0]


def test_bodies_named_twice_compose():
    file = arm_file()
    twice = [replace(payload(), name='one'), replace(payload(), name='two')]
    heavier = replace(file, effects=(*file.effects, *twice)).believed
    gained = heavier.inertial_parameters[-1] - file.robot.inertial_parameters[-1]
    np.testing.assert_allclose(gained, 2.0 * np.array(list(PAYLOAD.values())), atol=1e-12)


def test_a_load_beside_another_body_of_its_link_is_a_body():
    """On half the efforts of two joints, which no body explains: together they are a robot."""
    file, arm = arm_file(), RealArm(4, [payload()])
    records = [RealArm(4).record(0, duration=12.0), arm.record(1, duration=12.0)]
    scale = np.array([1.0, 0.5, 0.5, 1.0, 1.0, 1.0])
    joints = [replace(r.joints, effort=scale * r.effort) for r in records]
    balances = [
        balance_of(replace(r, joints=j), file.robot, file.effects)
        for r, j in zip(records, joints, strict=True)
    ]
    rows = ArmRows.of(balances, list(CATALOGUE.values())).with_own([1])
    levels = leftover_levels(rows, rows.sizes, rows.friction)
    keys = [(c.kind.id, c.where) for c in rows.candidates]
    both = [i for i, key in enumerate(keys) if key == ('inertial_parameters', 'link_6')]
    assert len(both) == 2
    fit = FittedArm.of(rows, levels, both)
    link, load = fit.effects(both)
    alone = pin.PseudoInertia.FromDynamicParameters(np.array(list(load.values.values())))
    assert np.min(np.linalg.eigvalsh(alone.toMatrix())) > -1e-5
    changed_robot(file.robot, [*file.effects, link, load])  # refuses what is no body


def lone_joint(kind, axis):
    """A body of 3 kg on a joint, whose inertia about its axis is 0.05 kg m^2 where it turns."""
    inertia = '<inertia ixx="0.05" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/>'
    urdf = f"""<robot name="lone"><link name="floor"/>
      <link name="body"><inertial><mass value="3"/>{inertia}</inertial></link>
      <joint name="joint" type="{kind}"><parent link="floor"/><child link="body"/>
        <axis xyz="{axis}"/><limit lower="-6" upper="6" effort="100" velocity="5"/></joint>
      </robot>"""
    own = {'base': 'fixed', 'base_link': 'floor', 'joints': ['joint']}
    return build_robot(parse_settings({'robot': own | {'gravity': [0.0, 0.0, -9.81]}}), urdf)


def seen(rng, q, effort, std):
    """Angles or ways (N, 1) and efforts at 100 Hz, with noise of 1e-5 and `std`."""
    noise = np.array([[[1e-5]], [[std]]]) * rng.standard_normal((2, *q.shape))
    stamps = to_stamps(np.arange(len(q)) / 100.0)
    series = JointSeries(('joint',), stamps, q + noise[0], None, effort + noise[1])
    return Record(joints=series)


def test_a_joint_that_slides_has_forces(rng):
    """A carriage of 3 kg with a spring and dry friction that its file lacks."""
    time = np.arange(2400)[:, None] / 100.0
    terms = ((0.3, 1.3, 0.0), (0.2, 3.1, 1.0))
    q, qd, qdd = (
        sum(a * w**k * np.sin(w * time + phase + 0.5 * np.pi * k) for a, w, phase in terms)
        for k in range(3)
    )
    effort = 3.0 * qdd + 5.0 * np.sign(qd) + 40.0 * q
    found = diagnose(seen(rng, q, effort, 0.05), lone_joint('prismatic', '1 0 0'))
    said = {c.applied.id: {n: p.unit for n, p in c.parameters.items()} for c in found.causes}
    assert said['joint_coulomb_friction'] == {'torque': 'N'}
    assert said['joint_stiffness'] == {'stiffness': 'N/m', 'rest_angle': 'm'}
    assert [r.unit for r in found.residuals] == ['N']


def test_a_law_of_a_joint_that_slides_has_its_units(rng):
    time, w, a = np.arange(4001)[:, None] / 100.0, 2.0 * np.pi * np.array([0.1, 0.23, 0.37]), 0.1
    q, qd, qdd = (
        a * np.sum(x, axis=1, keepdims=True)
        for x in (np.sin(w * time), w * np.cos(w * time), -(w**2) * np.sin(w * time))
    )
    found = diagnose(
        seen(rng, q, 3.0 * qdd + 60.0 * qd**3, 0.05), lone_joint('prismatic', '1 0 0')
    )
    (entry,) = found.leftover
    assert entry.form == 'x**3'
    (coefficient,) = entry.coefficients
    assert abs(coefficient.value + 60.0) < 4.0 * coefficient.std
    assert coefficient.unit == 'N s^3/m^3'


def test_one_joint_in_the_noise_of_nobody_knows_what_sensors(rng):
    """A turntable whose friction is three times the torque that its inertia takes."""
    time = np.arange(1200)[:, None] / 100.0
    q, qd, qdd = (0.5 * 1.3**k * np.sin(1.3 * time + 0.5 * np.pi * k) for k in range(3))
    effort = (0.05 + 0.1) * qdd + 0.5 * np.sign(qd)
    found = diagnose(seen(rng, q, effort, 0.02), lone_joint('revolute', '0 0 1'))
    values = {key: next(iter(p.values())) for key, p in causes_of(found).items()}
    assert found.verdict == 'explained', found.sentence
    assert set(values) == {('joint_coulomb_friction', 'joint'), ('motor_inertia', 'joint')}
    for (_, estimated), truth in zip(sorted(values.items()), (0.5, 0.1), strict=True):
        assert abs(estimated.value - truth) < 4.0 * estimated.std
