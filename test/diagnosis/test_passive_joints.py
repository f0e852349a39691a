"""Joints without a motor, currents and small machines: what is found is what was simulated.

The pendulums are equations of their own, integrated by scipy; the cart with a pole is MuJoCo's.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from spacerobot_ros.diagnosis.answer.extended_model import effects_section
from spacerobot_ros.diagnosis.comparison.compare import changes_between
from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.score_on import score_on
from spacerobot_ros.effects.catalogue import bind_effects
from spacerobot_ros.errors import ConfigurationError, RecordingError
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.robot_settings import SensorSettings
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.recording.read import read_record
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps

EXAMPLES = Path(__file__).resolve().parents[2] / 'config' / 'examples'
WIDTH = 5e-3  # rad/s, over which dry friction changes its sign
# of the reaction-wheel pendulum: kg m^2, N m/rad, N m, N m/A, A
J, WEIGHT, WHEEL, DRY, CONSTANT, ZERO, DRY_WHEEL = 0.27, 2.75, 0.0027, 0.03, 0.25, 0.06, 0.012
FILE_WEIGHT, FILE_J = 0.30 * 9.81, 0.2845  # of the example's file
PENDULUM = (EXAMPLES / 'reaction_pendulum.urdf').read_text()
NOISE = np.array([3e-4, 0.02])  # rad, rad/s


def robot_from(urdf, joints, **entries):
    own = {'base': 'fixed', 'gravity': [0.0, 0.0, -9.81], 'joints': list(joints)}
    return build_robot(parse_settings({'robot': own | entries}), urdf)


def wheel_robot(**entries):
    """The example's robot: no motor at the pivot, a current at the wheel."""
    entries = {'passive_joints': ['pivot'], 'effort_kind': 'current'} | entries
    return robot_from(PENDULUM, ('pivot', 'wheel'), **entries)


def current(t):
    """Of the motor [A]."""
    return 0.35 * np.sin(3.1 * t) + 0.25 * np.sin(5.3 * t + 1.0) + 0.15 * np.sin(1.1 * t)


def wheel_run(seconds, seed, start=0.3):
    """Pivot's angle, wheel's rate and current of the reaction-wheel pendulum at 50 Hz."""

    def rate(t, x):
        q, qd, spin = x
        drive = CONSTANT * current(t) - DRY_WHEEL * np.tanh(spin / WIDTH)
        # J q'' + W s' + w sin q + C = 0 and W (q'' + s') = drive
        bend = (-drive - WEIGHT * np.sin(q) - DRY * np.tanh(qd / WIDTH)) / (J - WHEEL)
        return [qd, bend, drive / WHEEL - bend]

    times = np.arange(0.0, seconds, 0.02)
    run = solve_ivp(rate, (0.0, seconds), [start, 0.0, 0.0], 'LSODA', times, rtol=1e-8, atol=1e-9)
    rng = np.random.default_rng(seed)
    seen = run.y[[0, 2]].T + NOISE * rng.standard_normal((len(times), 2))
    missing = np.full(len(times), np.nan)
    joints = JointSeries(
        ('pivot', 'wheel'),
        to_stamps(times),
        np.column_stack([seen[:, 0], missing]),
        np.column_stack([missing, seen[:, 1]]),
        np.column_stack([missing, current(times) + ZERO]),
        unpowered=np.tile([True, False], (len(times), 1)),
        in_amperes=('wheel',),
    )
    return Record(joints=replace(joints, velocity=None))


@pytest.fixture(scope='module')
def swung():
    return wheel_run(14.0, 1)


@pytest.fixture(scope='module')
def found(swung):
    """Nothing anchors the scale."""
    return diagnose(swung, wheel_robot())


def ratio(found, joint, name, of=None):
    (one,) = (r for r in found.ratios if (r.joint, r.ratio, r.of) == (joint, name, of))
    return one


