"""Base attitude and joints in the control loop, without ROS: tracking, limits, lost sensors."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from rosbags.highlevel import AnyReader
from support.attitudes import angle_between
from support.free_flying import core_errors, errors, file_with, free_flying_parameters, rms_degrees

from spacerobot_ros.control.loop import ControlLoop
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.recording.bags.message_types import typestore
from spacerobot_ros.simulation.closed_loop import ClosedLoop, record_run

LAWS = (
    'passivity',
    'adaptive_rls',
    'adaptive_lyapunov',
    'adaptive_composite',
    'adaptive_rls_paper',
    'adaptive_lyapunov_paper',
)


def run(loop, steps):
    start = loop.plant.state
    out = list(loop.run(steps - 1))
    return np.array([errors(start, s.state, s.stamp_ns * 1e-9) for s in out]), out


@pytest.mark.parametrize('law', LAWS)
def test_the_loop_tracks_as_the_law_alone(law):
    file = file_with(free_flying_parameters(law, 0.05))
    got, steps = run(ClosedLoop(file.robot, file.settings), 400)
    want = core_errors(file, 400)
    # stamps are whole nanoseconds and attitudes are normalized once more; errors are 1e-2 at first
    assert_allclose(got, want, rtol=0, atol=1e-7)
    assert {s.command.mode for s in steps} == {'tracking'}
    assert rms_degrees(got)[0] < 0.3


class Machine:
    """A control loop on its plant, with sensors that can be taken away."""

    def __init__(self, file, loop):
        self.loop, self.plant = loop, ClosedLoop(file.robot, file.settings).plant

    def run(self, steps, without=None):
        commands = []
        for _ in range(steps):
            ns, s = self.plant.time_ns, self.plant.state
            if without != 'gyro':
                self.loop.add_rate(ns, s.omega_WB_B)
            if without != 'attitude':
                self.loop.add_attitude(ns, s.q_WB_xyzw)
            commands.append(self.loop.add_joints(ns, s.q, s.qd))
            wrench = np.concatenate([np.zeros(3), commands[-1].base])
            self.plant.step(commands[-1].tau, wrench)
        return commands


def test_a_set_point_is_reached_and_held():
    goal = np.array([0.05, -0.1, 0.08, np.sqrt(1.0 - 0.05**2 - 0.1**2 - 0.08**2)])
    parameters = free_flying_parameters(
        'adaptive_composite',
        0.05,
        reference__kind='set_point',
        reference__duration=5.0,
        reference__set_point=[1.6, 0.9, 0.7, 0.2],
        reference__attitude_xyzw=(-goal).tolist(),  # the same attitude: it must not unwind
    )
    file = file_with(parameters)
    loop = ClosedLoop(file.robot, file.settings)
    steps = list(loop.run(300))
    last = steps[-1]
    assert last.command.mode == 'hold'
    assert angle_between(goal, last.state.q_WB_xyzw) < 1e-4
    assert_allclose(last.state.q, [1.6, 0.9, 0.7, 0.2], rtol=0, atol=1e-4)
    turned = [angle_between(steps[0].state.q_WB_xyzw, s.state.q_WB_xyzw) for s in steps]
    assert max(turned) < 1.05 * turned[-1]


@pytest.mark.parametrize('name', ['torque_limit', 'base_torque_limit'])
def test_limits_pause_the_adaptation(name):
    limit = [0.02] * (4 if name == 'torque_limit' else 3)
    file = file_with(
        free_flying_parameters('adaptive_composite', 0.05, **{f'controller__{name}': limit})
    )
    loop = ClosedLoop(file.robot, file.settings)
    before, was_cut, cut = None, False, 0
    for step in loop.run(60):
        law = loop.controller.adaptive
        values = law.parameters.values
        if was_cut:
            assert law.health.reason == 'a torque limit was reached'
            assert np.array_equal(values, before)  # nothing winds up meanwhile
            cut += 1
        before = values
        command = step.command
        was_cut = bool(command.saturated.any() or command.base_saturated)
        limited = command.tau if name == 'torque_limit' else command.base
        assert np.abs(limited).max() <= 0.02
    assert cut > 10


@pytest.mark.parametrize(('lost', 'reason'), [('gyro', 'gyro'), ('attitude', 'attitude')])
def test_a_lost_sensor_frees_the_base_and_damps_the_joints(lost, reason):
    file = file_with(
        free_flying_parameters('adaptive_composite', 0.05, controller__attitude_timeout=0.3)
    )
    loop = ControlLoop(file.robot, file.settings)
    machine = Machine(file, loop)
    machine.run(100)
    known = loop.adaptive.parameters.values
    commands = machine.run(60, without=lost)
    assert commands[0].mode == 'tracking'  # young enough still
    damped = [c for c in commands if c.mode == 'damping']
    assert len(damped) > 50
    assert damped[-1].reason == f'{reason} is stale'
    assert not any(c.base.any() for c in damped)
    assert np.abs(machine.plant.state.qd).max() < 0.01  # of 0.05 rad/s
    adapted = loop.adaptive.parameters.values
    back = machine.run(400)
    assert {c.mode for c in back} == {'tracking'}
    assert np.linalg.norm(back[-1].attitude_error) < 1e-3
    assert np.abs(back[-1].error).max() < 1e-3
    # what happened meanwhile has not been learnt: no jump, but it goes on from where it was
    assert np.abs(adapted - known).max() < 0.5
    jumps = [np.abs(np.subtract(a.base, b.base)).max() for a, b in pairwise(back)]
    assert max(jumps) < 2.0


def test_joint_states_that_stop_free_the_base():
    file = file_with(free_flying_parameters('adaptive_composite', 0.05))
    loop = ControlLoop(file.robot, file.settings)
    Machine(file, loop).run(20)
    command = loop.blind(10**9)
    assert (command.mode, command.reason) == ('damping', 'joint states are stale')
    assert not command.base.any()


def test_without_an_attitude_it_damps():
    file = file_with(free_flying_parameters('adaptive_composite', 0.05))
    loop = ControlLoop(file.robot, file.settings)
    loop.add_rate(0, np.zeros(3))
    command = loop.add_joints(0, np.ones(4), np.zeros(4))
    assert (command.mode, command.reason) == ('damping', 'no attitude yet')


def test_the_attitude_is_carried_on_with_the_gyro():
    fast = free_flying_parameters('passivity', 0.05)
    slow = fast | {'simulator.attitude_rate': 2.0}
    worst = []
    for parameters in (fast, slow):
        file = file_with(parameters)
        got, _ = run(ClosedLoop(file.robot, file.settings), 200)
        worst.append(got)
    # trapezoidal rates at 20 Hz over half a second
    assert_allclose(worst[1], worst[0], rtol=0, atol=2e-5)


@pytest.mark.parametrize(
    ('change', 'match'),
    [
        ({'adaptive__kappa': 40.0}, r'adaptive\.kappa.*period'),
        ({'controller__base_torque_limit': [1.0]}, r'base_torque_limit: expected 3'),
        ({'controller__torque_limit': [1.0]}, r'torque_limit: expected 4'),
        ({'controller__state_timeout': 0.01}, r'state_timeout.*joint_rate'),
        ({'reference__attitude_amplitude': [1.0]}, r'attitude_amplitude: expected 3'),
        ({'reference__amplitude': [1.0]}, r'reference\.amplitude: expected 4'),
        ({'reference__attitude_xyzw': [0.0, 0.0, 0.0, 2.0]}, r'attitude_xyzw: has norm 2'),
    ],
)
def test_settings_that_do_not_fit_are_refused(change, match):
    file = file_with(free_flying_parameters('adaptive_composite', 0.05, **change))
    with pytest.raises(ConfigurationError, match=match):
        ControlLoop(file.robot, file.settings)


def test_fast_bandwidths_only_warn_where_asked():
    change = {'adaptive__kappa': 40.0, 'adaptive__sampling_check': 'warn'}
    file = file_with(free_flying_parameters('adaptive_composite', 0.05, **change))
    assert 'kappa' in ControlLoop(file.robot, file.settings).adaptive.health.sampling_warning


def test_a_fixed_base_is_refused():
    file = file_with(free_flying_parameters('adaptive_composite', 0.05))
    with pytest.raises(ConfigurationError, match=r'robot\.base'):
        ControlLoop(replace(file.robot, is_free=False), file.settings)


def test_a_recorded_run_holds_the_torque_on_the_base(tmp_path):
    file = file_with(free_flying_parameters('adaptive_composite', 0.05))
    summary = record_run(ClosedLoop(file.robot, file.settings), 20, tmp_path / 'run')
    assert summary.max_attitude_error > 0.0
    assert summary.momentum_drift < 1e-12  # the impulse of the torques is accounted for
    with AnyReader([tmp_path / 'run'], default_typestore=typestore()) as reader:
        stamps = {c.topic: [] for c in reader.connections}
        for connection, stamp, _ in reader.messages():
            stamps[connection.topic].append(stamp)
    assert stamps['/base_torque'] == stamps['/joint_commands']
    assert len(stamps['/base_torque']) == 21
