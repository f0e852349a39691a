"""Friction that holds a joint at rest, and friction that two joints share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.effects import PERIOD, Engine, motion_of, plant_with
from support.models import random_tree, robot_of, to_mjcf
from support.states import random_state

from spacerobot_ros.dynamics.integrate import TABLEAUS
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.catalogue import bind_effect
from spacerobot_ros.effects.joint import STICTION_RATE
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.simulation.plant import Plant

JOINT, CARRIER = 'j_link_2', 'j_link_1'
TORQUE, DISPLACEMENT = 0.8, 2e-3  # N m, rad
OIL = 100.0  # N m s/rad: damps the arm on its contacts


@pytest.fixture
def parts(rng):
    return random_tree(rng, [0, 1, 2, 1], prismatic=(3,))


@pytest.fixture
def robot(parts):
    return robot_of(parts)


@pytest.fixture
def single(rng):
    """An arm of one joint on the ground, without weight."""
    return random_tree(rng, [0])


def at_rest(robot):
    none, n = np.zeros(3), robot.n_joints
    return State(none, np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(n), none, none, np.zeros(n))


def dahl(robot, where=JOINT, **values):
    values = {'torque': TORQUE, 'displacement': DISPLACEMENT, **values}
    return bind_effect('x', 'joint_presliding_friction', where, values, robot)


def forced_motion(robot, angle, time, joint=JOINT):
    """One joint moved along given angles."""
    column = robot.joints.index(joint)
    motion = motion_of(robot, np.random.default_rng(0), len(time))
    motion.time = time
    motion.q[:], motion.qd[:] = 0.0, 0.0
    motion.q[:, column] = angle
    motion.qd[:, column] = np.gradient(angle, time, edge_order=2)
    return motion


# ------------------------------------------------------------------ pre-sliding


def test_hysteresis_loop_in_closed_form(robot):
    """Between turns at +-5 d: a straight line over 1.7 d, then an exponential of length 0.3 d."""
    turn = 5.0 * DISPLACEMENT
    time = np.linspace(0.0, 20.0, 8001)
    angle = turn * np.sin(time)
    motion = forced_motion(robot, angle, time)
    applied = dahl(robot)
    found = -applied.force(motion, applied.driven(motion))[:, 6 + robot.joints.index(JOINT)]
    way = np.sign(np.gradient(angle, time))
    unloaded = (way * angle + turn) / DISPLACEMENT  # way since the turn
    loop = np.where(unloaded <= 1.7, unloaded - 1.0, 1.0 - 0.3 * np.exp((1.7 - unloaded) / 0.3))
    later = time > 0.5 * np.pi
    # a turn between two samples: (5 sin'' dt^2) / 8, and exp(-8 / 0.3)
    np.testing.assert_allclose(found[later], TORQUE * (way * loop)[later], rtol=0, atol=2e-5)


def test_plant_and_measured_motion_agree(single):
    """States integrated with the joint's rate, and by its angles alone."""
    robot = robot_of(single, base='fixed')
    applied = dahl(robot, robot.joints[0], displacement=0.02)
    plant = Plant(robot, at_rest(robot), PERIOD, 1, [applied])
    angles, own = [0.0], [0.0]
    for k in range(400):
        plant.step(np.array([2.0 * TORQUE * np.sin(3.0 * PERIOD * k)]))
        angles.append(plant.state.q[0])
        own.append(plant.hidden[0])
    assert np.ptp(angles) > 0.09
    motion = forced_motion(robot, np.array(angles), PERIOD * np.arange(401.0), robot.joints[0])
    # turns and the end of the elastic range within a step
    np.testing.assert_allclose(applied.driven(motion)[:, 0], own, rtol=0, atol=2e-3)


