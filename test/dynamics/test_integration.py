"""Integration: momentum and energy kept, the stated orders, divergence refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import DOP853 as SCIPY
from scipy.integrate import solve_ivp
from support.attitudes import angle_between
from support.models import (
    ATTITUDE_XYZW,
    H_BASE,
    H_TARGET,
    OMEGA,
    WHEEL_SPIN,
    random_tree,
    robot_of,
    settings_of,
    table_one,
    wheel_joints,
    with_wheels,
)
from support.states import hold_step, random_state

from spacerobot_ros.control.joint_reference import build_reference
from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.integrate import DOP853, RK4, rk_step
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.errors import SimulationDivergedError
from spacerobot_ros.model.motion_settings import ReferenceSettings
from spacerobot_ros.model.settings import SimulatorSettings
from spacerobot_ros.simulation.truth import true_robot
from validation.smooth_motion import simulate_smooth

PERIOD, DURATION = 0.01, 20.0
SUBSTEPS = SimulatorSettings().substeps
GYROSTATS = {
    'servicer_wheels': {'momentum': list(H_BASE)},
    'target_wheels': {'links': ['link_3'], 'momentum': list(H_TARGET)},
}
ROTORS = {
    'servicer_wheels': {'joints': wheel_joints(0), 'rates': list(H_BASE / WHEEL_SPIN)},
    'target_wheels': {'joints': wheel_joints(3), 'rates': list(H_TARGET / WHEEL_SPIN)},
}
# Table II of the identification paper, as in config/servicer.yaml.
TABLE_TWO = ReferenceSettings(
    kind='fourier',
    duration=DURATION,
    harmonics=3,
    sine=(0.1234, -0.1867, 0.0005, 0.1306, -0.1222, -0.3760, 0.15486, -0.1269, 0.4030),
    cosine=(0.1600, -0.3808, 0.0513, -0.1179, 0.1787, -0.1333, -0.0458, 0.1346, 0.1389),
)


def bench_torque(t, n=3):
    """Smooth joint torques of the peer benchmark [N m]; rotors get none."""
    tau = np.zeros(n)
    tau[:3] = 40.0 * np.sin(0.9 * t), 40.0 * np.sin(0.7 * t), 20.0 * np.sin(1.1 * t)
    return tau


def start(robot):
    """Table II's initial state: joints at rest at zero."""
    n = robot.n_joints
    qd = np.concatenate([np.zeros(3), robot.rotor_rates])
    return State(np.zeros(3), ATTITUDE_XYZW, np.zeros(n), np.zeros(3), OMEGA, qd)


def gyrostat_robot(axes='zyx'):
    return robot_of(table_one(axes), **GYROSTATS)


def rotor_robot(axes='zyx'):
    parts = with_wheels(table_one(axes))
    return true_robot(robot_of(parts, **ROTORS), settings_of(parts, **ROTORS))


def drift(dynamics, states):
    """Largest relative change of the angular momentum over a run."""
    h = np.array([dynamics.momentum(State.from_vector(x))[3:] for x in states])
    return np.max(np.linalg.norm(h - h[0], axis=1)) / np.linalg.norm(h[0])


def table_two_torque(dynamics):
    """Computed torque that follows Table II, from the product's own reduced equation."""
    reference = build_reference(TABLE_TWO, np.zeros(3))

    def torque(t, x):
        state, point = State.from_vector(x), reference.at(t)
        reduced = dynamics.reduced(state)
        command = point.qdd + 2.0 * (point.qd - state.qd) + (point.q - state.q)
        return reduced.H @ command + reduced.c

    return torque


