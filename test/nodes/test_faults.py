"""The campaign of faults finds what ends a node; what it found stays mended."""

import contextlib
import math
import os
import select
import signal
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from spacerobot_msgs.msg import Tracking
from support.bench import MS, NAMES, Bench
from support.campaigns import missed

from spacerobot_ros.nodes.program import NODES
from spacerobot_ros.nodes.simulator import SimulatorNode
from spacerobot_ros.recording.bags.message_types import decoded, encoded
from spacerobot_ros.recording.clock_jumps import JumpDetector, Sample
from spacerobot_ros.ros import executor
from spacerobot_ros.ros.convert import compose, type_name
from spacerobot_ros.ros.session import Session
from validation.campaigns import CAMPAIGNS
from validation.faults import damage, process_faults, process_loop, wrong_streams
from validation.faults import fault_campaign as campaign
from validation.faults.message_fuzz import Patient, is_finite, spoilt
from validation.hidden.diagnosis_scenario import packaged

pytestmark = pytest.mark.ros


@pytest.fixture(scope='module', autouse=True)
def short():
    """Let a flight be 1.8 s."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(wrong_streams, '_DURATION', 1.8)
        campaign.flight.cache_clear()
        campaign.undisturbed.cache_clear()
        yield
    campaign.flight.cache_clear()
    campaign.undisturbed.cache_clear()


@pytest.mark.parametrize('node', ['controller', 'monitor', 'identifier', 'simulator'])
def test_odd_messages_end_no_node(node):
    record = campaign.odd_messages(node, 1, 200)
    assert record['raised'] == {}
    assert record['not_finite'] == {}
    assert record['rejected'] > 20  # they were odd


@pytest.mark.parametrize('node', sorted(NODES))
def test_good_messages_are_taken_all(node):
    with Session() as session:
        patient = wrong_streams.patient_of(session, node)
        for topic, message in campaign.flight():
            if patient.hears(topic):
                patient.give(topic, message)
        assert patient.node.health.rejected == {}


@pytest.mark.filterwarnings('ignore:Deprecated in favor')  # rclpy's own, where it reports
@pytest.mark.parametrize('node', sorted(NODES))
def test_a_time_before_zero_on_clock_ends_no_node(node, monkeypatch):
    said = []
    logger = SimpleNamespace(warning=lambda text, **_: said.append(text))
    monkeypatch.setattr(executor, 'get_logger', lambda _: logger)
    with Session() as session:
        node = wrong_streams.patient_of(session, node).node
        clock = session.plain('clock').create_publisher(Clock, '/clock', 10)
        session.connect()
        for k, ms in enumerate((-1, -(2**31) * 1000)):
            clock.publish(Clock(clock=compose.time(ms * MS)))
            session.until(lambda: len(said) > k, lambda: k)  # noqa: B023
        clock.publish(Clock(clock=compose.time(5000 * MS)))
        session.until(lambda: node.now_ns() == 5000 * MS, lambda: 0)
    assert set(said) == {'/clock: a time before zero is left out'}


def test_a_wrong_time_on_clock_begins_no_motion_anew():
    with Session() as session:
        patient = wrong_streams.patient_of(session, 'controller')
        patient.node.restart = patient.node.begin_segment = None  # not to be called
        for k, (topic, message) in enumerate(campaign.flight()):
            if patient.hears(topic):
                patient.give(topic, message)
                if k % 50 == 20:
                    patient.give('/clock', Clock(clock=compose.time(0)))
        assert patient.node.last_command.mode == 'tracking'


def test_what_a_node_raises_or_says_is_seen(monkeypatch):
    from spacerobot_ros.nodes.controller import ControllerNode

    def die(self, sensor, *_):
        raise ZeroDivisionError(sensor)

    monkeypatch.setattr(ControllerNode, 'take', die)
    record = campaign.odd_messages('controller', 1, 20)
    assert any('ZeroDivisionError' in name for name in record['raised'])
    rows = campaign.results([{'case': '["messages", "controller", 1, 20]', 'what': 'x', **record}])
    wrong = missed('faults', rows)
    assert wrong == ['messages, x: raised']
    assert 'ZeroDivisionError' in str(CAMPAIGNS['faults'].tables(rows)[0].rows)


def test_odd_messages_are_those_that_a_wire_can_bring(rng):
    joints = compose.joint_state(5, NAMES, np.zeros(3), np.zeros(3), np.zeros(3))
    odd = [spoilt(joints, rng) for _ in range(300)]
    assert all(isinstance(message, JointState) for message in odd)
    assert sum(message != joints for message in odd) > 200
    assert any(not is_finite(message) for message in odd)
    assert is_finite(joints)
    assert not is_finite(Imu(linear_acceleration_covariance=[math.nan] * 9))


@pytest.mark.parametrize('seed', range(8))
def test_a_clock_that_jumps_goes_on(seed):
    stream = [
        ('/imu/data', compose.imu(k * 10 * MS, 'base_link', np.zeros(3), None))
        for k in range(2000)
    ]
    rng = np.random.default_rng(seed)
    stamps = [m.header.stamp for _, m, _ in wrong_streams._astray('clock jumps', stream, rng)]
    steps = np.diff([stamp.sec * 1000 + stamp.nanosec // MS for stamp in stamps])
    assert np.count_nonzero(steps != 10) == 1  # once the largest jump back led to zero, for good


@pytest.mark.parametrize('kind', ['cut', 'flipped'])
def test_no_damaged_bag_passes_for_data(kind):
    ends = {damage.damaged_bag(kind, seed) for seed in range(12)}
    assert ends <= {'refused', 'whole', 'in part'}
    assert 'in part' in ends


def test_wrong_and_missing_numbers_would_be_seen():
    whole = damage.whole_bag()[-1]
    assert damage._compared(whole, whole) == 'whole'
    position = whole.joints.position.copy()
    position[7, 1] += 1e-12
    wrong = replace(whole, joints=replace(whole.joints, position=position))
    assert damage._compared(wrong, whole) == 'wrong'
    less = replace(whole, rates=whole.rates.at(slice(0, 100)))
    assert damage._compared(less, whole) == 'in silence'
    assert damage._compared(replace(less, notes=('x', *whole.notes)), whole) == 'in part'


@pytest.mark.parametrize('kind', ['robot file', 'URDF', 'mapping'])
def test_malformed_files_are_refused_in_a_line(kind, monkeypatch):
    monkeypatch.setattr(damage, 'LONGEST', math.inf)  # the first file loads or compiles kernels
    ends = {damage.malformed_file(kind, seed) for seed in range(12)}
    assert ends <= {'refused', 'loaded'}
    assert 'refused' in ends


def test_a_torque_that_no_plant_survives_is_dropped(servicer):
    file = packaged('servicer')
    with Session() as session:
        simulator = session.add(SimulatorNode, file.settings, file.robot.urdf)
        for ns, effort in ((0, 1e12), (10, 0.0)):
            command = compose.joint_state(ns, NAMES, effort=np.full(3, effort))
            simulator._on_command(command)
            simulator.step()
        assert simulator.step_index == 2
        assert np.all(np.isfinite(simulator.plant.state.to_vector()))
        assert any('dropped' in reason for _, reason in simulator.health.rejected)


def test_a_gyro_of_no_machine_is_heard_by_nobody(rig, servicer):
    bench = Bench(rig, servicer)
    bench.gyro(0, (1e308, -1e308, 1e308))
    rig.deliver()
    ((topic, why),) = bench.node.health.rejected
    assert topic == '/imu/data'
    assert 'angular_velocity has a number of no machine' in why


def test_stamps_somewhat_ahead_do_not_lead_away():
    jumps = JumpDetector(1_000 * MS)
    for k in range(200):
        for sensor in ('imu', 'joints'):
            judged = jumps.judge(Sample(sensor, k * 10 * MS, ()))
            assert judged.jump_ns is None
            assert judged.taken, k
            if k > 5 and k % 3 == 0:  # one in four is ahead, by more each time if it is believed
                jumps.judge(Sample(sensor, (jumps.newest_ns or 0) + 900 * MS, ()))


def test_gyro_rates_as_large_as_are_heard_end_nothing(rig, servicer):
    bench = Bench(rig, servicer)
    for ms in range(0, 5000, 10):
        bench.gyro(ms, (1e12, -1e12, 1e12) if ms > 4000 and ms % 50 < 30 else (0.1, 0.1, 0.1))
        bench.joint(ms)
        if ms % 100 == 0:
            bench.star(ms)
            rig.deliver()
    rig.deliver()
    bench.node.flush()
    assert bench.node.identifier.samples.newest_ns == 4990 * MS


def test_a_patient_is_given_what_it_hears(servicer):
    file = packaged('servicer')
    with Session() as session:
        patient = Patient(session, SimulatorNode, file.settings, file.robot.urdf)
        assert patient.hears('/joint_commands')
        assert not patient.hears('/imu/data')
        patient.node.step()
        assert patient.published['/joint_states'] == 2  # of the start, and of the step
        assert patient.not_finite == []


def test_torques_that_are_finite_never_make_the_plant_too_fast(rng):
    file = packaged('servicer')
    with Session() as session:
        simulator = session.add(SimulatorNode, file.settings, file.robot.urdf)
        for ns in range(300):
            step = simulator.step_index
            effort = 10.0 ** rng.uniform(3.0, 11.3) * rng.standard_normal(3)
            simulator._on_command(compose.joint_state(ns, NAMES, effort=effort))
            torque = 10.0 ** rng.uniform(2.0, 11.3) * rng.standard_normal(3)
            simulator._on_wrench(compose.base_torque(ns, 'base_link', torque))
            simulator.step()
            assert simulator.step_index == step + 1
            assert np.all(np.isfinite(simulator.plant.state.to_vector()))


def test_a_plant_that_is_too_fast_without_torques_begins_anew():
    file = packaged('servicer')
    with Session() as session:
        simulator = session.add(SimulatorNode, file.settings, file.robot.urdf)
        simulator.start()
        simulator.plant._x[13:] = 1e200
        simulator.step()
        assert simulator.step_index == 0
        simulator.step()
        assert simulator.step_index == 1
        assert np.all(np.isfinite(simulator.plant.state.to_vector()))


def test_a_loop_that_harms_is_seen():
    record = {'what': 'simulator', 'odd': 1, 'raised': {}, 'zero': 9.0, 'known': None}
    record |= {'following': 1.0, 'error': 0.7, 'case': '["kills", "simulator", 1, 1]'}
    rows = campaign.results([record])
    wrong = missed('faults', rows)
    assert wrong == [
        'kills, simulator: joint error [deg]',
        'kills, simulator: time until there is no effort [s]',
    ]
    assert '9' in str(CAMPAIGNS['faults'].tables(rows)[1].rows)


def test_half_of_a_flood_is_odd():
    kind, messages = process_faults._messages('/imu/data', 1)

    def clean(cdr):
        return encoded(decoded(type_name(kind), cdr))  # what is in the gaps is chance

    good = {clean(serialize_message(m)) for name, m in campaign.flight() if name == '/imu/data'}
    share = sum(clean(message) in good for message in messages) / len(messages)
    assert 0.45 < share < 0.6  # what a field can not hold stays as it was


def test_a_flood_of_torques_moves_no_plant():
    _, messages = process_faults._messages('/base_torque', 1)
    assert all(b'nowhere' in message for message in messages)


def test_a_flood_that_harms_is_seen():
    record = {'what': 'monitor', 'odd': 600_000, 'raised': {'ended': 1}, 'grown': 0.2}
    record |= {'valid': False, 'case': '["floods", "monitor", 1, 60.0]'}
    rows = campaign.results([record])
    wrong = missed('faults', rows)
    assert wrong == [
        'floods, monitor: estimates not valid',
        'floods, monitor: raised',
        'floods, monitor: share by which memory grew',
    ]


def test_what_came_does_not_fill_the_log(rig, servicer):
    bench = Bench(rig, servicer)
    bench.gyro(5, frame='j' * 10_000)
    rig.deliver()
    ((_, reason),) = bench.node.health.rejected
    assert reason.startswith("frame_id is 'jjj")
    assert len(reason) <= 200


_STARTS_ONE = """
import multiprocessing, time
from validation.faults.own_process import begin
if __name__ == '__main__':
    context = multiprocessing.get_context('forkserver')
    process = context.Process(target=begin, args=(99, time.sleep, (600,)), daemon=True)
    process.start()
    print(process.pid, flush=True)
    time.sleep(600)
