"""The plant's ledger against momentum and energy summed over the bodies, and its book-keeping."""

from __future__ import annotations

import numpy as np
import pytest
from support.models import (
    WHEEL_SPIN,
    Part,
    momentum_and_energy,
    quaternion_matrix,
    random_tree,
    robot_of,
    table_one,
    to_rotation,
    turn,
    wheel_joints,
    with_wheels,
)
from support.states import motion_of, random_state

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.integrate import RK4
from spacerobot_ros.errors import (
    ConfigurationError,
    MessageRejectedError,
    SimulationDivergedError,
)
from spacerobot_ros.simulation.forced import fastest_mode
from spacerobot_ros.simulation.plant import Plant

PERIOD = 0.01


@pytest.fixture
def parts(rng):
    """Return a random serial arm of three joints."""
    return random_tree(rng, [0, 1, 2])


def plant_of(parts, rng, rate=0.3, substeps=4, **robot):
    built = robot_of(parts, **robot)
    return Plant(built, random_state(rng, built.n_joints, rate), PERIOD, substeps)


def oracle(parts, plant):
    return momentum_and_energy(parts, motion_of(plant.state, plant.robot.joints))


def test_ledger_agrees_with_sums_over_the_bodies(parts, rng):
    plant = plant_of(parts, rng)
    _, h0, T0 = oracle(parts, plant)
    for k in range(100):
        plant.step(2.0 * np.sin(0.05 * k + np.arange(3)))
    P, h, T = oracle(parts, plant)
    ledger = plant.ledger()
    np.testing.assert_allclose(ledger.linear, P, rtol=0, atol=1e-11)  # sums of ~100 kg m/s
    np.testing.assert_allclose(ledger.angular, h, rtol=0, atol=1e-11)
    assert ledger.kinetic == pytest.approx(T, rel=1e-12)
    drift = np.linalg.norm(h - h0) / np.linalg.norm(h0)
    assert ledger.momentum_drift == pytest.approx(drift, abs=1e-14)
    # RK4 at 2.5 ms: local error ~ dt^5, measured 2e-9 J here
    assert ledger.joint_work == pytest.approx(T - T0, abs=1e-7)
    assert ledger.energy_drift == pytest.approx(T - T0 - ledger.joint_work, abs=1e-11)


def test_a_base_torque_changes_momentum_by_its_impulse_and_energy_by_its_work(parts, rng):
    plant = plant_of(parts, rng)
    P0, h0, T0 = oracle(parts, plant)
    wrench = np.array([0.0, 0.0, 0.0, 3.0, -2.0, 1.0])
    for _ in range(100):
        plant.step(np.array([0.5, -0.2, 0.1]), wrench)
    P, h, T = oracle(parts, plant)
    ledger = plant.ledger()
    assert np.linalg.norm(h - h0) > 1.0  # the torque did something
    np.testing.assert_allclose(h - h0, ledger.angular_impulse, rtol=0, atol=1e-7)  # RK4, 2.5 ms
    np.testing.assert_allclose(P, P0, rtol=0, atol=1e-7)
    assert ledger.joint_work + ledger.base_work == pytest.approx(T - T0, abs=1e-7)
    assert ledger.momentum_drift < 1e-8
    assert abs(ledger.energy_drift) < 1e-7


def test_a_base_force_pushes_beside_the_centre_of_mass(parts, rng):
    # impulse by the trapezoidal rule over the steps: error ~ (dt^2 / 12) * 1 s * |d2/dt2| < 1e-4
    plant = plant_of(parts, rng)
    force = np.array([4.0, -1.0, 2.0])
    P0, h0, T0 = oracle(parts, plant)
    forces, torques = [], []
    for k in range(101):
        state = plant.state
        R = quaternion_matrix(state.q_WB_xyzw)
        arm = state.p_WB - centre_of_mass(parts, plant)
        forces.append(R @ force)
        torques.append(np.cross(arm, R @ force))
        if k < 100:
            plant.step(np.zeros(3), np.array([*force, 0.0, 0.0, 0.0]))
    P, h, T = oracle(parts, plant)
    ledger = plant.ledger()
    np.testing.assert_allclose(P - P0, PERIOD * np.trapezoid(forces, axis=0), rtol=0, atol=1e-4)
    np.testing.assert_allclose(h - h0, PERIOD * np.trapezoid(torques, axis=0), rtol=0, atol=1e-4)
    np.testing.assert_allclose(ledger.angular_impulse, h - h0, rtol=0, atol=1e-7)
    assert ledger.base_work == pytest.approx(T - T0, abs=1e-7)


