"""Parameters of the nodes: declared with their meaning, refused with the place named."""

import gc
import signal
from pathlib import Path

import pytest
import rclpy
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from std_msgs.msg import String

from spacerobot_ros.errors import ConfigurationError, ModelError
from spacerobot_ros.nodes import entry
from spacerobot_ros.nodes.controller import ControllerNode
from spacerobot_ros.nodes.identifier import IdentifierNode
from spacerobot_ros.nodes.simulator import SimulatorNode
from spacerobot_ros.ros.run_node import run_nodes

pytestmark = pytest.mark.ros

ALL = (SimulatorNode, IdentifierNode, ControllerNode)


@pytest.mark.parametrize(
    'values',
    [
        {'controller.state_timeout': 1e40},  # more nanoseconds than a clock counts
        {'controller.attitude_timeout': 1e50},
        {'controller.damping': 1e-308},  # torques would never end
        {'simulator.imu_rate': 1e-308},
        {'identifier.solve_period': 1e-308},
        {'simulator.real_time_factor': 1e-308},
    ],
    ids=str,
)
def test_times_and_rates_that_no_clock_has_are_refused(rig, servicer, values):
    (name,) = values
    for node_type in ALL:
        with pytest.raises(ConfigurationError, match=f'{name}: .* must be at (least|most)'):
            rig.add(node_type, servicer, **values)


@pytest.mark.parametrize('node_type', ALL)
def test_every_parameter_teaches(rig, servicer, node_type):
    node = rig.add(node_type, servicer)
    descriptor = node.describe_parameter('controller.bandwidth')
    assert descriptor.description == 'Double pole of the error dynamics. [rad/s]'
    assert descriptor.additional_constraints == 'above 0; at most 100'
    assert list(node.get_parameter('robot.gravity').value) == [0.0, 0.0, 0.0]
    assert node.describe_parameter('truth.links').type == Parameter.Type.STRING_ARRAY.value
    result = node.set_parameters([Parameter('simulator.period', value=0.02)])[0]
    assert not result.successful
    assert 'is read when the node starts' in result.reason


@pytest.mark.parametrize('node_type', ALL)
def test_all_that_is_listed_can_be_had_at_once_and_given_again(rig, servicer, node_type):
    """As `ros2 param dump` does, and who starts a node from what that wrote."""
    node = rig.add(node_type, servicer)
    names = [name for name in node._parameters if not name.startswith(('use_sim', 'start_type'))]
    services = rig.plain().create_client(GetParameters, f'/{node.get_name()}/get_parameters')
    rig.until(services.service_is_ready)
    future = services.call_async(GetParameters.Request(names=names))
    rig.until(future.done)
    values = [parameter_value_to_python(value) for value in future.result().values]
    assert len(values) == len(names)
    # rcl has no empty list, and a null is a text
    again = {
        name: 'null' if value is None else value
        for name, value in zip(names, values, strict=True)
        if value != []
    }
    assert again['excitation.base_rate'] == 'null'
    rig.nodes.remove(node)
    rig.executor.remove_node(node)
    node.destroy_node()
    assert rig.add(node_type, again).settings == node.settings


@pytest.mark.parametrize('node_type', ALL)
@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'simulator.perod': 0.01}, r"simulator\.perod: unknown parameter.*'period'"),
        ({'controler.law': 'x'}, r"controler: unknown parameter.*'controller'"),
        ({'controller': 1}, 'controller'),
        ({'simulator.period': -1.0}, r'simulator\.period'),
        ({'simulator.period': float('nan')}, r'simulator\.period'),
        ({'robot.urdf': 'servicer.urdf'}, r"robot\.urdf: 'servicer\.urdf' is relative"),
        ({'robot.urdf': '/no/such.urdf'}, 'no such file'),
        ({'robot.joints': ['joint_1']}, r'robot\.joints'),
        ({'robot_description': 3}, 'robot_description: expected str'),
    ],
)
def test_bad_parameters_are_refused_at_the_start(rig, servicer, node_type, change, message):
    with pytest.raises(ConfigurationError, match=message):
        rig.add(node_type, servicer, **change)


@pytest.mark.parametrize('node_type', ALL)
def test_the_uncertainty_of_a_link_is_a_parameter_like_others(rig, servicer, node_type):
    name = 'robot.uncertainty.links.link_3.mass'
    node = rig.add(node_type, servicer, **{name: 0.5, 'robot.uncertainty.com': 0.2})
    assert node.get_parameter(name).value == 0.5
    assert 'of one link' in node.describe_parameter(name).description
    assert node.get_parameter('robot.uncertainty.com').value == 0.2
    assert node.describe_parameter('robot.uncertainty.mass').additional_constraints == (
        'above 0; at most 1'
    )
    result = node.set_parameters([Parameter(name, value=0.4)])[0]
    assert not result.successful
    assert 'is read when the node starts' in result.reason
    for wrong, message in (
        ({name: 1.5}, r'links\.link_3\.mass: 1\.5 must be at most 1'),
        ({name.replace('k_3', '_3'): 0.5}, r"links\.lin_3: .* \(did you mean 'link_3'\?\)"),
        ({name.replace('mass', 'volume'): 0.5}, r'links\.link_3\.volume: is none of mass, com'),
    ):
        with pytest.raises(ConfigurationError, match=message):
            rig.add(node_type, servicer, **wrong)