def test_ratios_of_a_pendulum_whose_torques_nobody_measured(found):
    """Each within 3 standard deviations and a few per cent: friction changes its sign in 20 ms."""
    assert found.free_motion[0].joint == 'pivot'
    for joint, name, of, truth, share in (
        ('pivot', 'weight_by_inertia', None, WEIGHT / J, 0.01),
        ('pivot', 'inertia_by_inertia', 'wheel', WHEEL / J, 0.03),
        ('pivot', 'coulomb_by_inertia', None, DRY / J, 0.08),
        ('wheel', 'motor_constant_by_inertia', None, CONSTANT / WHEEL, 0.03),
        ('wheel', 'coulomb_by_motor_constant', None, DRY_WHEEL / CONSTANT, 0.08),
    ):
        one = ratio(found, joint, name, of)
        assert one.value == pytest.approx(truth, rel=share), (joint, name)
        assert abs(one.value - truth) < 3.0 * one.std, (joint, name)
    (zero,) = (c for c in found.causes if c.applied.id == 'current_offset')
    assert zero.parameters['offset'].value == pytest.approx(ZERO, abs=3e-3)
    (missing,) = (note for note in found.notes if 'anchors' in note)
    assert 'robot.motor_constant, or robot.scale.anchor' in missing


def test_two_seconds_of_another_run(found):
    """Predicted within little more than its noise of 0.3 mrad; the file's model is off by 10."""
    effects = [*(c.applied for c in found.causes), *found.calibration]
    pivot, wheel = score_on(wheel_run(10.0, 2, start=-0.4), wheel_robot(), effects)
    assert pivot.free is not None
    assert wheel.free is None
    assert pivot.free.windows == 4
    assert pivot.free.rms_after < 5e-4 < 0.1 * pivot.free.rms_before


def test_the_extended_model_makes_torques_of_currents(found, swung):
    """What is written loads; currents are then known torques and little is left."""
    effects = [*(c.applied for c in found.causes), *found.calibration]
    robot = wheel_robot()
    again = bind_effects(effects_section(effects), robot)
    scores = score_on(swung, robot, (), again)
    for score, residual in zip(scores, found.residuals, strict=True):
        assert score.after == pytest.approx(residual.rms_after, rel=1e-6)


@pytest.mark.parametrize(
    ('anchor', 'scale'), [('gravity', FILE_WEIGHT / WEIGHT), ('inertia', FILE_J / J)]
)
def test_one_anchor_of_the_file_gives_the_scale(swung, anchor, scale):
    anchored = diagnose(swung, wheel_robot(scale={'anchor': anchor}))
    assert not any('anchors' in note for note in anchored.notes)
    (constant,) = (c for c in anchored.causes if c.applied.id == 'motor_constant')
    value = constant.parameters['constant']
    assert value.value == pytest.approx(scale * CONSTANT, rel=0.03)
    (friction,) = (law for law in anchored.friction if law.joint == 'pivot')
    assert friction.coulomb == pytest.approx(scale * DRY, rel=0.1)


def test_what_can_not_be_is_one_line(swung):
    with pytest.raises(ConfigurationError, match='anchor: gravity has no torque at pivot'):
        diagnose(swung, wheel_robot(gravity=[0.0] * 3, scale={'anchor': 'gravity'}))
    with pytest.raises(ConfigurationError, match=r"passive_joints\[0\]: 'knee' is none of"):
        wheel_robot(passive_joints=['knee'])
    backwards = replace(swung.joints, effort=swung.joints.effort * -1.0)
    with pytest.raises(RecordingError, match='currents of wheel: do not go with the torque'):
        diagnose(replace(swung, joints=backwards), wheel_robot())
    driven = replace(swung.joints, unpowered=None, effort=np.cos(swung.q))
    with pytest.raises(RecordingError, match='pivot: without a motor here or in the first'):
        diagnose([swung, replace(swung, joints=driven)], wheel_robot())


# ------------------------------------------------------------ small machines, units of a file