def centre_of_mass(parts, plant):
    """Sum of m p over the bodies, each placed by its parent."""
    state = plant.state
    R = quaternion_matrix(state.q_WB_xyzw)
    placed = [(R, state.p_WB)]
    q = dict(zip(plant.robot.joints, state.q, strict=True))
    for part in parts[1:]:
        R_parent, p_parent = placed[part.parent]
        R_i = R_parent @ to_rotation(part.rpy) @ turn(part.axis, q[part.joint])
        placed.append((R_i, p_parent + R_parent @ part.origin))
    mass = sum(part.mass for part in parts)
    return (
        sum(part.mass * (p + R_i @ part.com) for part, (R_i, p) in zip(parts, placed, strict=True))
        / mass
    )


def test_momentum_over_twenty_seconds(rng):
    """The figure promised at a 10 ms control period: 1e-10."""
    plant = plant_of(
        table_one(), rng, rate=0.1, substeps=2, servicer_wheels={'momentum': [25.0, 27.0, 28.0]}
    )
    for k in range(2000):
        plant.step(np.array([20.0, -10.0, 5.0]) * np.sin(0.003 * k))
    assert plant.ledger().momentum_drift < 1e-10


def test_free_rotors_keep_their_axial_momentum(rng):
    parts = with_wheels(table_one())
    model = robot_of(
        parts,
        servicer_wheels={'joints': wheel_joints(0), 'rates': [250.0, 270.0, 280.0]},
        target_wheels={'joints': wheel_joints(3), 'rates': [420.0, 490.0, 410.0]},
    )
    robot = model.with_free_rotors(np.array([r.rate for r in model.rotors]))
    start = random_state(rng, robot.n_joints, 0.1)
    start.qd[3:] = robot.rotor_rates
    # a rotor turns 5 rad in a period: its axis must not see an angle that RK4 can't follow
    plant = Plant(robot, start, PERIOD, 10)
    axial = WHEEL_SPIN * (start.qd[3:6] + start.omega_WB_B)
    for _ in range(50):
        plant.step(np.array([5.0, -3.0, 2.0]))
    state = plant.state
    after = WHEEL_SPIN * (state.qd[3:6] + state.omega_WB_B)
    np.testing.assert_allclose(after, axial, rtol=1e-9)  # no torque about a balanced rotor's axis
    assert plant.n_arm == 3
    assert plant.ledger().momentum_drift < 1e-9


def test_a_fixed_base_reports_no_drift_and_balances_its_energy(parts, rng):
    plant = plant_of(parts, rng, base='fixed', gravity=[0.0, 0.0, -9.81])
    for _ in range(100):
        plant.step(np.array([1.0, -0.5, 0.2]), np.array([1.0, 0.0, 0.0, 0.0, 0.0, 5.0]))
    ledger = plant.ledger()
    assert ledger.momentum_drift == 0.0
    assert ledger.base_work == 0.0
    assert abs(ledger.energy_drift) < 1e-6  # RK4 at 2.5 ms under gravity


def test_times_are_whole_and_effort_is_that_of_the_step_that_ended(parts, rng):
    plant = plant_of(parts, rng)
    np.testing.assert_array_equal(plant.effort, np.zeros(3))
    for k in range(7):
        tau = np.array([0.1, 0.2, 0.3]) * (k + 1)
        plant.step(tau)
        assert plant.time_ns == (k + 1) * 10_000_000
        np.testing.assert_array_equal(plant.effort, tau)
    assert plant.period == PERIOD


