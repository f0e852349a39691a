"""Friction, drives, flexible gears and play: laws in closed form, and runs against MuJoCo."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import savgol_filter
from support.attitudes import angle_between
from support.effects import Engine, motion_of, plant_with, run
from support.models import random_tree, robot_of, to_mjcf
from support.states import random_state

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effect
from spacerobot_ros.effects.joint import STICTION_RATE
from spacerobot_ros.effects.joints.flexibility import _slope
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps
from spacerobot_ros.sensing.sensor_faults import corrected_record

JOINT = 'j_link_2'
PERIODS = 150

# Values of every torque on a joint, and the torque by hand at angle q, rate v, motor torque t.
LAWS = {
    'joint_viscous_friction': ({'coefficient': 3.0}, lambda q, v, t: -3.0 * v),
    'joint_coulomb_friction': ({'torque': 0.7}, lambda q, v, t: -math.copysign(0.7, v)),
    'joint_asymmetric_friction': (
        {'forward': 0.7, 'backward': 0.4},
        lambda q, v, t: -0.7 if v > 0.0 else 0.4,
    ),
    'joint_stribeck_friction': (
        {'coulomb': 0.5, 'static': 0.9, 'velocity': 0.4},
        lambda q, v, t: -math.copysign(0.5 + 0.4 * math.exp(-((v / 0.4) ** 2)), v),
    ),
    'joint_friction_curvature': (
        {'torque': 0.6, 'rate': 5.0},  # faster than the states of the tests
        lambda q, v, t: (
            -math.copysign(0.6, v) * (math.sqrt(abs(v) / 5.0) - 4.0 / 15.0 - 0.16 * abs(v))
        ),
    ),
    'joint_load_friction': ({'coefficient': 0.1}, lambda q, v, t: -math.copysign(0.1 * t, v)),
    'joint_torque_constant': ({'gain': 0.93}, lambda q, v, t: -0.07 * t),
    'joint_torque_ripple': (
        {'amplitude': 0.4, 'harmonic': 24.0, 'phase': 0.3},
        lambda q, v, t: 0.4 * math.sin(24.0 * q + 0.3),
    ),
    'joint_stiffness': (
        {'stiffness': 5.0, 'rest_angle': 0.2},
        lambda q, v, t: -5.0 * (q - 0.2),
    ),
}
INSIDE = {
    **{effect: values for effect, (values, _) in LAWS.items()},
    'joint_presliding_friction': {'torque': 0.7, 'displacement': 0.02},
    'joint_coupled_friction': {'coulomb': 0.5, 'viscous': 0.3, 'ratio': -0.8},
    'motor_inertia': {'inertia': 2.0},
    'joint_flexibility': {'stiffness': 800.0, 'damping': 1.5, 'rotor_inertia': 0.5},
}


@pytest.fixture
def parts(rng):
    return random_tree(rng, [0, 1, 2, 1], prismatic=(3,))


@pytest.fixture
def robot(parts):
    return robot_of(parts)


@pytest.mark.parametrize('effect', LAWS)
def test_torque_is_the_law(effect, robot, rng):
    values, law = LAWS[effect]
    applied = bind_effect('x', effect, JOINT, values, robot)
    motion = motion_of(robot, rng, 50)
    column = robot.joints.index(JOINT)
    motion.qd += np.copysign(9.0 * STICTION_RATE, motion.qd)  # where sign(v) is right to 1e-7
    expected = np.zeros((50, 6 + robot.n_joints))
    state = zip(motion.q[:, column], motion.qd[:, column], motion.effort[:, column], strict=True)
    expected[:, 6 + column] = [law(*s) for s in state]
    np.testing.assert_allclose(
        applied.force(motion, np.zeros((50, 0))), expected, rtol=0, atol=1e-7
    )


@pytest.mark.parametrize('effect', INSIDE)
def test_inside_forces_keep_momentum_and_account_for_energy(effect, robot, rng):
    plant = plant_with(robot, random_state(rng, robot.n_joints), effect, JOINT, INSIDE[effect])
    before = plant.ledger()
    run(plant, 100)
    after = plant.ledger()
    assert after.momentum_drift <= 1e-12  # rounding of some thousand stages
    np.testing.assert_allclose(after.linear, before.linear, rtol=0, atol=1e-10)
    assert abs(after.energy_drift) <= 1e-9 * after.kinetic  # the step's own error is 1e-11


def _hinge(parts, **attributes):
    """MJCF with attributes added to the joint."""
    added = ' '.join(f'{name}="{value!r}"' for name, value in attributes.items())
    text = to_mjcf(parts, 1e-3)
    return re.sub(f'(<joint name="{JOINT}" [^>]*?)/>', rf'\1 {added}/>', text)


def _geared(parts, stiffness, damping, rotor):
    """MJCF with a motor hinge before the joint, which becomes the gear's spring."""
    text = _hinge(parts, stiffness=stiffness, damping=damping)
    spring = re.search(f'<joint name="{JOINT}" [^>]*>', text).group()
    axis = re.search('axis="[^"]*"', spring).group()
    motor = f'<joint name="motor" type="hinge" {axis} armature="{rotor!r}"/>'
    return text.replace(spring, motor + spring).replace(
        f'<motor joint="{JOINT}"/>', '<motor joint="motor"/>'
    )


