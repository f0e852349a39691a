"""The control loop: stale inputs, recovery, estimates, references that change."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.states import hold_step

from spacerobot_ros.control.command import RateHistory
from spacerobot_ros.control.joint_reference import PointToPoint
from spacerobot_ros.control.loop import ControlLoop
from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State, initial_state
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import ConfigurationError, MessageRejectedError
from spacerobot_ros.estimation.unknowns.minimal import minimal_set
from spacerobot_ros.identification.estimate import Estimate
from spacerobot_ros.simulation.truth import true_robot

MS = 1_000_000


@pytest.fixture(scope='module')
def file():
    return load_robot_file('config/servicer.yaml')


@pytest.fixture(scope='module')
def truth(file):
    return true_robot(file.robot, file.settings)


@pytest.fixture
def loop(file, truth):
    return ControlLoop(truth, file.settings)


class Machine:
    """The true plant under a control loop, noise-free, at 100 Hz."""

    def __init__(self, file, truth, loop):
        self.dynamics, self.loop, self.k = Dynamics(truth), loop, 0
        self.x = initial_state(truth, file.settings.initial).to_vector()
        self.commands = []

    @property
    def state(self):
        return State.from_vector(self.x)

    def run(self, steps, gyro=True, joints=True):
        for _ in range(steps):
            s, ns = self.state, self.k * 10 * MS
            if gyro:
                self.loop.add_rate(ns, s.omega_WB_B.copy())
            if joints:
                command = self.loop.add_joints(ns, s.q.copy(), s.qd.copy())
            else:
                command = self.loop.blind(ns - self.loop.joints_ns) or self.commands[-1]
            self.commands.append(command)
            self.x = hold_step(self.dynamics, self.x, command.tau, 0.01, 2)
            self.k += 1
        return self.commands[-steps:]


def test_damps_when_the_gyro_stops_and_joins_again(file, truth, loop):
    machine = Machine(file, truth, loop)
    machine.run(300)
    lost = machine.run(500, gyro=False)
    modes = [c.mode for c in lost]
    # the age passes state_timeout (0.1 s) at the eleventh sample after the last one
    assert modes[:10] == ['tracking'] * 10
    assert set(modes[11:]) == {'damping'}
    assert lost[-1].reason == 'gyro is stale'
    # from 0.8 rad/s; what is left is what the wheels do beyond the gyro's last value
    assert np.abs(machine.state.qd).max() < 0.2
    back = machine.run(800)
    assert {c.mode for c in back} == {'tracking'}
    assert np.degrees(np.abs([c.error for c in back]).max()) < 0.05
    assert np.abs([c.tau for c in machine.commands]).max() < 5000.0  # no jump anywhere


def test_damps_blindly_when_the_joint_states_stop_and_lets_the_torque_fade(file, truth):
    """Braking of 1/s, which lasts 5 s, against the wheels."""
    slowly = replace(file.settings.controller, damping=1.0)
    loop = ControlLoop(truth, replace(file.settings, controller=slowly))
    machine = Machine(file, truth, loop)
    machine.run(300)
    before = np.abs(machine.state.qd).max()
    blind = machine.run(400, joints=False)
    assert blind[-1].mode == 'damping'
    assert blind[-1].reason == 'joint states are stale'
    assert np.abs(machine.state.qd).max() < 0.2 * before
    late = loop.blind(100_000 * MS)
    assert np.abs(late.tau).max() < 0.01  # 30 N m at first, faded at 0.1/s
    assert {c.mode for c in machine.run(800)} == {'tracking'}
    assert np.degrees(np.abs(machine.commands[-1].error).max()) < 0.05


def test_a_second_after_the_joint_states_stop_nothing_is_commanded(file, truth, loop):
    machine = Machine(file, truth, loop)
    machine.run(300)
    blind = np.abs([c.tau for c in machine.run(111, joints=False)])
    assert blind.max() < 5000.0
    assert blind[100].any()
    assert not blind[-1].any()
    assert {c.mode for c in machine.run(800)} == {'tracking'}
    assert np.degrees(np.abs(machine.commands[-1].error).max()) < 0.05


def test_fresh_joints_are_not_blind(loop):
    assert loop.blind(10**9) is None  # nothing seen yet
    loop.add_rate(0, np.zeros(3))
    loop.add_joints(0, np.zeros(3), np.zeros(3))
    assert loop.blind(100 * MS) is None
    assert loop.blind(101 * MS) is not None


def test_without_any_gyro_it_damps(loop):
    command = loop.add_joints(0, np.zeros(3), np.ones(3))
    assert (command.mode, command.reason) == ('damping', 'no gyro sample yet')


@pytest.mark.parametrize(('second', 'reason'), [(5, 'duplicate'), (4, 'backwards')])
def test_stamps_must_increase(loop, second, reason):
    loop.add_rate(5, np.zeros(3))
    loop.add_joints(5, np.zeros(3), np.zeros(3))
    with pytest.raises(MessageRejectedError, match=reason):
        loop.add_rate(second, np.zeros(3))
    with pytest.raises(MessageRejectedError, match=reason):
        loop.add_joints(second, np.zeros(3), np.zeros(3))


def test_a_new_reference_is_joined_without_a_step(file, truth, loop):
    machine = Machine(file, truth, loop)
    machine.run(300)
    goal = np.array([0.1, 0.2, 0.3])
    loop.set_reference(PointToPoint(np.zeros(3), goal, 3.0))
    commands = machine.run(900)
    assert np.degrees(np.abs([c.error for c in commands]).max()) < 0.05
    assert commands[-1].mode == 'hold'
    assert_allclose(machine.state.q, goal, atol=1e-3)


def estimate_of(robot, truth, **changes):
    minimal = minimal_set(robot, 'symmetric')
    parameters = minimal.of_robot(truth)
    size = 3 + len(parameters)
    estimate = Estimate(
        method='ml', valid=True, reason='', aam_links=('link_3',), aam=truth.target_momentum,
        parameter_names=minimal.names, parameters=parameters, covariance=np.eye(size), rank=size,
        unknowns=size, condition=1.0, unexcited=(), total_momentum=np.zeros(3),
        total_momentum_covariance=np.eye(3), chi2_per_dof=1.0, samples=1, stamp_ns=0,
    )  # fmt: skip
    return replace(estimate, **changes)


def test_an_estimate_replaces_the_model(file, truth):
    machine = Machine(file, truth, ControlLoop(file.robot, file.settings))
    machine.loop.set_estimate(estimate_of(file.robot, truth))
    commands = machine.run(600)
    assert all(c.uses_estimate for c in commands)
    assert np.degrees(np.abs([c.error for c in commands]).max()) < 0.01


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'valid': False, 'reason': 'too early'}, 'not valid: too early'),
        ({'aam': np.array([np.nan, 0.0, 0.0])}, 'not finite'),
        ({'covariance': -np.eye(22)}, 'negative variance'),
        ({'aam_links': ('link_2',)}, 'link_2'),
        ({'parameter_names': ('x',) * 19}, 'parameters'),
        ({'parameters': np.full(19, -1.0)}, 'positive'),
    ],
)
def test_unusable_estimates_are_rejected(file, truth, changes, reason):
    loop = ControlLoop(file.robot, file.settings)
    with pytest.raises(MessageRejectedError, match=reason):
        loop.set_estimate(estimate_of(file.robot, truth, **changes))
    assert loop.estimate is None


def test_settings_are_checked_at_the_start(file):
    wrong = replace(file.settings, reference=replace(file.settings.reference, sine=(1.0,)))
    with pytest.raises(ConfigurationError, match=r'reference\.sine'):
        ControlLoop(file.robot, wrong)


def test_rate_history_extrapolates_with_the_slope():
    history = RateHistory(1.0)
    for k in range(5):
        history.add(k * 10 * MS, np.array([1.0, 2.0, 3.0]) * k * 0.01)
    omega, slope = history.at(45 * MS, 10 * MS)
    assert_allclose(slope, [1.0, 2.0, 3.0], rtol=1e-12)
    assert_allclose(omega, np.array([1.0, 2.0, 3.0]) * 0.045, rtol=1e-12)
    omega, _ = history.at(20 * MS, 10 * MS)  # later samples are there, and not used
    assert_allclose(omega, np.array([1.0, 2.0, 3.0]) * 0.02, rtol=1e-12)


@pytest.mark.parametrize('place', ['position', 'velocity'])
def test_numbers_that_no_joint_has_are_refused_from_the_first_sample_on(loop, place):
    odd, zero = np.array([0.0, 1e307, 0.0]), np.zeros(3)
    sample = (odd, zero) if place == 'position' else (zero, odd)
    with pytest.raises(MessageRejectedError, match='none that a joint has'):
        loop.add_joints(0, *sample)
    loop.add_rate(0, zero)
    assert np.all(np.isfinite(loop.add_joints(0, zero, zero).tau))