def test_what_stands_under_free_names_is_a_parameter_like_others(rig, servicer):
    thruster = {'at': [1.0, 0.0, 0.0], 'direction': [0.0, 1.0, 0.0], 'force': 2.0}
    given = {f'robot.thrusters.T1.{key}': value for key, value in thruster.items()}
    given |= {'firings.a.thruster': 'T1', 'firings.a.start': 1.0, 'firings.a.width': 0.3}
    node = rig.add(SimulatorNode, servicer, **given)
    for name, value in given.items():
        told = node.get_parameter(name).value
        assert (told if isinstance(value, str | float) else list(told)) == value
    assert node.describe_parameter('firings.a.start').description.startswith('Of commands to a')


@pytest.mark.parametrize('node_type', ALL)
def test_an_old_key_is_read(rig, servicer, node_type):
    node = rig.add(node_type, servicer, **{'identifier.prior_std': 0.4})
    assert node.get_parameter('robot.uncertainty.mass').value == 0.4


@pytest.mark.parametrize('node_type', ALL)
def test_description_can_come_as_a_parameter_or_as_a_topic(rig, servicer, node_type, capfd):
    urdf = Path('config/servicer.urdf').read_text(encoding='utf-8')
    assert rig.add(node_type, servicer, **{'robot.urdf': '', 'robot_description': urdf}).is_open
    node = rig.add(node_type, servicer, **{'robot.urdf': ''})
    assert not node.is_open
    from spacerobot_ros.ros.qos import LATCHED

    publisher = rig.plain().create_publisher(String, '/robot_description', LATCHED)
    publisher.publish(String(data=urdf))
    rig.until(lambda: node.is_open)
    publisher.publish(String(data=urdf))
    rig.deliver()
    assert 'has changed' not in capfd.readouterr().err
    publisher.publish(String(data='<robot/>'))  # such a node goes on with the robot that it has
    rig.deliver()
    assert '/robot_description has changed' in capfd.readouterr().err


def test_a_bad_description_on_the_topic_is_refused(rig, servicer):
    from spacerobot_ros.ros.qos import LATCHED

    rig.add(ControllerNode, servicer, **{'robot.urdf': ''})
    publisher = rig.plain().create_publisher(String, '/robot_description', LATCHED)
    publisher.publish(String(data='<robot'))
    with pytest.raises(ModelError, match='/robot_description'):
        rig.until(lambda: False)


@pytest.mark.parametrize(
    ('arguments', 'place'),
    [
        (['-p', 'robot.urdf:=servicer.urdf', '-p', 'robot.joints:=[joint_1]'], 'robot.urdf: '),
        (['-p', 'robot.color:=red'], 'robot.color: unknown parameter'),
        ([], 'robot.joints: required parameter is missing'),
        (['--params-file', '/no/such.yaml'], 'such.yaml'),
    ],
)
def test_the_process_says_one_line_and_exits_with_2(capfd, arguments, place):
    assert run_nodes([SimulatorNode], ['--ros-args', *arguments]) == 2
    lines = [line for line in capfd.readouterr().err.splitlines() if line and '[rcl]' not in line]
    assert len(lines) == 1
    assert place in lines[0]


SIGNALS = [signal.SIGINT, signal.SIGTERM]


@pytest.mark.parametrize('number', SIGNALS)
@pytest.mark.parametrize('is_made', [False, True], ids=['while it is made', 'in a callback'])
def test_a_signal_ends_a_node_and_nothing_that_is_under_way(rig, number, is_made):
    done = []

    def stopped():
        node = Node('stopped')

        def stop():
            signal.raise_signal(number)
            node.create_publisher(String, 'word', 1).publish(String())
            done.append(node.get_name())

        if is_made:
            node.create_timer(0.001, stop)
        else:
            stop()
        return node

    before = [signal.getsignal(k) for k in SIGNALS]
    assert run_nodes([stopped], []) == 0
    assert done == ['stopped']
    assert [signal.getsignal(k) for k in SIGNALS] == before


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('node', ['simulator', 'identifier', 'controller', 'monitor', 'composed'])
def test_a_signal_ends_a_node_whose_modules_load(monkeypatch, node, number):
    class Module:
        @staticmethod
        def program(name):
            assert name == node
            signal.raise_signal(number)

    def end(status):
        raise SystemExit(status)

    monkeypatch.setattr(entry, 'import_module', lambda *_: Module)
    monkeypatch.setattr(entry.os, '_exit', end)
    before = {k: signal.getsignal(k) for k in (signal.SIGINT, signal.SIGTERM)}
    try:
        with pytest.raises(SystemExit) as ended:
            getattr(entry, node)()
    finally:
        gc.enable()
        for k, handler in before.items():
            signal.signal(k, handler)
    assert ended.value.code == 0


def test_a_node_itself_gets_signals_as_processes_do(monkeypatch):
    before = [signal.getsignal(k) for k in (signal.SIGINT, signal.SIGTERM)]
    seen = []

    class Module:
        @staticmethod
        def program(_):
            return main

    def main(args):
        assert args is None  # those of the process
        seen.extend(signal.getsignal(k) for k in (signal.SIGINT, signal.SIGTERM))
        return 2

    monkeypatch.setattr(entry, 'import_module', lambda *_: Module)
    try:
        assert entry.controller() == 2
    finally:
        gc.enable()
    assert seen == before


def test_garbage_is_looked_for_once_a_node_runs(rig):
    found = []

    def starting():
        found.append(gc.isenabled())
        node = Node('starting')
        node.create_timer(0.001, lambda: (found.append(gc.isenabled()), rclpy.shutdown()))
        return node

    gc.disable()
    try:
        assert run_nodes([starting], []) == 0
    finally:
        gc.enable()
    assert found == [False, True]
