"""No joint turns faster than its URDF says, whatever reference within the limits is followed."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.free_flying import file_with, free_flying_parameters

from spacerobot_ros.control.command import Feedback
from spacerobot_ros.control.joint_reference import Setpoint, rest
from spacerobot_ros.control.laws import ComputedTorque, robot_model
from spacerobot_ros.control.loop import ControlLoop
from spacerobot_ros.control.waypoints import Waypoints
from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.simulation.closed_loop import ClosedLoop

PERIOD, MS = 0.05, 1_000_000
FAST = 1.875 / 0.97  # peak rate of a quintic from rest to rest over its mean, at 97 % of the limit


def quick_motion(law, seed, is_wrong):
    """A loop that follows quick moves anywhere in the joints' ranges, and the largest rates."""
    rng = np.random.default_rng([77, seed])
    parameters = free_flying_parameters(law, PERIOD, simulator__noise=True)
    for name in ('amplitude', 'attitude_amplitude', 'duration'):
        del parameters[f'reference.{name}']
    parameters['reference.kind'] = 'hold'
    if not is_wrong:
        del parameters['truth.links'], parameters['truth.inertial_parameters']
    file = file_with(parameters)
    loop, limits = ClosedLoop(file.robot, file.settings), file.robot.velocity_limits
    low, high = file.robot.position_limits.T
    here, times, points = loop.plant.state.q, [0.0], []
    for _ in range(6):
        points.append(low + (high - low) * rng.uniform(0.02, 0.98, len(low)))
        times.append(times[-1] + FAST * np.max(np.abs(points[-1] - here) / limits))
        here = points[-1]
    still = np.zeros((6, len(low)))
    for k, step in enumerate(loop.run(round(times[-1] / PERIOD))):
        if k == 2:
            start = rest(step.measured.joints.position)
            motion = Waypoints(np.array(times[1:]), np.array(points), still, still, start)
            loop.controller.set_reference(motion)
        yield loop, np.max(np.abs(step.state.qd) / limits)


@pytest.mark.parametrize(
    ('law', 'seed', 'is_wrong'),
    [('passivity', 4, True), ('adaptive_lyapunov', 4, False), ('adaptive_rls', 9, False)],
)
def test_quick_references_within_the_limits_are_followed_within_them(law, seed, is_wrong):
    loops, rates = zip(*quick_motion(law, seed, is_wrong), strict=True)
    # torques held for 50 ms, or beliefs wrong by a quarter, let a joint pass its limit a little
    assert max(rates) < 1.1
    # no sensor is wrong; where it is taken for that too often, the law swings with what stands in
    assert sum(loops[-1].controller.screen.left_out.values()) < 0.02 * 3 * len(rates)


def test_computed_torque_does_not_drive_a_joint_beyond_its_rate(rng):
    robot = load_robot_file('config/servicer.yaml').robot
    law = ComputedTorque(robot_model(robot), 3.0, np.full(3, np.inf), rates=np.full(3, 2.0))
    q, omega, zeros = rng.normal(size=3), 0.1 * rng.normal(size=3), np.zeros(3)
    qd, ahead = np.array([1.9, -2.1, 0.5]), np.array([2.0, -2.0, 0.1])

    class Ahead:
        def at(self, t):
            return Setpoint(q + ahead, qd, zeros)

    tau = law.track(Ahead(), 0.0, Feedback(q, qd, omega, zeros), period=PERIOD).tau
    state = State(zeros, np.array([0.0, 0.0, 0.0, 1.0]), q, zeros, omega, qd)
    got = Dynamics(robot).rate(state.to_vector(), tau)[-3:]
    # half of what is left to the limit, or beyond it, in a period; 9 x 0.1 rad otherwise
    assert_allclose(got, [0.05 / PERIOD, 0.05 / PERIOD, 0.9], rtol=1e-9, atol=1e-11)


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
