"""Simulator node: stamps, lockstep, real time, services, bad commands."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import QuaternionStamped, WrenchStamped
from numpy.testing import assert_allclose
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from spacerobot_msgs.msg import Ledger
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from support.models import table_one, to_urdf, wheel_joints, with_wheels

from spacerobot_ros.nodes import simulator
from spacerobot_ros.nodes.pace import IdleTime
from spacerobot_ros.nodes.simulator import SimulatorNode
from spacerobot_ros.recording import messages
from spacerobot_ros.ros.convert import compose
from spacerobot_ros.ros.qos import LATCHED, SAMPLES, STATE

pytestmark = pytest.mark.ros

NAMES = ['joint_1', 'joint_2', 'joint_3']
PERIOD = 10_000_000


class Bench:
    """A simulator with a probe that listens to everything and commands what it is told."""

    def __init__(self, rig, parameters, **more):
        self.rig, self.probe = rig, rig.plain()
        topics = {
            '/clock': Clock,
            '/joint_states': JointState,
            '/imu/data': Imu,
            '/attitude': QuaternionStamped,
            '/simulator/ledger': Ledger,
        }
        self.heard = {t: rig.listen(self.probe, m, t, SAMPLES) for t, m in topics.items()}
        self.publisher = self.probe.create_publisher(JointState, '/joint_commands', STATE)
        self.sim = rig.add(SimulatorNode, parameters, **more)

    def command(self, stamp, effort=(0.0, 0.0, 0.0), names=NAMES):
        self.publisher.publish(compose.joint_state(stamp, list(names), effort=np.array(effort)))

    def run(self, steps):
        for _ in range(steps):
            k = self.sim.step_index
            self.rig.until(lambda: self.sim.answer.stamp_ns == k * PERIOD)  # noqa: B023
            self.command(k * PERIOD)
            self.rig.until(lambda: self.sim.step_index == k + 1)  # noqa: B023

    def stamps(self, topic):
        return [messages.stamp_ns(m.header.stamp) for m in self.heard[topic]]

    def call(self, service_type, name, request):
        client = self.probe.create_client(service_type, name)
        future = client.call_async(request)
        self.rig.until(future.done)
        return future.result()


@pytest.fixture
def bench(rig, servicer):
    return Bench(rig, servicer)


def test_lockstep_steps_once_a_command_with_whole_stamps(bench):
    bench.run(20)
    bench.rig.until(lambda: len(bench.heard['/joint_states']) == 21)
    bench.rig.drain()
    want = [k * PERIOD for k in range(21)]
    assert bench.stamps('/joint_states') == want
    assert bench.stamps('/imu/data') == want
    assert [messages.stamp_ns(m.clock) for m in bench.heard['/clock']] == want
    assert bench.stamps('/attitude') == [0, 10 * PERIOD, 20 * PERIOD]
    assert bench.stamps('/simulator/ledger') == [0, 10 * PERIOD, 20 * PERIOD]


def test_messages_follow_the_conventions(bench):
    bench.run(1)
    bench.rig.until(lambda: bench.heard['/joint_states'] and bench.heard['/attitude'])
    imu, attitude = bench.heard['/imu/data'][0], bench.heard['/attitude'][0]
    assert imu.header.frame_id == 'base_link'
    assert imu.orientation_covariance[0] == -1.0
    assert imu.linear_acceleration_covariance[0] == -1.0
    assert_allclose(imu.angular_velocity_covariance[0], (2e-5) ** 2, rtol=1e-12)
    assert attitude.header.frame_id == 'inertial'
    want = np.array([0.2, 0.1, 0.3, 0.927])
    q = attitude.quaternion
    got = [q.x, q.y, q.z, q.w]
    assert_allclose(got, want / np.linalg.norm(want), atol=2e-4)  # noise of 3e-5 rad
    assert list(bench.heard['/joint_states'][0].name) == NAMES


def test_waits_for_a_controller_then_for_its_command_and_says_so(rig, servicer):
    sim = rig.add(SimulatorNode, servicer, **{'simulator.lockstep_timeout': 0.05})
    rig.drain()
    assert sim.answer.stamp_ns is None  # nobody listens: not started
    assert 'waiting for a controller' in sim.health.statuses()[0].message
    probe = rig.plain()
    rig.listen(probe, JointState, '/joint_states', STATE)
    probe.create_publisher(JointState, '/joint_commands', STATE)
    rig.until(lambda: sim.answer.stamp_ns == 0)
    rig.until(lambda: 'no command' in sim.health.statuses()[1].message)
    assert sim.step_index == 0


def test_no_sample_is_sent_twice_however_late_its_answer_and_who_listens(bench):
    wait(bench, 1)
    late = bench.rig.listen(bench.rig.plain('late'), JointState, '/joint_states', STATE)
    wait(bench, 4)
    bench.run(2)
    bench.rig.until(lambda: len(late) == len(bench.heard['/imu/data']) - 1 == 2)
    bench.rig.drain()  # what is more would come now
    assert len(late) == 2
    assert bench.stamps('/joint_states') == bench.stamps('/imu/data') == [0, PERIOD, 2 * PERIOD]
    clock = [messages.stamp_ns(m.clock) for m in bench.heard['/clock']]
    assert clock.count(0) > 1  # the time alone is said again
    assert clock == sorted(clock)


def wait(bench, seconds):
    """Let the simulator's own timer count so long without an answer."""
    bench.rig.until(
        lambda: bench.sim.answer.stamp_ns == 0 and bench.sim.waiting.ns > seconds * 1e9
    )