@pytest.mark.parametrize('axes', ['zyx', 'xyy'])
def test_smooth_drift_with_the_bench_torque(axes):
    for robot in (gyrostat_robot(axes), rotor_robot(axes)):
        dynamics = Dynamics(robot)
        states = simulate_smooth(
            dynamics,
            start(robot).to_vector(),
            lambda t, x: bench_torque(t, (len(x) - 13) // 2),
            np.linspace(0.0, DURATION, 21),
        )
        assert drift(dynamics, states) <= 1e-12  # the target


def test_smooth_drift_along_table_two():
    robot = gyrostat_robot()
    dynamics = Dynamics(robot)
    x = start(robot).to_vector()
    times = np.linspace(0.0, DURATION, 21)
    states = simulate_smooth(dynamics, x, table_two_torque(dynamics), times)
    assert drift(dynamics, states) <= 1e-12  # the target
    reference = build_reference(TABLE_TWO, np.zeros(3))
    expected = np.array([reference.at(t).q for t in times])
    np.testing.assert_allclose(states[:, 7:10], expected, rtol=0, atol=1e-8 * np.pi / 180.0)


def run_held(robot, torque, substeps=SUBSTEPS, duration=DURATION):
    """States at every control period with the torque held."""
    dynamics, x = Dynamics(robot), start(robot).to_vector()
    states = [x]
    for k in range(round(duration / PERIOD)):
        x = hold_step(dynamics, x, torque(k * PERIOD, x), PERIOD, substeps)
        states.append(x)
    return dynamics, np.array(states)


@pytest.mark.parametrize('make', [gyrostat_robot, rotor_robot])
def test_held_drift_with_the_bench_torque(make):
    dynamics, states = run_held(make(), lambda t, x: bench_torque(t, (len(x) - 13) // 2))
    assert drift(dynamics, states[::20]) <= 1e-12  # the target


def test_held_drift_and_energy_along_table_two():
    robot = gyrostat_robot()
    dynamics, torque = Dynamics(robot), table_two_torque(Dynamics(robot))
    x, states, work = start(robot).to_vector(), [], 0.0
    first = sum(dynamics.energy(State.from_vector(x)))
    for k in range(round(DURATION / PERIOD)):
        tau = torque(k * PERIOD, x)
        after = hold_step(dynamics, x, tau, PERIOD, SUBSTEPS)
        work += tau @ (after[7:10] - x[7:10])  # exact for a held torque
        x = after
        states.append(x)
    assert drift(dynamics, states[::20]) <= 1e-12  # the target
    # Energies of up to 1e3 J, 2000 steps of some roundings each.
    assert sum(dynamics.energy(State.from_vector(x))) - first == pytest.approx(work, abs=1e-9)


def test_energy_is_the_work_of_the_joint_torques_smooth():
    # A held torque a segment, so that the work is torque times angle.
    robot = rotor_robot()
    dynamics, x = Dynamics(robot), start(robot).to_vector()
    first, work = sum(dynamics.energy(State.from_vector(x))), 0.0
    for k in range(20):
        tau = bench_torque(k + 0.5, 9)
        after = simulate_smooth(dynamics, x, lambda t, y, tau=tau: tau, np.array([0.0, 1.0]))[-1]
        work += tau @ (after[7:16] - x[7:16])
        x = after
    # The rotors hold 7e4 J, of which the difference is taken.
    assert sum(dynamics.energy(State.from_vector(x))) - first == pytest.approx(work, abs=1e-8)


def test_energy_with_gravity_and_a_fixed_base(rng):
    parts = random_tree(rng, [0, 1, 1], (3,))
    robot = robot_of(
        parts,
        base='fixed',
        gravity=[0.0, 0.0, -9.81],
        target_wheels={'links': ['link_2'], 'momentum': [9.0, 5.0, 7.0]},
    )
    dynamics = Dynamics(robot)
    x = random_state(rng, 3, 0.3).to_vector()
    first = sum(dynamics.energy(State.from_vector(x)))
    tau = np.array([1.0, -2.0, 3.0])
    after = simulate_smooth(dynamics, x, lambda t, y: tau, np.array([0.0, 2.0]))[-1]
    work = tau @ (after[7:10] - x[7:10])
    assert sum(dynamics.energy(State.from_vector(after))) - first == pytest.approx(
        work, abs=1e-9
    )  # of 1e3 J


@pytest.mark.parametrize(
    ('tableau', 'order', 'dt'), [(RK4, 4, 0.05), (DOP853, 8, 0.4)], ids=['rk4', 'rk8']
)
def test_order_in_attitude_and_joints(tableau, order, dt):
    robot = gyrostat_robot()
    dynamics, torque = Dynamics(robot), (lambda t, x: bench_torque(t))
    exact = simulate_smooth(dynamics, start(robot).to_vector(), torque, np.array([0.0, 4.0]))[-1]

    def error(dt):
        x = start(robot).to_vector()
        for k in range(round(4.0 / dt)):
            x = rk_step(lambda t, y: dynamics.rate(y, torque(t, y)), k * dt, x, dt, tableau)
        return np.array([angle_between(x[3:7], exact[3:7]), np.max(np.abs(x[7:10] - exact[7:10]))])

    orders = np.log2(error(2.0 * dt) / error(dt))
    # Of order 8 a step of 0.2 is right to rounding already, 0.4 to 3e-13.
    np.testing.assert_allclose(orders, order, rtol=0, atol=0.1 * order)


@pytest.mark.parametrize('make', [gyrostat_robot, rotor_robot])
def test_a_held_step_is_the_general_step_of_order_8(make, rng):
    robot = make()
    dynamics, n = Dynamics(robot), robot.n_joints
    x, tau, wrench = start(robot).to_vector(), rng.standard_normal(n), rng.standard_normal(6)
    held = hold_step(dynamics, x, tau, 0.02, 2, wrench)
    y = x
    for _ in range(2):
        y = rk_step(lambda t, z: dynamics.rate(z, tau, wrench), 0.0, y, 0.01)
        y[3:7] /= np.linalg.norm(y[3:7])
    np.testing.assert_allclose(held, y, rtol=1e-14, atol=1e-13)  # wheels turn at 500 rad/s


@pytest.mark.parametrize('tableau', [RK4, DOP853], ids=['rk4', 'rk8'])
def test_a_step_of_many_is_the_step_of_each(tableau, rng):
    x = rng.standard_normal((2, 3, 5))

    def rate(t, y):
        return t * y - y * y

    many = rk_step(rate, 0.3, x, 0.1, tableau)
    for index in np.ndindex(2, 3):
        np.testing.assert_array_equal(rk_step(rate, 0.3, x[index], 0.1, tableau), many[index])


def test_the_coefficients_are_scipys():
    (*nodes, end), weights = DOP853
    stages = SCIPY.n_stages
    np.testing.assert_array_equal(nodes, SCIPY.C[:stages])
    np.testing.assert_array_equal(weights, np.vstack([SCIPY.A[:stages, :stages], SCIPY.B]))
    assert end == 1.0


def test_smooth_motion_equals_scipy(rng):
    # The same method by another hand: outputs between steps, at them and at the end.
    robot = gyrostat_robot()
    dynamics, x = Dynamics(robot), start(robot).to_vector()
    times = np.concatenate([[0.0], np.sort(rng.uniform(0.0, 3.0, 40)), [3.0]])
    states = simulate_smooth(dynamics, x, lambda t, y: bench_torque(t), times)
    expected = solve_ivp(
        lambda t, y: dynamics.rate(y, bench_torque(t)),
        (0.0, 3.0),
        x,
        method='DOP853',
        t_eval=times,
        rtol=1e-13,
        atol=1e-15,
    ).y.T
    np.testing.assert_allclose(states, expected, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(states[0], x)


def test_a_held_step_is_independent_of_its_neighbours():
    # Held torque is explicit: two steps of one period equal one step of two periods with twice the
    # substeps.
    robot = gyrostat_robot()
    dynamics, tau = Dynamics(robot), np.array([10.0, -20.0, 5.0])
    x = start(robot).to_vector()
    two = hold_step(dynamics, hold_step(dynamics, x, tau, 0.01, 2), tau, 0.01, 2)
    one = hold_step(dynamics, x, tau, 0.02, 4)
    np.testing.assert_allclose(two, one, rtol=0, atol=1e-14)
    assert x[7] == 0.0  # the input is left alone


def test_free_rotors_equal_gyrostats_of_absolute_momentum():
    # A free, frictionless rotor keeps I (rate + axis . omega): the same motion as a gyrostat with
    # that momentum on a host whose inertia lacks I axis axis^T (docs/equations.md). Exact, so only
    # the integrator's tolerance is left.
    plant, times = rotor_robot(), np.linspace(0.0, DURATION, 5)
    states = simulate_smooth(
        Dynamics(plant), start(plant).to_vector(), lambda t, x: bench_torque(t, 9), times
    )
    absolute = (
        H_BASE + WHEEL_SPIN * OMEGA,
        H_TARGET + WHEEL_SPIN * OMEGA,
    )  # all frames parallel at the start
    robot = robot_of(table_one(), **GYROSTATS)
    parameters = robot.inertial_parameters.copy()
    parameters[0, [4, 6, 9]] -= WHEEL_SPIN  # Ixx, Iyy, Izz
    parameters[3, [4, 6, 9]] -= WHEEL_SPIN
    reduced = (
        robot.with_inertial_parameters(parameters)
        .with_servicer_momentum(absolute[0])
        .with_target_momentum(absolute[1])
    )
    expected = simulate_smooth(
        Dynamics(reduced), start(reduced).to_vector(), lambda t, x: bench_torque(t), times
    )
    assert (
        max(angle_between(a[3:7], b[3:7]) for a, b in zip(states, expected, strict=True)) <= 1e-11
    )
    np.testing.assert_allclose(states[:, 7:10], expected[:, 7:10], rtol=0, atol=1e-11)
    # The relative convention differs by I omega, 1e-4 of the momentum: visible, and no more.
    relative = simulate_smooth(
        Dynamics(robot), start(robot).to_vector(), lambda t, x: bench_torque(t), times
    )
    gap = angle_between(states[-1, 3:7], relative[-1, 3:7])
    assert 1e-6 < gap < 1e-2


def test_divergence_is_refused():
    robot = gyrostat_robot()
    dynamics, x = Dynamics(robot), start(robot).to_vector()
    with (
        np.errstate(all='ignore'),
        pytest.raises(SimulationDivergedError, match='diverged at t = 3 s: non-finite state'),
    ):
        hold_step(dynamics, x, np.full(3, 1e300), 0.01, t=3.0)
    with (
        np.errstate(all='ignore'),
        pytest.raises(SimulationDivergedError, match='diverged at t = '),
    ):
        simulate_smooth(
            dynamics, x, lambda t, y: np.full(3, np.nan if t > 0.5 else 0.0), np.array([0.0, 1.0])
        )