def _compared(effect, values, text, parts, rng):
    """Plant and engine after the run, from one random state."""
    robot = robot_of(parts)
    state = random_state(rng, robot.n_joints)
    plant = plant_with(robot, state, effect, JOINT, values)
    ours = run(plant, PERIODS)
    driven = tuple('motor' if j == JOINT and 'name="motor"' in text else j for j in robot.joints)
    engine = Engine(text, driven)
    engine.place(state)
    engine.run(PERIODS)
    assert angle_between(ours.q_WB_xyzw, engine.attitude_xyzw) <= 1e-7  # RK4 at 1 ms
    return plant, ours, engine


@pytest.mark.parametrize(
    ('effect', 'values', 'attributes'),
    [
        ('joint_viscous_friction', {'coefficient': 3.0}, {'damping': 3.0}),
        (
            'joint_stiffness',
            {'stiffness': 20.0, 'rest_angle': 0.2},
            {'stiffness': 20.0, 'springref': 0.2},
        ),
        ('motor_inertia', {'inertia': 2.0}, {'armature': 2.0}),
    ],
)
def test_run_against_mujoco(effect, values, attributes, parts, rng):
    pytest.importorskip('mujoco')
    text = _hinge(parts, **attributes)
    _, ours, engine = _compared(effect, values, text, parts, rng)
    theirs = [engine.angle(joint) for joint in engine.joints]
    np.testing.assert_allclose(ours.q, theirs, rtol=0, atol=1e-7)  # RK4 at 1 ms


def test_torque_gain_is_a_stronger_motor(parts, rng):
    pytest.importorskip('mujoco')
    text = to_mjcf(parts, 1e-3).replace(
        f'<motor joint="{JOINT}"/>', f'<motor joint="{JOINT}" gear="1.1"/>'
    )
    _, ours, engine = _compared('joint_torque_constant', {'gain': 1.1}, text, parts, rng)
    theirs = [engine.angle(joint) for joint in engine.joints]
    np.testing.assert_allclose(ours.q, theirs, rtol=0, atol=1e-7)  # RK4 at 1 ms


def test_flexible_joint_against_mujoco(parts, rng):
    pytest.importorskip('mujoco')
    values = {'stiffness': 300.0, 'damping': 1.0, 'rotor_inertia': 0.5}
    text = _geared(parts, *values.values())
    plant, ours, engine = _compared('joint_flexibility', values, text, parts, rng)
    column = plant.robot.joints.index(JOINT)
    link = engine.angle('motor') + engine.angle(JOINT)
    assert abs(ours.q[column] - link) <= 1e-6
    assert abs(engine.angle(JOINT)) > 1e-3  # the gear is wound up
    assert abs(plant.hidden[0] + engine.angle(JOINT)) <= 1e-6  # theta - q


def test_encoder_is_on_the_motor_or_on_the_link(robot, rng):
    motion, hidden = motion_of(robot, rng, 4), rng.standard_normal((4, 2))
    column = robot.joints.index(JOINT)
    for side in (1.0, 0.0):
        applied = bind_effect(
            'x',
            'joint_flexibility',
            JOINT,
            {'stiffness': 1e4, 'rotor_inertia': 1.0, 'motor_side': side},
            robot,
        )
        for channel, value, k in (
            ('joint_position', motion.q, 0),
            ('joint_velocity', motion.qd, 1),
        ):
            seen = applied.sense(channel, value, motion, hidden) - value
            np.testing.assert_allclose(seen[:, column], side * hidden[:, k], rtol=0, atol=1e-15)
            assert not np.delete(seen, column, axis=1).any()
        effort = applied.sense('joint_effort', motion.effort, motion, hidden)
        assert np.array_equal(effort, motion.effort)


