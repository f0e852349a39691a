"""The `effects:` section in all nodes: declared, believed, simulated, refused."""

import numpy as np
import pytest

from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.nodes.controller import ControllerNode
from spacerobot_ros.nodes.identifier import IdentifierNode
from spacerobot_ros.nodes.simulator import SimulatorNode

pytestmark = pytest.mark.ros

ALL = (SimulatorNode, IdentifierNode, ControllerNode)
DRAG = {
    'effects.elbow.effect': 'joint_viscous_friction',
    'effects.elbow.where': 'joint_2',
    'effects.elbow.coefficient': 3.1,
    'effects.wheels.effect': 'target_wheel_momentum',
    'effects.wheels.where': 'link_3',
    'effects.wheels.x': 1.0,
    'effects.wheels.y': 2.0,
    'effects.wheels.z': 3.0,
}


@pytest.mark.parametrize('node_type', ALL)
def test_every_node_takes_and_declares_effects(rig, servicer, node_type):
    node = rig.add(node_type, servicer, **DRAG)
    assert node.is_open
    assert node.get_parameter('effects.elbow.coefficient').value == 3.1
    assert node.get_parameter('effects.elbow.where').value == 'joint_2'


@pytest.mark.parametrize('node_type', ALL)
@pytest.mark.parametrize(
    ('change', 'message'),
    [
        (
            {'effects.elbow.coefficient': -1.0},
            r'effects\.elbow\.coefficient: -1 N m',
        ),
        ({'effects.elbow.where': 'joint_9'}, r"effects\.elbow\.where: .*no place 'joint_9'"),
        ({'effects.elbow.effect': 'joint_viscos_friction'}, 'did you mean joint_viscous_friction'),
        ({'effects.elbow.color': 1.0}, r'effects\.elbow\.color: .*no such parameter'),
    ],
)
def test_bad_effects_are_refused_at_the_start(rig, servicer, node_type, change, message):
    with pytest.raises(ConfigurationError, match=message):
        rig.add(node_type, servicer, **{**DRAG, **change})


def test_the_simulator_runs_them_and_the_others_believe_them(rig, servicer):
    simulator = rig.add(SimulatorNode, servicer, **DRAG)
    assert [effect.name for effect in simulator.plant.effects] == ['elbow', 'wheels']
    controller = rig.add(ControllerNode, servicer, **DRAG)
    np.testing.assert_array_equal(controller.loop.robot.target_momentum, [1.0, 2.0, 3.0])
