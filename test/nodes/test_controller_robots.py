"""Controller node of robots that no identifier takes: joints that slide, a fixed base."""

from __future__ import annotations

import numpy as np
import pytest
from support.models import random_tree, to_urdf

from spacerobot_ros.nodes.controller import ControllerNode

pytestmark = pytest.mark.ros

PARTS = random_tree(np.random.default_rng(11), [0, 1, 2], prismatic=(2,))


@pytest.mark.parametrize('base', ['free', 'fixed'])
def test_it_takes_up_a_robot_without_an_identifier(rig, base):
    parameters = {
        'robot_description': to_urdf(PARTS),
        'robot.base': base,
        'robot.joints': [part.joint for part in PARTS[1:]],
    }
    node = rig.add(ControllerNode, parameters)
    rig.until(lambda: node.is_open)
    assert node.loop.robot.bodies[2].is_prismatic