def test_wind_up_of_a_stiff_gear_is_torque_over_stiffness(robot):
    time = np.linspace(0.0, 2.0, 401)
    n, column = robot.n_joints, robot.joints.index(JOINT)
    values = {'stiffness': 1e5, 'damping': 300.0, 'rotor_inertia': 2.0}
    applied = bind_effect('x', 'joint_flexibility', JOINT, values, robot)
    wave = np.sin(2.0 * time)
    motion = motion_of(robot, np.random.default_rng(1), 401)
    motion.time = time
    motion.effort = np.outer(7.0 * wave, np.ones(n))
    motion.acceleration = np.zeros((401, 6 + n))
    motion.acceleration[:, 6 + column] = -1.5 * wave
    hidden = applied.driven(motion)
    # k delta + d delta' = tau - J q'' = 10 sin(2 t), whose answer lags by d / k
    inside = slice(20, -20)
    expected = 1e-4 * np.sin(2.0 * (time - 3e-3))
    np.testing.assert_allclose(hidden[inside, 0], expected[inside], rtol=0, atol=1e-8)
    slope = 2e-4 * np.cos(2.0 * (time - 3e-3))
    np.testing.assert_allclose(hidden[inside, 1], slope[inside], rtol=0, atol=1e-8)


@pytest.mark.parametrize('count', [11, 12, 40])
def test_a_slope_is_that_of_savitzky_and_golay(rng, count):
    time, values = 0.01 * np.cumsum(rng.uniform(0.9, 1.1, count)), rng.normal(size=count)
    rise, run = (savgol_filter(x, 11, 3, deriv=1) for x in (values, time))
    assert_allclose(_slope(values, time), rise / run, rtol=1e-11, atol=1e-9)


def test_an_encoder_on_the_motor_is_undone_in_a_record(robot):
    """By the closed form of a wind-up without damping, (tau - J q'') / k, up to both ends."""
    time, w, k, inertia = np.arange(401) / 100.0, 8.0, 6e4, 0.25
    q, qd, qdd = np.sin(w * time), w * np.cos(w * time), -w * w * np.sin(w * time)
    torque, torque_rate = 50.0 * np.cos(3.0 * time), -150.0 * np.sin(3.0 * time)
    wound = (torque - inertia * qdd) / k
    rate = (torque_rate + inertia * w * w * qd) / k
    column = robot.joints.index(JOINT)
    values = [np.zeros((len(time), robot.n_joints)) for _ in range(3)]
    for array, own in zip(values, (q + wound, qd + rate, torque), strict=True):
        array[:, column] = own
    record = Record(JointSeries(tuple(robot.joints), to_stamps(time), *values))
    gear = {'stiffness': k, 'rotor_inertia': inertia, 'motor_side': 1.0}
    bound = bind_effect('gear', 'joint_flexibility', JOINT, gear, robot)
    right = corrected_record(record, robot, [bound])
    assert np.ptp(wound) > 2e-3
    np.testing.assert_allclose(right.q[:, column], q, rtol=0, atol=2e-6)
    missed = np.abs(right.qd[:, column] - qd)
    assert np.max(np.abs(rate)) > 4e-3
    assert np.max(missed[5:-5]) < 2e-5  # where cubics have samples on both sides
    assert np.max(missed) < 2e-4


def test_infinitely_stiff_gear_is_a_motor_inertia(robot, rng):
    n = robot.n_joints
    motion = motion_of(robot, rng, 5, acceleration=rng.standard_normal((5, 6 + n)))
    kind = CATALOGUE['joint_flexibility']
    effect = kind(name='gear', where=JOINT, values={**kind.nominal(), 'rotor_inertia': 2.0})
    hidden = effect.driven(motion)
    force = effect.force(motion, hidden)
    column = 6 + robot.joints.index(JOINT)
    np.testing.assert_allclose(
        force[:, column], -2.0 * motion.acceleration[:, column], rtol=1e-14, atol=0
    )
    assert not hidden.any()


