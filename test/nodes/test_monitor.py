"""Monitor node: silent in flight, raises, records, bad messages, resets."""

import dataclasses
import threading
from contextlib import suppress

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import QuaternionStamped
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger
from support.rig import Wall

from spacerobot_ros.errors import SpaceRobotError
from spacerobot_ros.nodes import event_recorder
from spacerobot_ros.nodes.monitor import MonitorNode
from spacerobot_ros.recording.bags.bag import read_bag
from spacerobot_ros.recording.bags.bag_writer import BagWriter
from spacerobot_ros.ros.convert import compose
from spacerobot_ros.ros.diagnostics import OK, STALE
from spacerobot_ros.ros.qos import LATCHED, SAMPLES, STATE
from validation.hidden.monitor_flights import Flight, in_flight

pytestmark = pytest.mark.ros

NAMES = ['joint_1', 'joint_2', 'joint_3']
MS = 1_000_000


@pytest.fixture(scope='module')
def nominal():
    """Return 10 s without a fault."""
    return list(Flight(seed=4).samples(10.0))


class Bench:
    """A monitor with a probe that plays the sensors."""

    def __init__(self, rig, parameters, **more):
        self.rig, self.probe = rig, rig.plain()
        self.diagnostics = rig.listen(self.probe, DiagnosticArray, '/diagnostics', STATE)
        topics = {'/imu/data': Imu, '/attitude': QuaternionStamped, '/joint_states': JointState}
        self.publishers = {
            topic: self.probe.create_publisher(kind, topic, SAMPLES)
            for topic, kind in topics.items()
        }
        more = {'monitor.learn': 4.0, **more}
        self.node = rig.add(MonitorNode, parameters, **more)
        self.node.wall_ns = Wall().ns

    def send(self, topic, message):
        self.publishers[topic].publish(message)

    def joint(self, ns, q=(0.0, 0.0, 0.0), qd=(0.0, 0.0, 0.0), effort=(), names=NAMES):
        message = compose.joint_state(ns, list(names), np.array(q), np.array(qd))
        message.effort = [float(x) for x in effort]
        self.send('/joint_states', message)

    def play(self, samples):
        for k, s in enumerate(samples):
            said = s.measured
            if said.omega is not None:
                self.send('/imu/data', compose.imu(s.stamp_ns, 'base_link', said.omega, None))
            if said.attitude_xyzw is not None:
                self.send('/attitude', compose.quaternion(s.stamp_ns, said.attitude_xyzw))
            if said.joints is not None:
                j = said.joints
                self.joint(s.stamp_ns, j.position, j.velocity, j.effort)
            if k % 50 == 49:  # less than the queues hold
                self.rig.deliver()
        self.rig.deliver()

    def status(self, name):
        return next(s for s in self.node.health.statuses() if s.name == name)


@pytest.fixture
def parameters(servicer):
    """Return the servicer's parameters."""
    return servicer


def test_says_that_all_is_well(rig, parameters, nominal):
    bench = Bench(rig, parameters)
    assert bench.status('model').message == 'nothing received yet'
    bench.play(nominal[:300])
    assert bench.status('model').message.startswith('learning')
    bench.play(nominal[300:700])
    assert bench.status('model').message == 'the model explains the data'
    assert bench.status('inputs').message == 'all sensors arrive'
    channel = bench.status('gyro x')
    assert channel.message == 'as the model says'
    assert 0.8 < channel.values['rms over noise floor'] < 1.2
    assert 'whiteness p' in channel.values
    assert 'unexplained [N m]' in bench.status('joint_2 torque').values


def test_raises_at_once_and_records_around_it(rig, parameters, nominal, tmp_path):
    change = in_flight('gyro_bias', 2e-4, Flight()).changed
    bench = Bench(
        rig, parameters,
        **{'monitor.record_folder': str(tmp_path / 'events'), 'monitor.pre_trigger': 2.0,
           'monitor.post_trigger': 1.0},
    )  # fmt: skip
    bench.play([change(s) if s.stamp_ns >= 6000 * MS else s for s in nominal])
    model = bench.status('model')
    assert model.message.startswith('gyro x: unexplained 0.0002 rad/s'), model.message
    assert model.values['spoke first'] == 'gyro x'
    assert any(
        status.name == 'monitor: model' and status.message == model.message
        for message in bench.diagnostics
        for status in message.status
    )
    raised = bench.node.monitor.state.raised_ns
    rig.until(lambda: any((tmp_path / 'events').glob('alarm_*')))
    (folder,) = (tmp_path / 'events').iterdir()
    record = read_bag(folder, bench.node.monitor.robot)
    start, end = record.span_ns
    assert abs(start - (raised - 2000 * MS)) <= 10 * MS
    assert abs(end - (raised + 1000 * MS)) <= 110 * MS