ROD = """<robot name="rod"><link name="base_link"/><link name="rod"><inertial>
<origin xyz="0 0 -0.1"/><mass value="{mass!r}"/>
<inertia ixx="{own!r}" ixy="0" ixz="0" iyy="{own!r}" iyz="0" izz="{own!r}"/></inertial></link>
<joint name="servo" type="continuous"><parent link="base_link"/><child link="rod"/>
<axis xyz="0 1 0"/></joint></robot>"""
MASS, LENGTH, OWN = 0.49, 0.1, 8e-5
INERTIA = MASS * LENGTH**2 + OWN


def rod_robot(scale=1.0):
    return robot_from(ROD.format(mass=scale * MASS, own=scale * OWN), ('servo',))


def rod_run(off_from=np.inf, gain=1.0, offset=0.0):
    """A servo's angle and the torque that is said of it, N m; off it swings freely."""

    def torque(t):
        drive = 0.35 * np.sin(2.3 * t) + 0.2 * np.sin(5.1 * t)
        return np.where(t < off_from, drive, 0.0)

    def rate(t, x):
        friction = 0.0128 * np.tanh(x[1] / WIDTH) + 0.0037 * x[1]
        drive = torque(t) - MASS * 9.81 * LENGTH * np.sin(x[0]) - friction
        return [x[1], drive / INERTIA]

    times = np.arange(0.0, 12.0, 0.01)
    run = solve_ivp(
        rate, (0.0, 12.0), [0.0, 0.0], 'LSODA', times, rtol=1e-8, atol=1e-9, max_step=0.01
    )
    noise = 3e-4 * np.random.default_rng(3).standard_normal(len(times))
    return times, run.y[0] + noise + offset, torque(times) / gain


def rod_record(times, angle, effort, off=None):
    series = JointSeries(
        ('servo',),
        to_stamps(times),
        angle[:, None],
        None,
        effort[:, None],
        unpowered=None if off is None else off[:, None],
    )
    return Record(joints=series)


def values_of(found):
    return {
        (c.applied.id, c.applied.where, name): (p.value, p.unit)
        for c in (*found.causes, *found.minor)
        for name, p in c.parameters.items()
    }


@pytest.fixture(scope='module')
def driven():
    """A servo's run and what is found of it."""
    run = rod_run()
    return run, diagnose(rod_record(*run), rod_robot())


@pytest.mark.parametrize('scale', [1e-9, 1e3])
def test_a_small_machine_is_a_large_one(driven, scale):
    """Of masses and torques that are c times as large everything found is, to rounding."""
    (times, angle, effort), large = driven
    small = diagnose(rod_record(times, angle, scale * effort), rod_robot(scale))
    assert small.verdict == large.verdict
    expected = values_of(large)
    assert ('joint_coulomb_friction', 'servo', 'torque') in expected
    assert list(values_of(small)) == list(expected)
    for key, (value, unit) in values_of(small).items():
        factor = scale if unit.startswith(('N m', 'kg')) else 1.0
        assert value == pytest.approx(factor * expected[key][0], rel=1e-6, abs=1e-12 * factor), key


def test_units_of_the_file_do_not_matter(driven, tmp_path):
    """Millinewton metres of a table, and degrees: every value the same within 1e-6."""
    (times, angle, effort), plain = driven
    table = np.column_stack([1e3 * times, np.rad2deg(angle), 1e3 * effort])
    np.savetxt(tmp_path / 'run.csv', table, '%.17g', ',', header='t,q,m', comments='')
    (tmp_path / 'map.yaml').write_text(
        'time: {columns: t, unit: ms}\njoints:\n  names: [servo]\n'
        '  position: {columns: q, unit: deg}\n  effort: {columns: m, unit: mN m}\n'
    )
    record = read_record(tmp_path / 'run.csv', rod_robot(), tmp_path / 'map.yaml')
    expected = values_of(plain)
    for key, (value, _) in values_of(diagnose(record, rod_robot())).items():
        assert value == pytest.approx(expected[key][0], rel=1e-6), key


