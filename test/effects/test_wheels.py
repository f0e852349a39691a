"""Wheels against MuJoCo, against true rotors, and in the ledgers."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from support.against_mujoco import (
    MUJOCO_WHEELS,
    WHEELS,
    assert_same,
    plant_with,
    run_mujoco,
    run_plant,
)
from support.models import (
    H_TARGET,
    OMEGA,
    WHEEL_SPIN,
    quaternion_matrix,
    robot_of,
    settings_of,
    table_one,
    to_urdf,
    wheel_joints,
    with_wheels,
)

from spacerobot_ros.dynamics.pinocchio_model import in_pinocchio
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.catalogue import bind_effect, bind_effects, changed_robot
from spacerobot_ros.effects.wheels.rotors import transverse
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.simulation.plant import Plant
from spacerobot_ros.simulation.truth import true_robot

SECONDS = 2.0
SAME = 1e-9  # MuJoCo's RK4 at 1 ms and ours of order 8 at 10 ms: both below 1e-10 here
ERROR = {'x': 4.0, 'y': -7.0, 'z': 11.0}


@pytest.mark.parametrize(
    ('effect', 'where', 'values', 'tolerance'),
    [
        ('target_wheel_momentum', 'link_3', ERROR, SAME),
        ('servicer_wheel_momentum_error', None, ERROR, SAME),
        ('target_wheel_drag', 'link_3', {'time_constant': 20.0}, SAME),
        ('servicer_wheel_drag', None, {'time_constant': 20.0}, SAME),
        # there the wheel has no transverse momentum of its own, 0.4 % of the torque
        (
            'wheel_imbalance',
            'link_3',
            {'amplitude': 5.0, 'frequency': 45.0, 'phase': 0.7},
            5e-7,
        ),
    ],
)
def test_wheels_move_the_robot_as_in_mujoco(effect, where, values, tolerance):
    parts = table_one()
    entry = {'effect': effect, **values, **({'where': where} if where else {})}
    plant = plant_with(parts, {'it': entry}, **WHEELS)
    other = run_mujoco(parts, effect, where, values, SECONDS, wheels=MUJOCO_WHEELS)
    here = run_plant(plant, SECONDS)
    assert_same(here, other, tolerance)
    without = run_plant(plant_with(parts, {}, **WHEELS), SECONDS)
    assert np.max(np.abs(here.qd - without.qd)) > 10.0 * tolerance


INTERNAL = {
    'target_wheel_drag': {'where': 'link_3', 'time_constant': 5.0},
    'servicer_wheel_drag': {'time_constant': 5.0},
    'wheel_imbalance': {'where': 'link_3', 'amplitude': 5.0, 'frequency': 45.0, 'phase': 0.7},
}


@pytest.mark.parametrize('effect', INTERNAL)
def test_wheels_keep_the_momentum_of_the_whole(effect):
    plant = plant_with(table_one(), {'it': {'effect': effect, **INTERNAL[effect]}}, **WHEELS)
    before = plant.ledger()
    run_plant(plant, SECONDS)
    after = plant.ledger()
    np.testing.assert_allclose(after.angular_impulse, 0.0, rtol=0, atol=1e-12)  # nothing outside
    assert after.momentum_drift < 1e-12
    np.testing.assert_allclose(after.linear, before.linear, rtol=0, atol=1e-9)
    assert abs(after.energy_drift) < 1e-9


def test_drag_hands_the_momentum_over_to_the_body():
    robot = robot_of(table_one(), **WHEELS)
    drag = bind_effect('it', 'target_wheel_drag', 'link_3', {'time_constant': 5.0}, robot)
    plant = plant_with(
        table_one(),
        {'it': {'effect': 'target_wheel_drag', 'where': 'link_3', 'time_constant': 5.0}},
        **WHEELS,
    )
    run_plant(plant, 1.0)
    bodies = plant.dynamics.momentum(plant.state)[3:]
    R = quaternion_matrix(plant.state.q_WB_xyzw)
    q = plant.state.q
    # the arm of Table I turns about z, y, x in turn
    turns = [('z', q[0]), ('y', q[1]), ('x', q[2])]
    for axis, angle in turns:
        R = R @ _turn(axis, angle)
    lost = R @ H_TARGET * (1.0 - math.exp(-1.0 / 5.0))
    np.testing.assert_allclose(bodies - lost, plant.ledger().angular, rtol=0, atol=1e-9)
    assert drag.values['time_constant'] == 5.0


def _turn(axis, angle):
    c, s = math.cos(angle), math.sin(angle)
    i = 'xyz'.index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    R = np.eye(3)
    R[j, j] = R[k, k] = c
    R[j, k], R[k, j] = -s, s
    return R


def rotor_settings(**effects):
    parts = with_wheels(table_one(), carriers=(3,))
    wheels = {'target_wheels': {'joints': wheel_joints(3), 'rates': [420.0, 490.0, 410.0]}}
    settings = settings_of(parts, **wheels)
    return parts, parse_settings(
        {
            'robot': {'joints': list(settings.robot.joints), **wheels},
            'effects': effects,
        }
    )


def rotor_plant(substeps=4, **effects):
    """Table I with three true rotors on link 3; link 3 without them."""
    parts, settings = rotor_settings(**effects)
    robot = build_robot(settings, to_urdf(parts))
    truth = true_robot(robot, settings)
    start = State(
        np.zeros(3),
        np.array([0.0, 0.0, 0.0, 1.0]),
        np.array([0.3, -0.5, 0.4, 0.0, 0.0, 0.0]),
        np.zeros(3),
        OMEGA,
        np.array([0.0, 0.0, 0.0, 420.0, 490.0, 410.0]),
    )
    return Plant(truth, start, 0.01, substeps, bind_effects(settings.effects, robot))


def link_rate(plant, body):
    """(3,) angular velocity of a body in its own frame, by Pinocchio."""
    robot, state = plant.robot, plant.state
    model, data = in_pinocchio(robot).model, in_pinocchio(robot).model.createData()
    q = pin.neutral(model)
    q[7 + in_pinocchio(robot).velocity_indices] = state.q
    rates = np.concatenate([state.v_WB_B, state.omega_WB_B, state.qd])
    pin.forwardKinematics(model, data, q, rates[in_pinocchio(robot).columns])
    return data.v[in_pinocchio(robot).joint_ids[body]].angular.copy()


def test_free_rotors_are_the_true_rotors_of_a_finer_model():
    true = rotor_plant()
    entry = {'effect': 'free_wheel_rotors', 'where': 'link_3', 'axial_inertia': WHEEL_SPIN}
    spin = np.array([420.0, 490.0, 410.0])
    host = link_rate(true, 3)
    absolute = WHEEL_SPIN * (spin + host)
    target = {'links': ['link_3'], 'momentum': [float(x) for x in absolute]}
    built = robot_of(table_one(), target_wheels=target)
    effects = bind_effects({'it': entry}, built)
    start = true.state
    arm = State(
        start.p_WB, start.q_WB_xyzw, start.q[:3], start.v_WB_B, start.omega_WB_B, start.qd[:3]
    )
    model = Plant(changed_robot(built, effects), arm, 0.01, 1, effects)
    for _ in range(100):
        true.step(np.array([6.0, -4.0, 3.0]))
        model.step(np.array([6.0, -4.0, 3.0]))
    # rotors turn 1 rad a substep: order 8 leaves 1e-9 a step
    np.testing.assert_allclose(model.state.q, true.state.q[:3], rtol=0, atol=1e-7)
    np.testing.assert_allclose(model.state.omega_WB_B, true.state.omega_WB_B, rtol=0, atol=1e-7)


def test_bearings_slow_a_rotor_as_its_closed_form_says():
    drag = {'effect': 'rotor_bearing_drag', 'where': 'j_wheel_3_x', 'viscous': 0.02}
    plant = rotor_plant(it=drag)
    before = plant.ledger()
    axial = WHEEL_SPIN * 420.0
    for _ in range(100):
        plant.step(np.zeros(3))
    # Omega' = -c / J Omega, but for the turning of the carrier (1 of 420)
    expected = axial * math.exp(-0.02 / WHEEL_SPIN)
    assert WHEEL_SPIN * plant.state.qd[3] == pytest.approx(expected, rel=2e-3)
    after = plant.ledger()
    assert after.momentum_drift < 1e-9  # internal
    assert abs(after.energy_drift) < 1e-5 * before.kinetic / 1e3
    assert after.effect_work < 0.0


def test_dry_bearings_take_the_same_from_the_rate_in_every_second():
    drag = {'effect': 'rotor_bearing_drag', 'where': 'j_wheel_3_x', 'coulomb': 0.5}
    plant = rotor_plant(it=drag)
    for _ in range(100):
        plant.step(np.zeros(3))
    # Omega' = -T / J, the carrier's own turning aside
    assert plant.state.qd[3] == pytest.approx(420.0 - 0.5 / WHEEL_SPIN, abs=0.5)


def test_an_unbalanced_rotor_shakes_its_carrier_with_the_torque_of_theory():
    dynamic = 1e-4
    shaken = rotor_plant(
        20, it={'effect': 'rotor_imbalance', 'where': 'j_wheel_3_z', 'dynamic': dynamic}
    )
    calm = rotor_plant(20)
    rates = []
    for _ in range(40):
        shaken.step(np.zeros(3))
        calm.step(np.zeros(3))
        rates.append(link_rate(shaken, 3) - link_rate(calm, 3))
    # the wheel's transverse momentum P Omega turns with it and the link takes the opposite:
    # at most P Omega over link 3's least moment, at least over the whole's largest
    swing = np.max(np.ptp(np.array(rates)[:, :2], axis=0))
    momentum = dynamic * 410.0
    assert 2.0 * momentum / 4000.0 < swing < 2.0 * momentum / 200.0
    assert shaken.ledger().momentum_drift < 1e-9


def test_static_imbalance_moves_the_centre_of_mass_of_the_rotor():
    _, settings = rotor_settings(
        it={'effect': 'rotor_imbalance', 'where': 'j_wheel_3_z', 'static': 2e-4}
    )
    robot = build_robot(settings, to_urdf(with_wheels(table_one(), carriers=(3,))))
    truth = true_robot(robot, settings)
    rotor = truth.bodies[1 + truth.joints.index('j_wheel_3_z')]
    before = robot.rotors[2].body
    u = transverse(before.axis)
    assert abs(u @ before.axis) < 1e-15
    np.testing.assert_allclose(rotor.mass * (rotor.com - before.com), 2e-4 * u, rtol=0, atol=1e-18)
    assert changed_robot(robot, bind_effects(settings.effects, robot)) is robot  # locked wheels


def test_the_truth_has_the_last_word_on_momentum():
    settings = parse_settings(
        {
            'robot': {'joints': ['j_link_1', 'j_link_2', 'j_link_3'], **WHEELS},
            'truth': {'target_momentum': [1.0, 2.0, 3.0]},
            'effects': {'it': {'effect': 'target_wheel_momentum', 'where': 'link_3', **ERROR}},
        }
    )
    robot = build_robot(settings, to_urdf(table_one()))
    np.testing.assert_array_equal(true_robot(robot, settings).target_momentum, [1.0, 2.0, 3.0])
    believed = changed_robot(robot, bind_effects(settings.effects, robot))
    np.testing.assert_allclose(
        believed.target_momentum, H_TARGET + np.array([4.0, -7.0, 11.0]), rtol=1e-15, atol=0
    )


DRAG = {'effect': 'target_wheel_drag', 'where': 'link_3', 'time_constant': 5.0}


@pytest.mark.parametrize(
    ('effects', 'message'),
    [
        (
            {'a': DRAG, 'b': {**DRAG, 'time_constant': 9.0}},
            r'effects\.b: target_wheel_drag at link_3 contradicts target_wheel_drag of effects\.a',
        ),
        ({'a': {**DRAG, 'time_constant': 0.0}}, r'effects\.a\.time_constant: 0 s must be above 0'),
        ({'a': {**DRAG, 'time_constant': -1.0}}, 'must be above 0'),
        ({'a': {**DRAG, 'where': 'link_1'}}, r"no place 'link_1' \(it has link_3\)"),
        (
            {'a': {'effect': 'target_wheel_drag', 'time_constant': 1.0}},
            r'effects\.a\.where: is mi',
        ),
        (
            {'a': {'effect': 'free_wheel_rotors', 'where': 'link_3', 'axial_inertia': 400.0}},
            '400 kg m.2 is not below 300 kg m.2',
        ),
        (
            {'a': {'effect': 'rotor_bearing_drag', 'where': 'j_link_1', 'viscous': 1.0}},
            'has no place on this robot',
        ),
        (
            {
                'a': {
                    'effect': 'wheel_imbalance',
                    'where': 'link_3',
                    'amplitude': 1.0,
                    'frequency': 0.0,
                }
            },
            'must be above 0',
        ),
    ],
)
def test_bad_input_is_refused_with_its_place(effects, message):
    with pytest.raises(ConfigurationError, match=message):
        bind_effects(effects, robot_of(table_one(), **WHEELS))


def test_a_wheel_too_fast_for_the_period_is_refused_with_the_step_that_it_needs():
    fast = {'effect': 'wheel_imbalance', 'where': 'link_3', 'amplitude': 1.0, 'frequency': 1e6}
    message = r'effects\.it: moves at 1e\+06 rad/s: needs integration steps of 1e-06 s, 10000 in'
    with pytest.raises(ConfigurationError, match=message):
        plant_with(table_one(), {'it': fast}, **WHEELS)