def test_an_event_is_said_on_diagnostics_and_events(rig, parameters):
    push = {'effect': 'external_joint_torque', 'where': 'joint_2', 'start': 0.0, 'end': 0.8}
    flight = Flight(seed=4, effects={'push': {**push, 'torque': 3.0}}, onset=6.0, end=7.0)
    bench = Bench(rig, parameters)
    events = rig.listen(bench.probe, DiagnosticArray, '/events', LATCHED)
    assert bench.status('events').level == STALE
    bench.play(list(flight.samples(9.5)))
    said = [status for message in events for status in message.status]
    assert said[0].level == DiagnosticStatus.WARN
    assert said[0].message.startswith('external_joint_torque at joint_2 since ')
    assert said[-1].level == DiagnosticStatus.OK
    first = events[0].header.stamp
    assert 6.0 < first.sec + 1e-9 * first.nanosec <= 7.0
    status = bench.status('events')
    assert status.level == OK
    assert status.values['events'] == 1
    assert 'joint_2 [N m]' in status.values
    assert any(
        s.name == 'monitor: events' and s.level == DiagnosticStatus.WARN
        for message in bench.diagnostics
        for s in message.status
    )


def test_stopped_just_after_an_alarm_it_leaves_the_bag(
    rig, parameters, nominal, tmp_path, monkeypatch
):
    monkeypatch.setattr(event_recorder, 'STOP', None)  # however slow the disk is
    # the alarm comes sooner after zero than what is recorded before it
    change = in_flight('gyro_bias', 2e-4, Flight()).changed
    bench = Bench(rig, parameters, **{'monitor.record_folder': str(tmp_path / 'events')})
    killed = [tmp_path / 'events' / f'.alarm_{second}.partial' for second in (6, 7, 8)]
    for left in killed:
        left.mkdir(parents=True)  # by a run before that had come as far
    bench.joint((2**31 - 1) * 10**9)  # a stamp that no other agrees with ends no recording
    bench.play([change(s) if s.stamp_ns >= 6000 * MS else s for s in nominal[:820]])
    raised = bench.node.monitor.state.raised_ns
    assert raised is not None
    rig.executor.remove_node(bench.node)
    rig.nodes.remove(bench.node)
    bench.node.destroy_node()
    (folder,) = (tmp_path / 'events').glob('alarm_*')
    assert all(left.exists() for left in killed)
    start, end = read_bag(folder, bench.node.monitor.robot).span_ns
    assert start <= 100 * MS
    assert end >= raised


@pytest.fixture
def stuck(monkeypatch):
    """Return an event that a disk waits for, which no callback may touch before."""
    go_on, start = threading.Event(), BagWriter.__enter__

    def wait(bag):
        if not go_on.is_set():
            assert threading.current_thread() is not threading.main_thread()  # of callbacks
            go_on.wait()
        return start(bag)

    monkeypatch.setattr(BagWriter, '__enter__', wait)
    yield go_on
    go_on.set()


def test_a_slow_disk_delays_nothing_but_the_bag(rig, parameters, nominal, stuck, tmp_path):
    change = in_flight('gyro_bias', 2e-4, Flight()).changed
    events = tmp_path / 'events'
    bench = Bench(rig, parameters, **{'monitor.record_folder': str(events)})
    bench.play([change(s) if s.stamp_ns >= 6000 * MS else s for s in nominal])
    judged = bench.node.monitor.state.judged_ns
    assert bench.node.monitor.state.raised_ns < judged
    assert judged > nominal[-1].stamp_ns - 2000 * MS
    future = bench.probe.create_client(Trigger, '/monitor/reset').call_async(Trigger.Request())
    rig.until(future.done)
    assert not events.exists()
    stuck.set()
    rig.until(lambda: any(events.glob('alarm_*')))
    (folder,) = events.glob('alarm_*')
    start, end = read_bag(folder, bench.node.monitor.robot).span_ns
    assert start <= 100 * MS
    assert end == nominal[-1].stamp_ns  # what came while the disk stood, up to the reset


def test_killed_just_after_an_alarm_it_leaves_what_led_to_it(rig, parameters, nominal, tmp_path):
    change = in_flight('gyro_bias', 2e-4, Flight()).changed
    events = tmp_path / 'events'
    bench = Bench(rig, parameters, **{'monitor.record_folder': str(events)})
    bench.play([change(s) if s.stamp_ns >= 6000 * MS else s for s in nominal[:820]])
    raised = bench.node.monitor.state.raised_ns

    def left():
        """The last stamp that a kill now would leave on the disk [ns]."""
        for path in events.glob('.alarm_*.partial/*.mcap'):
            with suppress(SpaceRobotError):  # not even its first second yet
                return read_bag(path, bench.node.monitor.robot).span_ns[1]
        return 0

    rig.until(lambda: left() >= raised)
    rig.until(lambda: left() == nominal[819].stamp_ns)  # no more comes: the disk has all there was