def test_a_motor_that_goes_off_tells_the_zero_of_its_encoder():
    """What is said while it is on is wrong by 5 %; off the torque is zero and weighs in full.

    Of 0.02 N m and a milliradian of noise. Without, a gain of g is a body and friction of a share
    1 / g of the file's, which miss the same torques, on and off.
    """
    times, angle, effort = rod_run(off_from=6.0, gain=1.05, offset=0.03)
    rng = np.random.default_rng(1)
    angle += 1e-3 * rng.standard_normal(len(angle))
    effort += 0.02 * rng.standard_normal(len(effort))
    found = diagnose(rod_record(times, angle, effort, times >= 6.0), rod_robot())
    named = {key: value for key, (value, _) in values_of(found).items()}
    assert named['encoder_offset', 'servo', 'offset'] == pytest.approx(0.03, abs=5e-3)
    assert 'inertial_parameters' not in {c.applied.id for c in found.causes}
    free = found.free_motion[0]
    assert (free.joint, free.windows) == ('servo', 2)
    assert free.rms_after < 0.5 * free.rms_before


# ------------------------------------------------------------ a joint that slides

CART = """<robot name="cart"><link name="base_link"/>
<link name="cart"><inertial><mass value="2.0"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
<link name="pole"><inertial><origin xyz="0 0 -0.3"/><mass value="0.4"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.002"/></inertial></link>
<joint name="rail" type="prismatic"><parent link="base_link"/><child link="cart"/>
<axis xyz="1 0 0"/><limit lower="-5" upper="5" effort="100" velocity="10"/></joint>
<joint name="pole" type="continuous"><parent link="cart"/><child link="pole"/>
<axis xyz="0 1 0"/></joint></robot>"""
MJCF = """<mujoco><option timestep="0.001" integrator="RK4"/><worldbody><body>
<inertial pos="0 0 0" mass="2" diaginertia="0.01 0.01 0.01"/>
<joint name="rail" type="slide" axis="1 0 0" damping="3.0"/>
<body><inertial pos="0 0 -0.3" mass="0.4" diaginertia="0.01 0.01 0.002"/>
<joint name="pole" type="hinge" axis="0 1 0" damping="0.02"/></body></body></worldbody>
<actuator><motor joint="rail"/></actuator></mujoco>"""


def test_a_pole_on_a_driven_cart():
    """MuJoCo's: damping of the joint that slides, 3 N s/m, and of the one without a motor."""
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)
    q, force = [], []
    for k in range(10000):
        t = 1e-3 * k
        data.ctrl[0] = 9.0 * np.sin(2.2 * t) + 6.0 * np.sin(4.7 * t + 0.5)
        if k % 10 == 0:
            q.append(data.qpos.copy())
            force.append(data.ctrl[0])
        mujoco.mj_step(model, data)
    q = np.array(q) + 1e-4 * np.random.default_rng(5).standard_normal((len(q), 2))
    efforts = np.column_stack([force, np.zeros(len(force))])
    off = np.tile([False, True], (len(q), 1))
    stamps = to_stamps(0.01 * np.arange(len(q)))
    record = Record(joints=JointSeries(('rail', 'pole'), stamps, q, None, efforts, unpowered=off))
    found = diagnose(record, robot_from(CART, ('rail', 'pole')))
    named = {c.applied.where: c for c in found.causes}
    assert {c.applied.id for c in found.causes} == {'joint_viscous_friction'}
    for joint, truth in (('rail', 3.0), ('pole', 0.02)):
        damping = named[joint].parameters['coefficient']
        assert damping.value == pytest.approx(truth, rel=0.01)
    assert not found.ratios  # the rail's force is measured


def test_what_changed_where_no_torque_is_measured(swung):
    """Of its own other run nothing, although a factor of everything would fit both."""
    changes = changes_between([swung], [wheel_run(12.0, 7, start=0.2)], wheel_robot())
    assert changes.named == []


