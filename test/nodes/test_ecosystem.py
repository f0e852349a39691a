"""At home in ROS 2: drivers, life cycle, parameters, effort controllers, frames, actions."""

import importlib.util
import os
import threading

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import QuaternionStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.parameter import Parameter
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray
from support.bench import MS, NAMES

from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.nodes.controller import ControllerNode
from spacerobot_ros.nodes.identifier import IdentifierNode
from spacerobot_ros.nodes.monitor import MonitorNode
from spacerobot_ros.nodes.sensor_node import TOPICS
from spacerobot_ros.nodes.simulator import SimulatorNode
from spacerobot_ros.ros.convert import compose
from spacerobot_ros.ros.qos import SAMPLES, STATE, best_effort
from spacerobot_ros.ros.run_node import run_nodes
from spacerobot_ros.ros.scheduling import SCHEDULING, run_first, run_last

pytestmark = pytest.mark.ros

FOLLOWING = (IdentifierNode, ControllerNode, MonitorNode)


def lacks(package):
    reason = f'{package} is not installed (the wheels of ROS have none)'
    return pytest.mark.skipif(importlib.util.find_spec(package) is None, reason=reason)


class Drivers:
    """What plays the sensors of a robot at rest."""

    def __init__(self, rig, qos):
        self.rig, self.probe = rig, rig.plain('drivers')
        self.out = {
            topic: self.probe.create_publisher(kind, topic, qos) for topic, kind in TOPICS.values()
        }

    def send(self, ms, names=NAMES, q=None, effort=None):
        zero = np.zeros(len(names))
        q, effort = zero if q is None else q, zero if effort is None else effort
        self.out['/imu/data'].publish(compose.imu(ms * MS, 'base_link', np.zeros(3), None))
        level = np.array([0.0, 0.0, 0.0, 1.0])
        self.out['/attitude'].publish(compose.quaternion(ms * MS, level))
        self.out['/joint_states'].publish(compose.joint_state(ms * MS, names, q, zero, effort))
        self.rig.deliver()


@pytest.mark.parametrize('node_type', FOLLOWING)
@pytest.mark.parametrize('qos', [STATE, best_effort(STATE)], ids=['reliable', 'best_effort'])
def test_drivers_are_heard_whatever_they_offer(rig, servicer, node_type, qos):
    drivers = Drivers(rig, qos)
    node = rig.add(node_type, servicer, **{'simulator.lockstep': False})
    stamps = iter(range(0, 10_000_000, 10))

    def is_heard():
        drivers.send(next(stamps))
        return {'imu', 'joints'} <= set(node.latest)

    rig.until(is_heard)
    assert node.health.count() == 0


@pytest.mark.parametrize('qos', [SAMPLES, best_effort(SAMPLES)], ids=['reliable', 'best_effort'])
def test_the_simulator_is_heard_whatever_is_asked_for(rig, servicer, qos):
    probe = rig.plain()
    heard = {
        topic: rig.listen(probe, kind, topic, qos)
        for topic, kind in (
            ('/joint_states', JointState), ('/imu/data', Imu), ('/attitude', QuaternionStamped),
        )
    }  # fmt: skip
    simulator = rig.add(SimulatorNode, servicer)
    simulator.start()
    rig.until(lambda: all(heard.values()))


def transitions(rig, node):
    """Return a function that asks a node for a transition and says whether it was made."""
    client = rig.plain('manager').create_client(ChangeState, f'/{node.get_name()}/change_state')

    def go(transition):
        future = client.call_async(ChangeState.Request(transition=Transition(id=transition)))
        rig.until(future.done, timeout_sec=20.0)
        return future.result().success

    return go


