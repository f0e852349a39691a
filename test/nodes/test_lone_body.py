"""Simulator node of a robot without joints, whose thrusters fire as scheduled."""

from __future__ import annotations

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from support.lone_body import BOX

from spacerobot_ros.nodes.simulator import SimulatorNode
from spacerobot_ros.ros.qos import SAMPLES

pytestmark = pytest.mark.ros


def test_firings_act_and_are_published(rig):
    parameters = {
        'robot_description': BOX.format(com='0 0 0'),
        'robot.joints': [],
        'robot.thrusters.T1.at': [0.0, 0.5, 0.0],
        'robot.thrusters.T1.direction': [1.0, 0.0, 0.0],
        'robot.thrusters.T1.force': 0.8,
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