def test_unanswered_samples_are_sent_again_to_a_controller_that_came_late(bench):
    bench.rig.until(lambda: bench.sim.answer.stamp_ns == 0)
    node = bench.rig.plain('late')
    late = bench.rig.listen(node, JointState, '/joint_states', STATE)
    clock = bench.rig.listen(node, Clock, '/clock', STATE)
    node.create_publisher(JointState, '/joint_commands', STATE)
    bench.rig.until(lambda: late and clock)
    assert messages.stamp_ns(late[0].header.stamp) == messages.stamp_ns(clock[0].clock) == 0


@pytest.mark.parametrize('is_one_node', [True, False])
def test_lockstep_begins_once_who_commands_gets_the_samples(
    rig, servicer, monkeypatch, is_one_node
):
    monkeypatch.setattr(simulator, 'LOOKS_AT_SEVERAL', 10**9 if is_one_node else 3)
    ears, hands = rig.plain('ears'), rig.plain('hands')
    heard = rig.listen(ears, JointState, '/joint_states', STATE)
    hands.create_publisher(JointState, '/joint_commands', STATE)
    sim = rig.add(SimulatorNode, servicer)
    if is_one_node:
        for _ in range(5):
            rig.drain()
        assert sim.answer.stamp_ns is None  # its subscription is still to come
        heard = rig.listen(hands, JointState, '/joint_states', STATE)
    rig.until(lambda: heard)
    assert sim.answer.stamp_ns == 0


def test_time_that_callbacks_take_is_no_time_without_an_answer():
    now = [0]
    idle = IdleTime(0.05, lambda: now[0])
    for now[0] in (50_000_000, 90_000_000, 60_000_000_000):  # the last tick comes a minute late
        idle.tick()
    assert idle.ns == 140_000_000
    idle.clear()
    assert idle.ns == 0


@pytest.mark.parametrize(
    ('stamp', 'effort', 'names', 'reason'),
    [
        (PERIOD, (0, 0, 0), NAMES, 'lockstep: stamp # s, awaited is # s'),
        (0, (np.nan, 0, 0), NAMES, 'effort is not finite'),
        (0, (0, 0), NAMES, 'effort has # entries for # joints'),
        (0, (0, 0), NAMES[:2], 'joint names: lacks joint_3'),
        (
            0,
            (0, 0, 0),
            ['a', 'b', 'c'],
            'joint names: lacks joint_1, joint_2, joint_3 and has foreign a, b, c',
        ),
        (0, (0, 0, 0), NAMES[:2] + NAMES[:1], 'joint names: lacks joint_3'),
    ],
)
def test_bad_commands_are_counted_and_the_loop_goes_on(bench, stamp, effort, names, reason):
    bench.rig.until(lambda: bench.sim.answer.stamp_ns == 0)
    bench.command(stamp, np.array(effort, dtype=float), names)
    bench.rig.until(lambda: bench.sim.health.count('/joint_commands'))
    assert bench.sim.health.rejected['/joint_commands', reason] == 1
    assert bench.sim.step_index == 0
    bench.run(2)


def test_bad_base_torques_are_counted(bench):
    publisher = bench.probe.create_publisher(WrenchStamped, '/base_torque', STATE)
    message = WrenchStamped()
    message.wrench.torque.x = np.nan
    publisher.publish(message)
    bench.rig.until(lambda: bench.sim.health.rejected['/base_torque', 'wrench is not finite'])


def test_base_torque_turns_the_momentum(bench):
    publisher = bench.probe.create_publisher(WrenchStamped, '/base_torque', STATE)
    bench.rig.until(lambda: bench.sim.answer.stamp_ns == 0)
    message = WrenchStamped()
    message.header.frame_id = 'base_link'
    message.wrench.torque.x = 10.0
    publisher.publish(message)
    bench.rig.drain()
    bench.run(20)
    impulse = np.linalg.norm(bench.sim.plant.ledger().angular_impulse)
    assert_allclose(impulse, 10.0 * 0.2, rtol=1e-3)  # the base turns a little meanwhile
    assert bench.sim.plant.ledger().momentum_drift < 1e-10