@pytest.mark.parametrize('seed', range(5))
def test_it_never_gives_more_than_it_took(robot, seed):
    """On any closed cycle of the joint its work is negative, what the contacts hold included."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 10.0, 20001)
    waves = rng.standard_normal((5, 2)) * np.array([[4.0, 1.0, 1.0, 0.3, 0.1]]).T
    phase = 2.0 * np.pi * np.arange(1, 6)[:, None] * time / 10.0
    angle = DISPLACEMENT * (waves[:, :1] * np.sin(phase) + waves[:, 1:] * np.cos(phase)).sum(0)
    motion = forced_motion(robot, angle, time)
    applied, column = dahl(robot), robot.joints.index(JOINT)
    z = applied.driven(motion)
    torque = applied.force(motion, z)[:, 6 + column]
    power = torque * motion.qd[:, column]
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(time))])
    stored = 0.5 * TORQUE * DISPLACEMENT * z[:, 0] ** 2
    lost = -work - stored
    assert np.all(np.abs(z) <= 1.0 + 1e-12)
    assert np.diff(lost).min() >= -1e-6 * lost[-1]  # trapezium rule
    assert lost[-1] > TORQUE * DISPLACEMENT  # a cycle that slides


@pytest.mark.parametrize('tableau', TABLEAUS)
def test_a_joint_at_rest_is_held(single, tableau):
    """A steady load of 0.6 T bends the contacts by 0.6 d, and nothing moves for four seconds."""
    robot = robot_of(single, base='fixed')
    (joint,) = robot.joints
    damped = bind_effect('oil', 'joint_viscous_friction', joint, {'coefficient': OIL}, robot)
    dry = bind_effect('dry', 'joint_coulomb_friction', joint, {'torque': TORQUE}, robot)
    held, creeping = (
        Plant(robot, at_rest(robot), PERIOD, 1, friction, TABLEAUS[tableau])
        for friction in ([dahl(robot, joint), damped], [dry])
    )
    for k in range(600):
        if k == 200:
            start = creeping.state.q[0]
        for plant in (held, creeping):
            plant.step(np.array([0.6 * TORQUE * min(1.0, k / 100.0)]))
        if k >= 200:
            assert abs(held.state.q[0] - 0.6 * DISPLACEMENT) <= 1e-2 * DISPLACEMENT
    assert abs(held.state.q[0] - 0.6 * DISPLACEMENT) <= 1e-9
    # what is smoothed over STICTION_RATE creeps at atanh(0.6) of it instead
    crept = np.arctanh(0.6) * STICTION_RATE * 4.0
    assert creeping.state.q[0] - start == pytest.approx(crept, rel=1e-2)


def test_it_does_not_creep_under_a_load_that_swings(single):
    """Dahl's own law would creep by a displacement in some tens of swings."""
    load = 0.6
    robot = robot_of(single, base='fixed')
    (joint,) = robot.joints
    damped = bind_effect('oil', 'joint_viscous_friction', joint, {'coefficient': OIL}, robot)
    plant = Plant(robot, at_rest(robot), PERIOD, 1, [dahl(robot, joint), damped])
    angles = []
    for k in range(2000):
        swing = 0.05 * np.sin(5.0 * PERIOD * k)
        plant.step(np.array([TORQUE * (load * min(1.0, k / 100.0) + swing)]))
        angles.append(plant.state.q[0])
    late = np.array(angles[-628:])  # five swings
    assert abs(late.mean() - load * DISPLACEMENT) <= 1e-3 * DISPLACEMENT


def test_a_load_below_and_above_against_mujoco(single, rng):
    """MuJoCo's dry friction is a constraint: the joint stays, or slides with the torque left."""
    pytest.importorskip('mujoco')
    robot = robot_of(single, base='fixed')
    (joint,) = robot.joints
    text = to_mjcf(single, 1e-3, free=False).replace(
        f'<joint name="{joint}"', f'<joint name="{joint}" frictionloss="{TORQUE!r}"', 1
    )
    text = text.replace(' constraint="disable"', '')
    engine = Engine(text, robot.joints)
    plant = Plant(robot, at_rest(robot), PERIOD, 1, [dahl(robot, joint, displacement=1e-4)])
    ways = []
    for k in range(1000):
        load = 0.6 * TORQUE if k < 200 else 2.0 * TORQUE if k < 400 else 0.5 * TORQUE
        plant.step(np.array([load]))
        engine.data.ctrl[:] = load
        engine.rest(1)
        ways.append([plant.state.q[0], engine.angle(joint)])
    ours, theirs = np.array(ways).T
    slid = theirs[-1]
    assert np.ptp(theirs[:200]) <= 2e-3  # held
    assert np.ptp(ours[:200]) <= 2e-3
    assert slid > 0.2
    assert np.ptp(theirs[-100:]) <= 2e-3
    # MuJoCo's constraint is soft, ours is elastic over 1e-4 rad
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=2e-2 * slid)


def test_no_rate_is_too_fast_for_it(single):
    """z is stiff where the joint slides fast: its own rate is limited, its torque is not."""
    robot = robot_of(single, base='fixed')
    (joint,) = robot.joints
    applied = dahl(robot, joint, displacement=1e-4)
    state = replace(at_rest(robot), qd=np.array([20.0]))
    plant = Plant(robot, state, PERIOD, 1, [applied])
    for _ in range(20):
        plant.step(np.zeros(1))
    assert plant.hidden[0] == pytest.approx(1.0, abs=1e-9)
    slowed = -TORQUE * applied.mobility(robot) * 0.2
    assert plant.state.qd[0] - 20.0 == pytest.approx(slowed, rel=1e-2)  # within 1e-3 s