def test_the_state_is_a_copy(parts, rng):
    plant = plant_of(parts, rng)
    plant.state.q[:] = 99.0
    assert np.all(plant.state.q < 4.0)


@pytest.mark.parametrize(
    ('tau', 'wrench', 'message'),
    [
        ([1.0, 2.0], None, r'joint torque: expected 3 numbers, got shape \(2,\)'),
        ([1.0, np.nan, 0.0], None, 'joint torque: not finite'),
        ([1.0, 0.0, 0.0], [0.0, 0.0, np.inf, 0.0, 0.0, 0.0], 'base wrench: not finite'),
    ],
)
def test_bad_input_is_refused_and_changes_nothing(parts, rng, tau, wrench, message):
    plant = plant_of(parts, rng)
    before = plant.state.to_vector()
    with pytest.raises(MessageRejectedError, match=message):
        plant.step(np.array(tau), None if wrench is None else np.array(wrench))
    np.testing.assert_array_equal(plant.state.to_vector(), before)
    assert plant.step_index == 0


@pytest.mark.filterwarnings('ignore::RuntimeWarning')  # the overflow that is provoked
@pytest.mark.parametrize('wrench', [None, np.array([0.0, 0.0, 0.0, 1e200, 0.0, 0.0])])
def test_divergence_is_an_error_and_leaves_the_last_finite_state(parts, rng, wrench):
    plant = plant_of(parts, rng)
    plant.step(np.zeros(3))
    before = plant.state.to_vector()
    with pytest.raises(SimulationDivergedError, match=r'diverged at t = 0.01 s'):
        plant.step(np.array([1e200, 0.0, 0.0]), wrench)
    np.testing.assert_array_equal(plant.state.to_vector(), before)
    assert plant.step_index == 1


def test_period_and_state_must_fit(parts, rng):
    robot = robot_of(parts)
    with pytest.raises(ConfigurationError, match='must be positive'):
        Plant(robot, random_state(rng, 3), 1e-10, 1)
    with pytest.raises(ConfigurationError, match='expected 3 joints, rotors included, got 2'):
        Plant(robot, random_state(rng, 2), PERIOD, 1)


def test_four_evaluations_a_period_are_right_to_a_millionth(parts, rng):
    # A second against DOP853, which is right to rounding: the error of RK4 is of order dt^4.
    exact = plant_of(parts, rng, substeps=1)
    coarse = Plant(exact.robot, exact.state, PERIOD, 1, tableau=RK4)
    tau = rng.standard_normal(exact.n_arm)
    for plant in (exact, coarse):
        for _ in range(round(1.0 / PERIOD)):
            plant.step(tau)
    got, expected = coarse.state.to_vector(), exact.state.to_vector()
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-6)
    assert np.max(np.abs(got - expected)) > 1e-15  # it is another method
    assert coarse.ledger().momentum_drift < 1e-6


def test_steps_follow_from_the_nutation_of_light_bodies_with_wheels(rng):
    """A light body with much momentum nutates at h over its transverse inertia."""
    body = [Part('base_link', -1, 'base', 1.0, np.zeros(3), np.diag([0.02, 0.02, 0.03]))]
    light = robot_of(body, servicer_wheels={'momentum': [0.0, 0.0, 3.0]})
    x = random_state(rng, 0, 0.0).to_vector()
    assert fastest_mode(Dynamics(light), x) == pytest.approx(3.0 / 0.02, rel=1e-9)
    plant = Plant(light, random_state(rng, 0, 0.3), PERIOD, 1)
    assert plant.substeps == 2  # 1.5 rad a period
    for _ in range(200):
        plant.step(np.zeros(0))
    assert plant.ledger().momentum_drift < 1e-9
    heavy = robot_of(body, servicer_wheels={'momentum': [0.0, 0.0, 3e5]})
    with pytest.raises(ConfigurationError, match=r'robot: moves at .* give a period of at most'):
        Plant(heavy, random_state(rng, 0, 0.3), PERIOD, 1)
