"""No joint leaves the limits of its URDF, whatever reference within them is followed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.free_flying import HEAVIER, file_with, free_flying_parameters
from support.states import hold_step

from spacerobot_ros.control.command import Feedback
from spacerobot_ros.control.joint_reference import rest
from spacerobot_ros.control.loop import ControlLoop
from spacerobot_ros.control.motion_barrier import MotionBarrier
from spacerobot_ros.control.waypoints import Waypoints
from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.robot_file import RobotFile, load_robot_file
from spacerobot_ros.simulation.closed_loop import ClosedLoop

PERIOD, GRID, MS = 0.05, 0.005, 1_000_000
FAST = 1.875 / 0.97  # peak rate of a quintic from rest to rest over its mean, at 97 % of the limit


def minisat(law, is_wrong):
    """Robot file at 20 Hz; each body's density right, or wrong by up to 25 %."""
    parameters = free_flying_parameters(law, PERIOD, simulator__noise=True)
    for name in ('amplitude', 'attitude_amplitude', 'duration'):
        del parameters[f'reference.{name}']
    parameters['reference.kind'] = 'hold'
    parameters['simulator.period'] = GRID
    if not is_wrong:
        del parameters['truth.links'], parameters['truth.inertial_parameters']
    return file_with(parameters)


def twin(law, is_wrong):
    """As `minisat`, of a robot whose wrists have axes that come into line, and unknown wheels."""
    file = load_robot_file('config/twin.yaml')
    robot, settings = file.robot, file.settings
    rates = dict.fromkeys(('joint_rate', 'imu_rate', 'attitude_rate'), 1.0 / PERIOD)
    truth = settings.truth
    if is_wrong:
        heavier = np.resize(HEAVIER, len(robot.bodies))[:, None] * robot.inertial_parameters
        links = tuple(body.name for body in robot.bodies)
        truth = replace(truth, links=links, inertial_parameters=tuple(heavier.ravel()))
    return RobotFile(
        robot,
        replace(
            settings,
            truth=truth,
            controller=replace(settings.controller, law=law),
            reference=replace(settings.reference, kind='hold'),
            simulator=replace(settings.simulator, period=GRID, noise=True, **rates),
        ),
    )


def quick_motion(file, seed):
    """A loop that follows quick moves anywhere in the joints' ranges, and what is beyond a limit.

    Yields:
        The loop, the largest of the true rates by their limits, and how far a joint is out of its
        range, on a grid of 5 ms.
    """
    rng = np.random.default_rng([77, seed])
    loop, limits = ClosedLoop(file.robot, file.settings), file.robot.velocity_limits
    low, high = np.clip(file.robot.position_limits, -np.pi, np.pi).T
    here, times, points = loop.plant.state.q, [0.0], []
    for _ in range(6):
        points.append(low + (high - low) * rng.uniform(0.02, 0.98, len(low)))
        times.append(times[-1] + FAST * np.max(np.abs(points[-1] - here) / limits))
        here = points[-1]
    still = np.zeros((6, len(low)))
    for k, step in enumerate(loop.run(round(times[-1] / GRID))):
        if k == 20:
            start = rest(step.state.q)
            motion = Waypoints(np.array(times[1:]), np.array(points), still, still, start)
            loop.controller.set_reference(motion)
        q = step.state.q
        out = np.max([file.robot.position_limits[:, 0] - q, q - file.robot.position_limits[:, 1]])
        yield loop, np.max(np.abs(step.state.qd) / limits), out


@pytest.mark.parametrize(
    ('robot', 'law', 'seed', 'is_wrong'),
    [
        (minisat, 'passivity', 4, True),
        (minisat, 'adaptive_lyapunov', 4, False),
        (minisat, 'adaptive_rls', 9, False),
        (minisat, 'computed_torque', 4, True),
        (twin, 'passivity', 21, True),
        (twin, 'adaptive_rls', 21, False),
        (twin, 'computed_torque', 21, False),
    ],
)
def test_quick_references_within_the_limits_are_followed_within_them(robot, law, seed, is_wrong):
    loops, rates, beyond = zip(*quick_motion(robot(law, is_wrong), seed), strict=True)
    assert max(rates) < 1.01
    assert max(beyond) < 1e-3
    # no sensor is wrong; where it is taken for that too often, the law swings with what stands in
    left_out = loops[-1].controller.screen.left_out
    assert sum(left_out.values()) < 0.02 * 3 * len(rates) * GRID / PERIOD