@pytest.mark.parametrize('node_type', FOLLOWING)
def test_who_follows_sensors_has_a_life_cycle(rig, servicer, node_type):
    node = rig.add(node_type, {**servicer, 'simulator.lockstep': False, 'autostart': False})
    drivers, go = Drivers(rig, STATE), transitions(rig, node)

    def works(first):
        for ms in range(first, first + 100, 10):
            drivers.send(ms)
        if node_type is ControllerNode:
            return node.last_command is not None and node.last_command.stamp_ns >= first * MS
        core = node.identifier if node_type is IdentifierNode else node.monitor
        return (core.samples.newest_ns or -1) >= first * MS

    assert not works(0)
    assert not go(Transition.TRANSITION_ACTIVATE)
    assert go(Transition.TRANSITION_CONFIGURE)
    assert go(Transition.TRANSITION_ACTIVATE)
    assert works(1000)
    assert go(Transition.TRANSITION_DEACTIVATE)
    assert not works(2000)
    assert go(Transition.TRANSITION_CLEANUP)
    assert go(Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)


def test_time_passes_while_the_simulator_is_active(rig, servicer):
    node = rig.add(SimulatorNode, {**servicer, 'simulator.lockstep': False, 'autostart': False})
    go = transitions(rig, node)
    assert go(Transition.TRANSITION_CONFIGURE)
    assert node.step_index == 0
    assert go(Transition.TRANSITION_ACTIVATE)
    rig.until(lambda: node.step_index > 2, timeout_sec=20.0)
    assert go(Transition.TRANSITION_DEACTIVATE)
    step = node.step_index
    assert go(Transition.TRANSITION_ACTIVATE)
    assert node.step_index <= step + 10  # what was missed is not made up for
    assert go(Transition.TRANSITION_DEACTIVATE)
    assert go(Transition.TRANSITION_CLEANUP)
    assert node.step_index == 0


def answer(node, name, value):
    return node.set_parameters_atomically([Parameter(name, value=value)])


def test_gains_damping_and_limits_change_while_it_runs(rig, servicer):
    plain = {'simulator.lockstep': False, 'reference.kind': 'hold'}
    plain |= {'controller.state_timeout': 100.0}  # a busy machine takes its time
    node = rig.add(ControllerNode, servicer, **plain, **{'controller.hold_compensation': False})
    drivers = Drivers(rig, STATE)
    sent = rig.listen(drivers.probe, JointState, '/joint_commands', SAMPLES)
    off = np.array([0.0, 0.02, 0.0])
    for ms in range(0, 100, 10):
        drivers.send(ms, q=0 * off)
    for ms in (100, 110, 120, 130):
        drivers.send(ms, q=off)  # a blow, believed from the second sample on
    weak = np.abs(sent[-1].effort).max()
    assert answer(node, 'controller.bandwidth', 2.0).successful
    drivers.send(140, q=off)
    # the gain of the position is the bandwidth's square, and the joints are at rest
    np.testing.assert_allclose(np.abs(sent[-1].effort).max(), 4.0 * weak, rtol=0.05)
    assert answer(node, 'controller.torque_limit', [0.5, 0.5, 0.5]).successful
    drivers.send(150, q=off)
    np.testing.assert_allclose(np.abs(sent[-1].effort).max(), 0.5, rtol=1e-12)
    assert node.get_parameter('controller.bandwidth').value == 2.0
    assert node.settings.controller.bandwidth == 2.0


@pytest.mark.parametrize(
    ('name', 'value', 'reason'),
    [
        ('controller.bandwidth', -1.0, 'above 0'),
        ('controller.bandwidth', float('nan'), 'finite'),
        ('controller.torque_limit', [1.0], 'torque_limit'),
        ('controller.law', 'passivity', 'controller.law: is read when the node starts'),
        ('robot.joints', ['joint_1'], 'robot.joints: is read when the node starts'),
        ('autostart', False, 'autostart: is read when the node starts'),
    ],
)
def test_what_can_not_change_says_why(rig, servicer, name, value, reason):
    node = rig.add(ControllerNode, servicer)
    before = node.settings
    result = answer(node, name, value)
    assert not result.successful
    assert reason in result.reason
    assert node.settings is before