# ------------------------------------------------------------ a shoulder without a motor

LINK = """<link name="{name}"><inertial><origin xyz="0 0 {com}"/><mass value="{mass}"/>
<inertia ixx="{own}" ixy="0" ixz="0" iyy="{own}" iyz="0" izz="0.001"/></inertial></link>"""
HINGE = """<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="0 0 {at}"/><axis xyz="0 1 0"/></joint>"""
ACROBOT = f"""<robot name="acrobot"><link name="base_link"/>
{LINK.format(name='upper', com=-0.2, mass=0.6, own=0.01)}
{LINK.format(name='lower', com=-0.15, mass=0.5, own=0.006)}
{HINGE.format(name='shoulder', parent='base_link', child='upper', at=0)}
{HINGE.format(name='elbow', parent='upper', child='lower', at=-0.4)}</robot>"""
ACROBOT_MJCF = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody><body>
<inertial pos="0 0 -0.2" mass="0.6" diaginertia="0.01 0.01 0.001"/>
<joint name="shoulder" type="hinge" axis="0 1 0" frictionloss="{dry}"/>
<body pos="0 0 -0.4"><inertial pos="0 0 -0.15" mass="{mass}" diaginertia="0.006 0.006 0.001"/>
<joint name="elbow" type="hinge" axis="0 1 0"/></body></body></worldbody>
<actuator><motor joint="elbow"/></actuator></mujoco>"""


def acrobot_run(dry, mass):
    """Torque at the elbow alone, 10 s at 200 Hz."""
    model = mujoco.MjModel.from_xml_string(ACROBOT_MJCF.format(dry=dry, mass=mass))
    data = mujoco.MjData(model)
    data.qpos[:] = [0.3, -0.2]
    q, torque = [], []
    for k in range(10000):
        t = 1e-3 * k
        data.ctrl[0] = 0.25 * np.sin(1.7 * t) + 0.15 * np.sin(2.9 * t + 0.4)
        if k % 5 == 0:
            q.append(data.qpos.copy())
            torque.append(data.ctrl[0])
        mujoco.mj_step(model, data)
    q = np.array(q) + 2e-4 * np.random.default_rng(1).standard_normal((len(q), 2))
    efforts = np.column_stack([np.zeros(len(q)), torque])
    off = np.tile([True, False], (len(q), 1))
    stamps = to_stamps(0.005 * np.arange(len(q)))
    return Record(
        joints=JointSeries(('shoulder', 'elbow'), stamps, q, None, efforts, unpowered=off)
    )


def test_friction_of_a_shoulder_without_a_motor():
    """A model without any mass would miss nothing there, and is no explanation."""
    found = diagnose(acrobot_run(0.03, 0.5), robot_from(ACROBOT, ('shoulder', 'elbow')))
    (cause,) = found.causes
    assert (cause.applied.id, cause.applied.where) == ('joint_coulomb_friction', 'shoulder')
    assert cause.parameters['torque'].value == pytest.approx(0.03, rel=0.05)
    assert found.free_motion[0].rms_after < 0.1 * found.free_motion[0].rms_before


def test_a_load_on_the_link_behind():
    """0.3 kg more at the lower link's centre of mass: its weight and inertia, and nothing else."""
    found = diagnose(acrobot_run(0.0, 0.8), robot_from(ACROBOT, ('shoulder', 'elbow')))
    (cause,) = found.causes
    assert (cause.applied.id, cause.applied.where) == ('inertial_parameters', 'lower')
    for name, truth in (('mass', 0.3), ('mz', -0.045), ('iyy', 0.00675)):
        value = cause.parameters[name]
        assert abs(value.value - truth) < 2.0 * value.std, name
    assert cause.parameters['mz'].value == pytest.approx(-0.045, rel=0.05)