def test_rates_keep_their_limits_where_torques_are_at_theirs():
    file = load_robot_file('config/servicer.yaml')
    settings = file.settings
    settings = replace(
        settings,
        controller=replace(settings.controller, law='passivity'),
        reference=replace(settings.reference, kind='hold'),
    )
    loop, limits = ClosedLoop(file.robot, settings), file.robot.velocity_limits
    saturated = 0
    for k, step in enumerate(loop.run(600)):
        if k == 2:  # half a turn in 3 s, by far too much for 3 kN m
            goal, still = np.array([[2.0, -2.0, 2.0]]), np.zeros((1, 3))
            motion = Waypoints(np.array([3.0]), goal, still, still, rest(np.zeros(3)))
            loop.controller.set_reference(motion)
        saturated += bool(step.command.saturated.any())
        assert np.all(np.abs(step.state.qd) < 1.01 * limits)
    assert saturated > 200


@pytest.fixture
def fast(rng):
    """A robot, a barrier for it, and a state with joints at and near their largest rates."""
    robot = load_robot_file('config/minisat.yaml').robot
    q, omega, zeros = rng.uniform(0.5, 2.5, 4), 0.1 * rng.normal(size=3), np.zeros(3)
    sample = Feedback(q, np.array([1.99, -2.1, 0.5, 1.99]), omega, zeros)
    return robot, MotionBarrier(robot), sample


def after(robot, sample, u, period):
    """Rates of base and joints at the end of a period, by the plant's own integrator."""
    zeros, upright = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])
    state = State(zeros, upright, sample.q, zeros, sample.omega_WB_B, sample.qd)
    x = hold_step(Dynamics(robot), state.to_vector(), u[3:], period, 4, np.r_[zeros, u[:3]])
    return x[-7:]


def test_barrier_changes_what_passes_a_limit_and_nothing_else(fast):
    robot, barrier, sample = fast
    unlimited, period = np.full(7, np.inf), 1e-3
    u = np.array([0.3, -0.2, 0.1, 5.0, -3.0, 1.0, 2.0])
    asked = after(robot, sample, u, period)
    held = barrier.hold(0, sample, u, unlimited, MS)
    got = after(robot, sample, held, period)
    # half of what is left to the limit, or beyond it, in a period
    most = 0.5 * (sample.qd + 2.0 * np.sign(sample.qd))
    is_fast = np.abs(asked[3:]) > np.abs(most)
    assert is_fast.any()
    assert not is_fast.all()
    wanted = asked.copy()
    wanted[3:][is_fast] = most[is_fast]
    # what pushes the joints changes with their rates, too: a term of second order in the period
    assert_allclose(got, wanted, rtol=0, atol=1e-2 * np.abs(got - asked).max())
    quiet = Feedback(sample.q, 0.1 * sample.qd, sample.omega_WB_B, np.zeros(3))
    assert_allclose(barrier.hold(MS, quiet, 0.1 * u, unlimited, MS), 0.1 * u, rtol=0, atol=0)


def test_barrier_learns_what_its_model_does_not_know(fast):
    robot, _, sample = fast
    barrier, period = (
        MotionBarrier(robot.with_inertial_parameters(1.5 * robot.inertial_parameters)),
        0.01,
    )
    u, unlimited = np.array([0.0, 0.0, 0.0, 5.0, -3.0, 1.0, 2.0]), np.full(7, np.inf)
    rates = []
    for k in range(30):
        held = barrier.hold(10 * k * MS, sample, u, unlimited, 10 * MS)
        end = after(robot, sample, held, period)
        rates.append(end[3:])
        sample = Feedback(sample.q, end[3:], end[:3], np.zeros(3))
    assert_allclose(np.max(np.abs(rates[-5:]), axis=(0, 1)), 2.0, rtol=1e-3)


def test_a_wrong_rate_does_not_count_as_what_pushes_a_joint(fast):
    robot, barrier, sample = fast
    u, limits = np.zeros(7), np.concatenate([np.full(3, np.inf), robot.effort_limits])
    q = np.array([1.5, 2.4, 0.8, 2.4])
    slower = sample.qd * [1.0, 1.0, 1.0, 0.1]  # the last joint alone could be pushed so hard
    for k, factor in enumerate((0.5, -0.5)):  # by 200 rad/s^2, where half the torque gives 5 to 20
        state = Feedback(q, factor * slower, sample.omega_WB_B, np.zeros(3))
        held = barrier.hold(10 * k * MS, state, u, limits, 10 * MS)
        assert_allclose(held, u, rtol=0, atol=0)


def test_what_leads_nowhere_is_not_commanded(fast):
    _, barrier, sample = fast
    u, unlimited = np.full(7, 1e300), np.full(7, np.inf)
    with np.errstate(all='ignore'):
        assert not barrier.hold(0, sample, u, unlimited, 10 * MS).any()