"""


def test_processes_of_a_campaign_that_is_killed_end_with_it(tmp_path):
    path = tmp_path / 'campaign.py'
    path.write_text(_STARTS_ONE, encoding='utf-8')
    with subprocess.Popen([sys.executable, path], stdout=subprocess.PIPE, text=True) as campaign:
        child = os.pidfd_open(int(campaign.stdout.readline()))
        campaign.kill()
    poll = select.poll()
    poll.register(child, select.POLLIN)
    try:
        poll.poll()
    finally:
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(child, signal.SIGKILL)
        os.close(child)


def test_a_loop_has_settled_when_it_has_followed_for_as_long_as_asked(monkeypatch):
    loop = object.__new__(process_loop.Loop)
    loop.is_lockstep = True
    monkeypatch.setattr(loop, 'until', lambda _: None, raising=False)
    loop.settle(20.0)
    seen = []
    for loop.stamp in (1.0, 2.0, 12.0, 13.0, 32.0, 34.0):
        error, is_known = (0.02 if loop.stamp == 1.0 else 0.0), loop.stamp != 12.0
        loop._on_tracking(Tracking(state='tracking', max_error=error, uses_estimate=is_known))
        seen.append(loop.is_settled())
    assert seen == [False] * 5 + [True]
    loop._on_tracking(Tracking(state='tracking', max_error=0.01))
    assert loop.worst == 0.01


def test_an_interrupt_waits_for_the_callback_it_meets():
    went_on = []

    def meet():
        timer.cancel()
        signal.raise_signal(signal.SIGINT)
        went_on.append(True)

    with Session() as session:
        timer = session.plain('met').create_timer(0.001, meet)
        with pytest.raises(KeyboardInterrupt):
            session.until(lambda: False, lambda: 0)
    assert went_on == [True]