def test_a_small_machine_of_stated_noise(driven):
    """Predicted, not balanced: likewise c times as much, and no factorization fails."""
    (times, angle, effort), _ = driven
    noisy = effort + 1e-3 * np.random.default_rng(0).standard_normal(len(effort))
    found = []
    for scale in (1.0, 2.0**-30):
        noise = {'joint_effort_std': scale * 1e-3, 'joint_position_std': 3e-4}
        robot = replace(rod_robot(scale), sensors=SensorSettings(**noise))
        found.append(diagnose(rod_record(times, angle, scale * noisy), robot))
    large, small = found
    assert large.fit_p is not None
    assert (small.verdict, small.fit_p) == (large.verdict, pytest.approx(large.fit_p, rel=1e-6))
    assert values_of(large)
    for key, (value, _) in values_of(small).items():
        assert value == pytest.approx(2.0**-30 * values_of(large)[key][0], rel=1e-6), key


SWING = """<robot name="swing"><link name="base_link"/><link name="rod"><inertial>
<origin xyz="0 0 {low!r}"/><mass value="0.15"/><inertia ixx="4e-4" iyy="4e-4" izz="1e-5" ixy="0"
ixz="0" iyz="0"/></inertial></link><joint name="pivot" type="continuous"><axis xyz="0 1 0"/>
<parent link="base_link"/><child link="rod"/></joint></robot>"""
SWUNG, WEIGHED, VISCOUS = 0.15 * 0.15**2 + 4e-4, 0.15 * 0.15 * 9.81, 1.2e-4


def swing_of_file(low, anchor):
    """What is found of a free swing of 0.15 kg at 0.15 m by a file with its mass elsewhere."""
    robot = robot_from(
        SWING.format(low=low), ('pivot',), passive_joints=['pivot'], scale={'anchor': anchor}
    )

    def rate(t, x):
        return [x[1], -(WEIGHED * np.sin(x[0]) + VISCOUS * x[1]) / SWUNG]

    times = np.arange(0.0, 24.0, 0.005)
    run = solve_ivp(rate, (0.0, 24.0), [1.2, 0.0], 'DOP853', times, rtol=1e-10, atol=1e-12)
    q = run.y[0] + 1e-4 * np.random.default_rng(5).standard_normal(len(times))
    joints = JointSeries(
        ('pivot',), to_stamps(times), q[:, None], unpowered=np.ones((len(times), 1), dtype=bool)
    )
    return diagnose(Record(joints=joints), robot)


def test_friction_of_a_free_swing_has_a_name_however_little_of_the_weight_it_is():
    """0.3 % of the weight's torque, and nearly all that the file misses: swings fade in 60 s."""
    found = swing_of_file(-0.15, 'gravity')
    (cause,) = found.causes
    assert (cause.applied.id, cause.applied.where) == ('joint_viscous_friction', 'pivot')
    assert cause.parameters['coefficient'].value == pytest.approx(VISCOUS, rel=0.05)
    assert math.isnan(ratio(found, 'pivot', 'weight_by_inertia').std)  # it is the file's


@pytest.mark.parametrize('anchor', ['none', 'gravity', 'inertia'])
def test_a_free_swing_tells_its_frequency_whatever_the_file_says(anchor):
    """A body is what no spring follows over 1.2 rad; the scale is that of what is anchored."""
    found = swing_of_file(-0.24, anchor)
    named = [c.applied.id for c in (*found.causes, *found.minor)]  # friction is 1 % of the misfit
    assert named == ['inertial_parameters', 'joint_viscous_friction']
    assert not found.events.named
    one = ratio(found, 'pivot', 'weight_by_inertia')
    assert one.value == pytest.approx(WEIGHED / SWUNG, rel=2e-3)
    assert abs(one.value - WEIGHED / SWUNG) < 4.0 * one.std
    rubs = ratio(found, 'pivot', 'viscous_by_inertia')
    assert rubs.value == pytest.approx(VISCOUS / SWUNG, rel=0.1)