def test_without_a_folder_nothing_is_recorded(rig, parameters):
    assert Bench(rig, parameters).node.recorder is None


@pytest.mark.parametrize(
    ('send', 'topic', 'reason'),
    [
        (lambda b: b.joint(5 * MS, names='abc'), '/joint_states',
         'joint names: lacks joint_1, joint_2, joint_3'),
        (lambda b: b.joint(5 * MS, (np.nan, 0, 0)), '/joint_states', 'position is not finite'),
        (lambda b: b.joint(5 * MS, effort=(1.0,)), '/joint_states',
         'effort has # entries for # joints'),
        (lambda b: b.send('/imu/data', compose.imu(5 * MS, 'x', np.zeros(3), None)), '/imu/data',
         "frame_id is 'x', expected 'base_link'"),
        (lambda b: [b.joint(5 * MS), b.joint(5 * MS)], '/joint_states', 'duplicate stamp'),
    ],
)  # fmt: skip
def test_bad_messages_are_counted(rig, parameters, send, topic, reason):
    bench = Bench(rig, parameters)
    send(bench)
    rig.deliver()
    assert bench.node.health.rejected[topic, reason] == 1


def shifted(samples, ns):
    return [dataclasses.replace(s, stamp_ns=s.stamp_ns + ns) for s in samples]


@pytest.mark.parametrize('jump', [-5_000_000_000, 10**15])
def test_a_clock_that_jumps_leaves_what_was_learned(rig, parameters, nominal, jump):
    bench = Bench(rig, parameters)
    bench.play(nominal[:600])
    std = bench.node.monitor.state.momentum_std
    bench.play(shifted(nominal[600:], jump))
    state = bench.node.monitor.state
    assert state.level == 'ok', state.reason
    assert state.judged_ns > nominal[700].stamp_ns + jump
    assert max(state.momentum_std) < max(std)
    assert bench.node.health.count() == 0


@pytest.mark.parametrize('jump', [-2_000_000_000, 10**15])
def test_a_clock_that_jumps_while_it_learns(rig, parameters, nominal, jump):
    bench = Bench(rig, parameters, **{'monitor.learn': 3.0})
    bench.play(nominal[:210])
    bench.play(shifted(nominal[210:], jump))
    assert bench.node.monitor.state.judged_ns > nominal[700].stamp_ns + jump


@pytest.mark.parametrize('stamp', [0, (2**31 - 1) * 10**9, 36 * 10**9])
def test_one_wrong_stamp_changes_nothing(rig, parameters, nominal, stamp):
    bench = Bench(rig, parameters, **{'use_sim_time': False})
    bench.play(shifted(nominal[:300], 5 * 10**9))
    bench.play([dataclasses.replace(nominal[300], stamp_ns=stamp)])
    bench.play(shifted(nominal[301:], 5 * 10**9))
    assert bench.status('model').message == 'the model explains the data'
    assert bench.node.monitor.state.judged_ns > 13 * 10**9
    assert bench.node.health.count() >= 2  # gyro and joints


def test_reset_on_request(rig, parameters, nominal):
    bench = Bench(rig, parameters)
    bench.play(nominal[:600])
    client = bench.probe.create_client(Trigger, '/monitor/reset')
    future = client.call_async(Trigger.Request())
    rig.until(future.done)
    assert future.result().success
    assert bench.node.monitor.state.judged_ns is None


def test_believes_a_valid_estimate(rig, parameters, nominal):
    bench = Bench(rig, parameters)
    bench.play(nominal[:550])
    monitor = bench.node.monitor
    truth = Flight(seed=4).file.settings.truth.target_momentum
    estimate = estimate_of(truth, 0.5, monitor.state.judged_ns)
    with pytest.raises(Exception, match='links'):
        monitor.believe(dataclasses.replace(estimate, aam_links=('other',)))
    monitor.believe(estimate)
    bench.play(nominal[550:])
    assert monitor.state.level == 'ok', monitor.state.reason
    np.testing.assert_allclose(monitor.state.momentum, truth, rtol=0.0, atol=0.5)
    assert max(monitor.state.momentum_std) < 0.5


def estimate_of(aam, std, stamp_ns):
    """A valid estimate of the momentum alone."""
    from spacerobot_ros.identification.estimate import Estimate

    return Estimate(
        method='online', valid=True, reason='', aam_links=('link_3',), aam=np.array(aam),
        parameter_names=(), parameters=np.zeros(0), covariance=std**2 * np.eye(3), rank=3,
        unknowns=3, condition=1.0, unexcited=(), total_momentum=np.zeros(3),
        total_momentum_covariance=np.eye(3), chi2_per_dof=1.0, samples=1, stamp_ns=stamp_ns,
    )  # fmt: skip