# ------------------------------------------------------------------ by direction


def test_a_moving_joint_of_two_frictions_has_one_and_a_bias(robot, rng):
    """F = T + b and B = T - b, b what the torque sensor says too much."""
    motion = motion_of(robot, rng, 30)
    motion.qd += np.copysign(9.0 * STICTION_RATE, motion.qd)
    values = {'forward': 0.9, 'backward': 0.4}
    ours = bind_effect('x', 'joint_asymmetric_friction', JOINT, values, robot)
    one = bind_effect('y', 'joint_coulomb_friction', JOINT, {'torque': 0.65}, robot)
    bias = bind_effect('z', 'torque_sensor_bias', JOINT, {'bias': 0.25}, robot)
    none = np.zeros((30, 0))
    felt = one.force(motion, none)
    felt[:, 6:] += motion.effort - bias.sense('joint_effort', motion.effort, motion)
    np.testing.assert_allclose(ours.force(motion, none), felt, rtol=0, atol=1e-7)


# ------------------------------------------------------------------ coupled


COUPLED = {'coulomb': 1.96, 'viscous': 0.545}


@pytest.mark.parametrize('ratio', [1.0, -0.7])
def test_coupled_friction_acts_on_both_joints(robot, rng, ratio):
    applied = bind_effect('x', 'joint_coupled_friction', JOINT, {**COUPLED, 'ratio': ratio}, robot)
    motion = motion_of(robot, rng, 40)
    j, k = (robot.joints.index(name) for name in (JOINT, CARRIER))
    rate = motion.qd[:, j] + ratio * motion.qd[:, k]
    expected = np.zeros((40, 6 + robot.n_joints))
    torque = 1.96 * np.tanh(rate / STICTION_RATE) + 0.545 * rate
    expected[:, 6 + j], expected[:, 6 + k] = -torque, -ratio * torque
    force = applied.force(motion, np.zeros((40, 0)))
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-14)
    assert np.all(np.sum(force * motion.rates, axis=1) <= 0.0)


def test_joints_that_turn_as_one_motor_wants_feel_nothing(robot, rng):
    applied = bind_effect('x', 'joint_coupled_friction', JOINT, {**COUPLED, 'ratio': 0.5}, robot)
    motion = motion_of(robot, rng, 5)
    j, k = (robot.joints.index(name) for name in (JOINT, CARRIER))
    motion.qd[:, j] = -0.5 * motion.qd[:, k]
    assert not applied.force(motion, np.zeros((5, 0))).any()


def test_coupled_viscous_friction_against_mujoco(parts, rng):
    """A MuJoCo tendon over both joints, damped."""
    pytest.importorskip('mujoco')
    robot = robot_of(parts)
    tendon = (
        f'<tendon><fixed name="motor" damping="3.0"><joint joint="{JOINT}" coef="1"/>'
        f'<joint joint="{CARRIER}" coef="-0.7"/></fixed></tendon>'
    )
    engine = Engine(
        to_mjcf(parts, 1e-3).replace('<actuator>', tendon + '<actuator>'), robot.joints
    )
    state = random_state(rng, robot.n_joints)
    values = {'viscous': 3.0, 'ratio': -0.7}
    plant = plant_with(robot, state, 'joint_coupled_friction', JOINT, values)
    engine.place(state)
    for _ in range(100):
        plant.step(np.zeros(robot.n_joints))
    engine.rest(100)
    theirs = [engine.angle(joint) for joint in robot.joints]
    np.testing.assert_allclose(plant.state.q, theirs, rtol=0, atol=1e-7)  # RK4 at 1 ms


@pytest.mark.parametrize(
    ('effect', 'where', 'values', 'message'),
    [
        ('joint_coupled_friction', CARRIER, COUPLED, f"no place '{CARRIER}'"),
        ('joint_coupled_friction', JOINT, {'coulomb': -1.0}, 'must be at least 0'),
        ('joint_presliding_friction', JOINT, {'torque': 1.0}, 'displacement: is missing'),
        (
            'joint_presliding_friction',
            JOINT,
            {'torque': 1.0, 'displacement': 0.0},
            'must be at least 1e-05',
        ),
        ('joint_asymmetric_friction', JOINT, {'forward': 1.0}, 'backward: is missing'),
    ],
)
def test_nonsense_is_refused(effect, where, values, message, robot):
    with pytest.raises(ConfigurationError, match=message):
        bind_effect('part', effect, where, values, robot)
