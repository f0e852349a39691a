"""Simulator node of a robot without joints, whose thrusters fire as scheduled."""

from __future__ import annotations

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from spacerobot_msgs.msg import Tracking
from support.lone_body import BOX
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from spacerobot_ros.nodes.controller import ControllerNode
from spacerobot_ros.nodes.monitor import MonitorNode
from spacerobot_ros.nodes.simulator import SimulatorNode
from spacerobot_ros.ros.qos import SAMPLES, STATE

pytestmark = pytest.mark.ros

THRUSTER = {
    'robot_description': BOX.format(com='0 0 0'),
    'robot.joints': [],
    'robot.thrusters.T1.at': [0.0, 0.5, 0.0],
    'robot.thrusters.T1.direction': [1.0, 0.0, 0.0],
    'robot.thrusters.T1.force': 0.8,
}


@pytest.mark.parametrize(
    ('names', 'shares', 'reason'),
    [
        (['T9'], [1.0], 'thrusters: lacks T1 and has foreign T9'),
        (['T1'], [1.5], 'T1: commands are shares from # to #, got #'),
        (['T1'], [float('nan')], 'effort is not finite'),
        (['T1'], [], 'effort has # entries for # joints'),
    ],
)
def test_commands_that_are_none_are_counted_by_the_monitor(rig, names, shares, reason):
    node, probe = rig.add(MonitorNode, THRUSTER), rig.plain()
    publisher = probe.create_publisher(JointState, '/thruster_commands', SAMPLES)
    publisher.publish(JointState(name=names, effort=shares))
    rig.until(lambda: node.health.count())
    assert node.health.rejected['/thruster_commands', reason] == 1


def test_firings_act_and_are_published(rig):
    parameters = THRUSTER | {
        'firings.a.thruster': 'T1',
        'firings.a.start': 0.01,
        'firings.a.width': 0.015,
        'simulator.period': 0.01,
    }
    heard = rig.listen(rig.plain('ears'), JointState, '/thruster_commands', SAMPLES)
    sim = rig.add(SimulatorNode, parameters)
    rig.until(lambda: sim.is_open)
    for _ in range(4):
        sim.step()
    rig.until(lambda: len(heard) >= 5)

    assert [list(message.name) for message in heard[:5]] == [['T1']] * 5
    np.testing.assert_allclose([m.effort[0] for m in heard[:5]], [0, 1, 0.5, 0, 0], atol=1e-12)
    # 0.015 s of 0.8 N at 0.5 m on 0.40 kg m^2; turning by 1e-4 rad changes nothing of it
    rate = sim.plant.state.omega_WB_B
    np.testing.assert_allclose(rate, [0.0, 0.0, -0.015 * 0.8 * 0.5 / 0.40], atol=1e-6)


def test_the_monitor_hears_the_rates_of_its_own_wheels(rig):
    wheel = '<inertia ixx="0.002" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/>'
    rotor = (
        f'<link name="rotor"><inertial><mass value="1"/>{wheel}</inertial></link>'
        '<joint name="rw" type="continuous"><parent link="base_link"/><child link="rotor"/>'
        '<axis xyz="1 0 0"/></joint></robot>'
    )
    urdf = BOX.format(com='0 0 0').replace('</robot>', rotor)
    parameters = {
        'robot_description': urdf,
        'robot.joints': [],
        'robot.servicer_wheels.joints': ['rw'],
        'robot.servicer_wheels.rates': [100.0],
    }
    node, probe = rig.add(MonitorNode, parameters), rig.plain()
    publisher = probe.create_publisher(JointState, '/wheel_states', SAMPLES)
    publisher.publish(JointState(name=['other', 'rw'], velocity=[1.0, 120.0]))
    publisher.publish(JointState(name=['other'], velocity=[1.0]))
    rig.until(lambda: node.health.count())
    assert node.health.rejected['/wheel_states', 'joint names: lacks rw'] == 1
    names, heard = node.monitor.samples.inputs['wheels']
    assert list(names) == ['rw']
    np.testing.assert_array_equal(heard.values, [[120.0]])


@pytest.mark.parametrize('law', ['computed_torque', 'passivity', 'adaptive_composite'])
def test_a_controller_has_no_joints_to_move(rig, law):
    parameters = {'robot_description': BOX.format(com='0 0 0'), 'robot.joints': []}
    node = rig.add(ControllerNode, parameters | {'controller.law': law})
    sim = rig.add(SimulatorNode, parameters | {'initial.angular_velocity': [0.02, 0.0, -0.01]})
    probe = rig.plain()
    heard = rig.listen(probe, Tracking, '/tracking', SAMPLES)
    motions = probe.create_publisher(JointTrajectory, '/reference', STATE)
    for points in (1, 3):
        motions.publish(JointTrajectory(points=[JointTrajectoryPoint()] * points))
    for _ in range(5):
        sim.step()
        rig.deliver()
    rig.until(lambda: len(heard) >= 5)
    assert heard[-1].max_error == 0.0
    assert node.health.count('/reference') == 1  # times that do not increase
    control = next(s for s in node.health.statuses() if s.name == 'control')
    assert control.message in ('tracking', 'hold')