@pytest.fixture
def loop():
    file = load_robot_file('config/servicer.yaml')
    return ControlLoop(file.robot, file.settings)


def answers(loop, first, count, qd):
    """Answers to samples in which the joints move with rates qd (3,)."""
    for k in range(first, first + count):
        loop.add_rate(10 * k * MS, np.zeros(3))
        yield loop.add_joints(10 * k * MS, 0.01 * k * qd, qd)


def test_joints_that_are_too_fast_are_braked_until_they_are_not(loop):
    limit = loop.robot.velocity_limits[1]
    unit = np.array([0.0, 1.0, 0.0])
    list(answers(loop, 0, 30, 0.5 * limit * unit))
    command = list(answers(loop, 30, 30, 1.2 * limit * unit))[-1]
    assert command.mode == 'damping'
    assert command.reason == 'joint_2 is faster than its limit'
    assert list(answers(loop, 60, 20, 1.05 * limit * unit))[-1].mode == 'damping'
    assert list(answers(loop, 80, 20, 0.9 * limit * unit))[-1].mode != 'damping'


def test_a_torque_that_rests_on_samples_of_long_ago_fades(loop):
    qd = np.array([0.3, -0.2, 0.4])
    list(answers(loop, 0, 60, qd))
    torques = []
    for k in range(60, 300):  # encoders that stand still while the rates go on
        loop.add_rate(10 * k * MS, np.zeros(3))
        command = loop.add_joints(10 * k * MS, 0.6 * qd, qd)
        if command.reason == 'joint states contradict each other':
            torques.append(np.abs(command.tau).max())
    assert torques[0] > 1.0
    # a second later, five time constants of the damping
    assert max(torques[105:]) == 0.0


@pytest.mark.parametrize(
    ('reference', 'start', 'words'),
    [
        # a quintic is 1.875 times as fast as its mean: 1.875 * (3 - 0.5) / 2
        ({'kind': 'set_point', 'set_point': (0.0, 3.0, 0.0), 'duration': 2.0}, 0.5,
         'joint_2 would move at 2.34375 rad/s, its limit is 2 rad/s'),
        ({'kind': 'set_point', 'set_point': (0.0, 3.0, 0.0), 'duration': 4.0}, 0.5, ''),
        ({'kind': 'step', 'set_point': (0.0, 0.0, -2.0)}, 0.0,
         'joint_3 would move to -2 rad, its range is -1 to 2.5 rad'),
        ({'kind': 'harmonic', 'amplitude': (0.1, 0.0, 1.0), 'duration': 9.0}, 1.6,
         'joint_3 would move to 2.6 rad, its range is -1 to 2.5 rad'),
        ({'kind': 'harmonic', 'amplitude': (0.1, 0.0, 1.0), 'duration': 9.0}, 1.0, ''),
        # at a quarter of the time b, less 3 pi / 16 b of the quintic that starts and ends at rest
        ({'kind': 'fourier', 'harmonics': 1, 'sine': (0.0,) * 3, 'cosine': (6.0, 0.0, 0.0)}, 0.0,
         'joint_1 would move at '),
        ({'kind': 'hold'}, 0.0, ''),
    ],
)  # fmt: skip
def test_a_motion_of_the_robot_file_beyond_the_limits_is_told(reference, start, words):
    file = load_robot_file('config/servicer.yaml')
    limits = np.array([[-np.inf, np.inf], [-np.inf, np.inf], [-1.0, 2.5]])
    robot, settings = replace(file.robot, position_limits=limits), file.settings
    loop = ControlLoop(
        robot,
        replace(
            settings,
            reference=replace(settings.reference, **reference),
            initial=replace(settings.initial, joint_position=(start,) * 3),
        ),
    )
    assert words in loop.reference_warning
    assert bool(words) == bool(loop.reference_warning)


def test_a_motion_is_judged_from_where_the_joints_are(loop):
    file = load_robot_file('config/servicer.yaml')
    reference = {'kind': 'set_point', 'set_point': (0.0, 3.0, 0.0), 'duration': 3.0}
    settings = replace(file.settings, reference=replace(file.settings.reference, **reference))
    loop = ControlLoop(file.robot, settings)
    assert loop.reference_warning == ''
    loop.add_rate(0, np.zeros(3))
    loop.add_joints(0, np.array([0.0, -3.0, 0.0]), np.zeros(3))
    assert 'joint_2 would move at 3.75 rad/s' in loop.reference_warning