def test_bandwidths_of_adaptive_laws_change_within_what_can_be_sampled(rig):
    from support.free_flying import ROBOT_FILE, free_flying_parameters
    from support.rig import file_parameters

    parameters = {**file_parameters(ROBOT_FILE), **free_flying_parameters('adaptive_rls', 0.05)}
    node = rig.add(ControllerNode, parameters)
    assert answer(node, 'adaptive.joint_bandwidth', 2.0).successful
    assert node.loop.adaptive.settings.joint_bandwidth == 2.0
    refused = answer(node, 'adaptive.kappa', 100.0)
    assert not refused.successful
    assert 'x period' in refused.reason
    assert node.loop.adaptive.settings.kappa < 100.0


def test_efforts_for_an_effort_controller_and_states_of_a_broadcaster(rig, servicer):
    node = rig.add(ControllerNode, servicer, **{'simulator.lockstep': False})
    drivers = Drivers(rig, STATE)
    arrays = rig.listen(drivers.probe, Float64MultiArray, '/controller/effort_commands', SAMPLES)
    commands = rig.listen(drivers.probe, JointState, '/joint_commands', SAMPLES)
    # a joint_state_broadcaster sends all joints of the machine, in its own order, and NaN for
    # what an interface does not have
    names = ['gripper', 'joint_3', 'joint_1', 'joint_2']
    q = np.array([np.nan, 0.03, 0.01, 0.02])
    for ms in range(0, 50, 10):
        drivers.send(ms, names, q, np.full(4, np.nan))
    assert node.health.count() == 0
    np.testing.assert_array_equal(node.latest['joints'][1], [0.01, 0.02, 0.03])
    assert arrays
    assert list(arrays[-1].data) == list(commands[-1].effort)
    assert list(commands[-1].name) == NAMES


@lacks('tf2_msgs')
def test_the_base_is_a_frame(rig, servicer):
    from tf2_msgs.msg import TFMessage

    frames = rig.listen(rig.plain(), TFMessage, '/tf', SAMPLES)
    simulator = rig.add(SimulatorNode, servicer)
    simulator.start()
    rig.until(lambda: frames)
    transform = frames[0].transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == ('inertial', 'base_link')
    rotation = transform.transform.rotation
    wanted = simulator.plant.state.q_WB_xyzw
    np.testing.assert_array_equal([rotation.x, rotation.y, rotation.z, rotation.w], wanted)


def test_all_threads_of_a_process_run_first_where_that_is_permitted(monkeypatch):
    asked = {}
    monkeypatch.setattr(os, 'sched_setscheduler', lambda *a: asked.update({a[0]: a[1:]}))
    monkeypatch.setattr(os, 'sched_getaffinity', lambda _: {0})
    run_first()
    assert not asked  # a lone processor is everybody's
    monkeypatch.setattr(os, 'sched_getaffinity', lambda _: {0, 1})
    blocked = threading.Event()
    thread = threading.Thread(target=blocked.wait)
    thread.start()
    try:
        run_first()
        assert {threading.get_native_id(), thread.native_id} <= asked.keys()
    finally:
        blocked.set()
        thread.join()
    (policy, parameter), *_ = asked.values()
    assert policy & os.SCHED_FIFO
    assert parameter.sched_priority == os.sched_get_priority_min(os.SCHED_FIFO)

    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(os, 'sched_setscheduler', refuse)
    run_first()


def test_the_processor_is_shared_as_an_option_says(rig, servicer, monkeypatch):
    assert SCHEDULING['fifo'] is run_first
    assert SCHEDULING['nice'] is run_last
    asked = []
    monkeypatch.setitem(SCHEDULING, 'nice', lambda: asked.append('nice'))
    for given in ({}, {'scheduling': 'nice'}):

        def node(given=given):
            made = SimulatorNode(parameter_overrides=parameters({**servicer, **given}))
            made.create_timer(0.001, lambda: rclpy.shutdown(), clock=made.steady)
            return made

        assert run_nodes([node], []) == 0
    assert asked == ['nice']  # by default: none
    with pytest.raises(ConfigurationError, match='scheduling: expected one of none, nice, fifo'):
        rig.add(SimulatorNode, {**servicer, 'scheduling': 'rt'})


def parameters(values):
    return [Parameter(name, value=value) for name, value in values.items()]