def test_reset_repeats_the_run_with_time_at_zero(bench):
    bench.run(5)
    bench.rig.until(lambda: len(bench.heard['/joint_states']) == 6)
    assert bench.call(Trigger, '/simulator/reset', Trigger.Request()).success
    bench.rig.until(lambda: bench.sim.answer.stamp_ns == 0)
    bench.run(5)
    bench.rig.until(lambda: len(bench.heard['/joint_states']) == 12)
    first, second = bench.heard['/joint_states'][:6], bench.heard['/joint_states'][6:]
    assert first == second
    assert messages.stamp_ns(bench.heard['/clock'][6].clock) == 0


def test_pause_holds_the_step_until_resumed(bench):
    bench.run(2)
    assert bench.call(SetBool, '/simulator/pause', SetBool.Request(data=True)).success
    bench.command(2 * PERIOD)
    bench.rig.drain()
    assert bench.sim.step_index == 2
    bench.call(SetBool, '/simulator/pause', SetBool.Request(data=False))
    bench.rig.until(lambda: bench.sim.step_index == 3)


def test_sensor_rates_and_steps_without_samples(rig, servicer):
    bench = Bench(rig, servicer, **{'simulator.joint_rate': 25.0, 'simulator.imu_rate': 50.0})
    rig.until(lambda: bench.sim.answer.stamp_ns == 0)
    bench.command(0)
    rig.until(lambda: bench.sim.answer.stamp_ns == 4 * PERIOD)
    assert bench.sim.step_index == 4
    rig.until(lambda: len(bench.heard['/imu/data']) == 3)
    assert bench.stamps('/imu/data') == [0, 2 * PERIOD, 4 * PERIOD]


def test_real_time_runs_by_itself_and_drops_old_torques(rig, servicer):
    bench = Bench(
        rig,
        servicer,
        **{
            'simulator.lockstep': False,
            'simulator.real_time_factor': 5.0,
            'simulator.command_timeout': 0.05,
        },
    )
    efforts = []  # of every step: a busy machine does many in one callback
    bench.sim.observers.append(lambda plant: efforts.append(plant.effort.tolist()))
    bench.command(0, (1.0, 2.0, 3.0))  # any stamp will do outside lockstep
    rig.until(lambda: [1.0, 2.0, 3.0] in efforts)
    rig.until(lambda: not bench.sim.plant.effort.any())
    status = bench.sim.health.statuses()[1]
    assert status.message == 'none, or too old: joint torques are zero'


def test_step_can_be_called_directly(rig, servicer):
    sim = rig.add(SimulatorNode, servicer, **{'simulator.lockstep': False})
    for _ in range(3):
        sim.step()
    assert sim.step_index >= 3


def test_description_is_latched(bench):
    late = bench.rig.listen(bench.rig.plain('late'), String, '/robot_description', LATCHED)
    bench.rig.until(lambda: late)
    assert '<robot' in late[0].data


def test_true_rotors_turn_and_only_the_servicer_s_are_published(rig, servicer):
    parts = with_wheels(table_one())
    names = [p.joint for p in parts[1:4]]
    robot = {
        'robot_description': to_urdf(parts),
        'robot.base_link': parts[0].name,
        'robot.joints': names,
        'robot.servicer_wheels.joints': wheel_joints(0),
        'robot.servicer_wheels.rates': [100.0, 110.0, 120.0],
        'robot.target_wheels.joints': wheel_joints(3),
        'robot.target_wheels.rates': [200.0, 210.0, 220.0],
    }
    kept = ('sensors.', 'simulator.', 'initial.', 'use_sim_time')
    parameters = {k: v for k, v in servicer.items() if k.startswith(kept)} | robot
    heard = rig.listen(rig.plain('ears'), JointState, '/wheel_states', STATE)
    bench = Bench(rig, parameters)
    rig.until(lambda: heard)
    assert list(heard[0].name) == wheel_joints(0)
    assert_allclose(heard[0].velocity, [100.0, 110.0, 120.0], atol=1e-2)  # noise of 2e-4
    assert bench.sim.plant.robot.rotor_count == 6
    rig.until(lambda: bench.sim.answer.stamp_ns == 0)
    bench.command(0, names=names)
    rig.until(lambda: bench.sim.step_index == 1)


def test_diagnostics_are_published(bench):
    heard = bench.rig.listen(bench.probe, DiagnosticArray, '/diagnostics', STATE)
    bench.sim.health.publish()
    bench.rig.until(lambda: heard)
    names = [s.name for s in heard[0].status]
    assert names == [f'simulator: {n}' for n in ('time', 'commands', 'momentum', 'rejected')]
