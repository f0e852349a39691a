"""Thrusters under their commands: simulated, and diagnosed one by one."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.flight.monitor import Monitor
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.errors import ConfigurationError, MessageRejectedError, RecordingError
from spacerobot_ros.recording.read import read_record
from spacerobot_ros.recording.record import AttitudeSeries, RateSeries, Record
from spacerobot_ros.recording.robot_inputs import in_robot_order, with_inputs
from spacerobot_ros.recording.series import InputSeries
from spacerobot_ros.simulation.closed_loop import ClosedLoop, record_run
from test.support.lone_body import box_file

INERTIA = np.diag([0.30, 0.34, 0.40])
COM = np.array([0.01, -0.02, 0.005])
THRUSTERS = {
    'T1': {'at': [0.15, 0.06, 0.0], 'direction': [-2.0, 0.0, 0.0], 'force': 0.4},
    'T2': {'at': [0.15, -0.06, 0.0], 'direction': [-1.0, 0.0, 0.0], 'force': 0.4},
    'T3': {'at': [0.0, 0.1, 0.15], 'direction': [0.0, 0.0, -1.0], 'force': 0.3},
    'T4': {'at': [0.1, 0.0, 0.05], 'direction': [0.0, 1.0, 0.0], 'force': 0.3},
}
NAMES = tuple(THRUSTERS)
PERIOD, HIT = 0.1, 0.2  # s
RIVALS = ('thruster_gain', 'command_delay', 'gyro_bias', 'inertial_parameters',
          'external_torque_body')  # fmt: skip


@pytest.fixture(scope='module')
def box(tmp_path_factory):
    robot = {'thrusters': THRUSTERS}
    return box_file(tmp_path_factory.mktemp('box'), com=' '.join(map(str, COM)), robot=robot)


def torque_of(shares):
    """About the centre of mass, of thrusters on the box."""
    total = np.zeros(3)
    for share, thruster in zip(shares, THRUSTERS.values(), strict=True):
        direction = np.array(thruster['direction']) / np.linalg.norm(thruster['direction'])
        arm = np.array(thruster['at']) - COM
        total += share * np.cross(arm, thruster['force'] * direction)
    return total


def flown(rng, gains=(1.0,) * 4, late=0.0, duration=10.0, hit=None):
    """Euler's equations under held commands, by SciPy from switch to switch.

    A hit of 0.2 s has a start [s] and an impulse along inertial axes [N m s].
    """
    commands = (rng.random((round(duration / PERIOD), 4)) < 0.2).astype(float)
    starts = PERIOD * np.arange(len(commands))
    gyro, tracker = np.arange(0.0, duration, 0.02), np.arange(0.0, duration, 0.1)
    switches = [[0.0, duration], starts + late, [hit[0], hit[0] + HIT] if hit else []]
    edges = np.unique(np.concatenate(switches).clip(0.0, duration))
    times, states = [], []
    x = np.array([0.0, 0.0, 0.0, 1.0, 0.05, -0.02, 0.03])
    for start, end in itertools.pairwise(edges):
        k = int(np.searchsorted(starts + late, start + 1e-9)) - 1
        torque = torque_of(np.array(gains) * commands[k]) if k >= 0 else np.zeros(3)

        def rate(t, x, torque=torque):
            q, w = x[:4], x[4:]
            turn = 0.5 * np.append(q[3] * w + np.cross(q[:3], w), -q[:3] @ w)
            if hit and hit[0] < t < hit[0] + HIT:
                bell = np.sin(np.pi * (t - hit[0]) / HIT) ** 2 / (0.5 * HIT)
                torque = torque + Rotation.from_quat(q).inv().apply(bell * np.array(hit[1]))
            return np.append(turn, np.linalg.solve(INERTIA, torque - np.cross(w, INERTIA @ w)))

        inside = np.unique(np.concatenate([gyro, tracker]))
        inside = inside[(inside >= start) & (inside < end)]
        run = solve_ivp(rate, (start, end), x, rtol=1e-10, atol=1e-12, t_eval=[*inside, end])
        times.append(inside)
        states.append(run.y.T[:-1])
        x = run.y[:, -1]
    times, states = np.concatenate(times), np.concatenate(states)
    at_gyro, at_tracker = (np.searchsorted(times, t - 1e-9) for t in (gyro, tracker))
    attitude = Rotation.from_quat(states[at_tracker, :4])
    attitude = attitude * Rotation.from_rotvec(1e-4 * rng.standard_normal((len(tracker), 3)))
    omega = states[at_gyro, 4:] + 1e-4 * rng.standard_normal((len(gyro), 3))
    record = Record(
        rates=RateSeries(np.round(gyro * 1e9).astype(int), omega),
        attitudes=AttitudeSeries(np.round(tracker * 1e9).astype(int), attitude.as_quat()),
        inputs={'thrusters': InputSeries(NAMES, np.round(starts * 1e9).astype(int), commands)},
        source='made',
    )
    return record


def test_a_right_model_under_commands_is_consistent(box, rng):
    found = diagnose(in_robot_order(flown(rng, duration=6.0), box.robot), box.robot)

    assert found.verdict == 'consistent', found.sentence


def test_dead_and_weak_thrusters_and_the_delay_are_named(box, rng):
    flight = flown(rng, gains=(1.0, 0.0, 0.8, 1.0), late=0.073, duration=6.0)
    kinds = [CATALOGUE[name] for name in RIVALS]

    found = diagnose(in_robot_order(flight, box.robot), box.robot, catalogue=kinds)

    assert found.verdict == 'explained', found.sentence
    causes = {(c.applied.id, c.applied.where): c.parameters for c in found.causes}
    assert set(causes) == {
        ('thruster_gain', 'T2'), ('thruster_gain', 'T3'), ('command_delay', None)
    }  # fmt: skip
    for key, name, true in (
        (('thruster_gain', 'T2'), 'gain', 0.0),
        (('thruster_gain', 'T3'), 'gain', 0.8),
        (('command_delay', None), 'delay', 0.073),
    ):
        assert abs(causes[key][name].value - true) < 4.0 * causes[key][name].std
        assert causes[key][name].std < 0.01


WRONG = {
    'nothing': ({}, {}),
    'weak': ({'gains': (1.0, 1.0, 0.8, 1.0)}, {('thruster_gain', 'T3'): 0.8}),
    'dead and late': (
        {'gains': (1.0, 0.0, 1.0, 1.0), 'late': 0.073},
        {('thruster_gain', 'T2'): 0.0, ('command_delay', None): 0.073},
    ),
}


@pytest.mark.parametrize('size', [0.0014, 0.027])
@pytest.mark.parametrize(('faults', 'true'), WRONG.values(), ids=WRONG)
def test_a_hit_hides_no_thruster_and_none_hides_it(box, rng, size, faults, true):
    """46 and 900 deviations of the gyro: no fifth of the record agreed with the others."""
    impulse = size * np.array([-0.3, -0.9, 0.3])
    flight = flown(rng, duration=8.0, hit=(4.23, impulse), **faults)
    kinds = [CATALOGUE[name] for name in RIVALS]

    found = diagnose(in_robot_order(flight, box.robot), box.robot, catalogue=kinds)

    assert found.verdict == 'explained', found.sentence
    (event,) = found.events.named
    assert abs(0.5 * (event.start + event.end) - 4.23 - 0.5 * HIT) < 0.02
    np.testing.assert_allclose([event.peak[a] for a in 'xyz'], impulse, atol=0.03 * size)
    assert {(c.applied.id, c.applied.where) for c in found.causes} == set(true)
    for cause in found.causes:
        (value,) = cause.parameters.values()
        assert abs(value.value - true[cause.applied.id, cause.applied.where]) < 4.0 * value.std


def test_the_simulator_turns_as_the_impulses_say(box, tmp_path):
    """At rest, one pulse: J w = gain * share * width * r x F about the centre of mass."""
    pulse = {'thruster': 'T3', 'start': 0.105, 'width': 0.25, 'share': 0.5}
    faults = {
        'weak': {'effect': 'thruster_gain', 'where': 'T3', 'gain': 0.7},
        'late': {'effect': 'command_delay', 'delay': 0.033},
    }
    machine = box_file(
        tmp_path, 'machine', com=' '.join(map(str, COM)), robot={'thrusters': THRUSTERS},
        initial={}, firings={'one': pulse}, effects=faults,
    )  # fmt: skip
    loop = ClosedLoop(machine.robot, machine.settings)
    for step in loop.run(50):
        state = step.state
    impulse = 0.7 * 0.5 * 0.25 * torque_of([0.0, 0.0, 1.0, 0.0])
    spin = Rotation.from_quat(state.q_WB_xyzw).apply(INERTIA @ state.omega_WB_B)
    # the body turns by 1e-2 rad while the thruster is on
    np.testing.assert_allclose(spin, impulse, atol=2e-2 * np.linalg.norm(impulse))


def test_commands_come_back_from_a_bag(box, tmp_path):
    firings = {'a': {'thruster': 'T1', 'start': 0.2, 'width': 0.3, 'period': 1.0}}
    machine = box_file(tmp_path, 'm', robot={'thrusters': THRUSTERS}, firings=firings)
    loop = ClosedLoop(machine.robot, machine.settings)
    record_run(loop, 100, tmp_path / 'bag')

    given = read_record(tmp_path / 'bag', machine.robot).inputs['thrusters']

    assert given.names == NAMES
    on = given.seconds(0)[given.column('T1') > 0.5]
    np.testing.assert_allclose([on[0], on[14], on[15]], [0.2, 0.48, 1.2], atol=1e-9)
    assert not given.values[:, 1:].any()


BAD_FILES = {
    'no force': ({'T1': {'at': [0, 0, 1], 'direction': [1, 0, 0]}}, r'T1.force: expected newtons'),
    'direction': ({'T1': {'at': [0, 0, 1], 'direction': [0, 0, 0], 'force': 1.0}}, 'no length'),
    'place': ({'T1': {'at': [0, 1], 'direction': [1, 0, 0], 'force': 1.0}}, 'three numbers'),
    'key': ({'T1': {**THRUSTERS['T1'], 'froce': 1.0}}, 'T1.froce: unknown'),
}


@pytest.mark.parametrize(('thrusters', 'message'), BAD_FILES.values(), ids=BAD_FILES.keys())
def test_bad_thrusters_are_one_line(tmp_path, thrusters, message):
    with pytest.raises(ConfigurationError, match=message):
        box_file(tmp_path, robot={'thrusters': thrusters})


def test_bad_firings_are_one_line(tmp_path):
    machine = box_file(tmp_path, robot={'thrusters': THRUSTERS},
                       firings={'a': {'thruster': 'T9', 'start': 0.0, 'width': 1.0}})  # fmt: skip
    with pytest.raises(ConfigurationError, match=r"firings.a.thruster: 'T9' is no thruster"):
        ClosedLoop(machine.robot, machine.settings)


def test_bad_commands_are_one_line(box):
    def given(names, values):
        series = InputSeries(names, np.array([0, 1]), np.array(values, dtype=float))
        return Record(inputs={'thrusters': series}, source='run.csv')

    with pytest.raises(RecordingError, match=r'lacks T2, T3, T4 and has foreign X'):
        with_inputs(box.robot, given(('T1', 'X'), [[0, 1], [1, 0]]))
    with pytest.raises(RecordingError, match=r'T3: commands are shares .* got 100 at sample 1'):
        with_inputs(box.robot, given(NAMES, [[0, 0, 0, 0], [0, 0, 100, 0]]))


def test_the_monitor_knows_the_commands(tmp_path):
    """Firings that it is told are no alarm; a thruster that does not fire is one."""
    firings = {
        'a': {'thruster': 'T1', 'start': 1.0, 'width': 0.3, 'period': 3.0},
        'b': {'thruster': 'T3', 'start': 2.0, 'width': 0.3, 'period': 4.0},
    }
    dead = {'dead': {'effect': 'thruster_gain', 'where': 'T3', 'gain': 0.0}}
    levels = {}
    for name, effects in (('right', {}), ('dead', dead)):
        machine = box_file(
            tmp_path, name, robot={'thrusters': THRUSTERS}, firings=firings, effects=effects
        )
        belief = box_file(tmp_path, 'belief', robot={'thrusters': THRUSTERS})
        monitor = Monitor(belief.robot, belief.settings.monitor, ())
        loop = ClosedLoop(machine.robot, machine.settings)
        for k, step in enumerate(loop.run(600)):
            monitor.add_commands(step.stamp_ns, loop.firings.commands(k))
            step.feed(monitor)
            monitor.step()
        levels[name] = monitor.state.level
    assert levels == {'right': 'ok', 'dead': 'error'}
    with pytest.raises(MessageRejectedError, match='shares from 0 to 1'):
        monitor.add_commands(10**12, np.array([0.0, 2.0, 0.0, 0.0]))