def test_motor_inertia_is_on_the_diagonal(robot, rng):
    changed = robot.with_motor_inertia(JOINT, 2.0)
    q = rng.standard_normal(robot.n_joints)
    added = Dynamics(changed).mass_matrix(q) - Dynamics(robot).mass_matrix(q)
    expected = np.zeros_like(added)
    column = 6 + robot.joints.index(JOINT)
    expected[column, column] = 2.0
    np.testing.assert_allclose(added, expected, rtol=0, atol=1e-12)  # of entries of 1e2
    assert not robot.bodies[2].motor_inertia


def test_motor_inertia_turns_forward_and_inverse_dynamics_alike(robot, rng):
    dynamics = Dynamics(robot.with_motor_inertia(JOINT, 2.0).with_motor_inertia('j_link_3', 5.0))
    n = robot.n_joints
    state, tau = random_state(rng, n), rng.standard_normal(n)
    rate = dynamics.rate(state.to_vector(), tau)
    base, joints = dynamics.inverse(state, rate[7 + n : 13 + n], rate[13 + n :])
    np.testing.assert_allclose(base, np.zeros(6), rtol=0, atol=1e-11)
    np.testing.assert_allclose(joints, tau, rtol=0, atol=1e-11)


def test_play_is_crossed_where_the_torque_changes_sign(robot, rng):
    motion = motion_of(robot, rng, 3)
    column = robot.joints.index(JOINT)
    motion.effort[:, column] = [4.0, -4.0, 0.0]
    applied = bind_effect('x', 'joint_backlash', JOINT, {'gap': 2e-3}, robot)
    play = (applied.sense('joint_position', motion.q, motion) - motion.q)[:, column]
    np.testing.assert_allclose(play, [1e-3, -1e-3, 0.0], rtol=0, atol=1e-15)
    assert np.array_equal(applied.sense('gyro', motion.omega, motion), motion.omega)


@pytest.mark.parametrize(
    ('effect', 'where', 'values', 'message'),
    [
        ('joint_viscous_friction', JOINT, {'coefficient': -1.0}, 'must be at least 0'),
        ('joint_viscous_friction', 'elbow', {'coefficient': 1.0}, "no place 'elbow'"),
        ('joint_viscous_friction', None, {'coefficient': 1.0}, 'is missing: .* acts at one of'),
        ('joint_viscous_friction', JOINT, {}, r'coefficient: is missing: .*\[N m s/rad\]'),
        (
            'joint_viscous_friction',
            JOINT,
            {'coefficient': '3 Nms'},
            "expected a number, got '3 Nms'",
        ),
        ('joint_coulomb_friction', JOINT, {'force': 1.0}, 'no such parameter'),
        (
            'joint_stribeck_friction',
            JOINT,
            {'coulomb': 2.0, 'static': 1.0, 'velocity': 0.1},
            'static: 1 N m is less than the Coulomb torque of 2 N m',
        ),
        (
            'joint_stribeck_friction',
            JOINT,
            {'coulomb': 1.0, 'static': 2.0, 'velocity': 0.0},
            'velocity: 0 rad/s must be above 0.002',
        ),
        ('joint_torque_constant', JOINT, {'gain': -1.0}, 'gain: -1 must be at least 0'),
        ('joint_torque_ripple', JOINT, {'amplitude': 1.0, 'harmonic': 0.0}, 'must be above 0'),
        (
            'joint_flexibility',
            JOINT,
            {'stiffness': 0.0, 'rotor_inertia': 1.0},
            'stiffness: 0 N m/rad must be above 0',
        ),
        (
            'joint_flexibility',
            JOINT,
            {'stiffness': 1e4, 'rotor_inertia': 0.0},
            'rotor_inertia: 0 kg m.2 must be above 0',
        ),
        ('joint_backlash', JOINT, {'gap': math.nan}, 'is not a finite number'),
        ('motor_inertia', JOINT, {'inertia': -0.1}, 'must be at least 0'),
        ('joint_frction', JOINT, {}, 'did you mean'),
    ],
)
def test_nonsense_is_refused(effect, where, values, message, robot):
    with pytest.raises(ConfigurationError, match=message):
        bind_effect('elbow', effect, where, values, robot)


def test_too_stiff_a_gear_names_the_step_it_needs(robot, rng):
    values = {'stiffness': 1e9, 'rotor_inertia': 0.01}
    with pytest.raises(ConfigurationError, match='needs integration steps of'):
        plant_with(robot, random_state(rng, robot.n_joints), 'joint_flexibility', JOINT, values)
