"""Branches whose torques nobody measures."""

from __future__ import annotations

import pytest
from support.models import random_tree, robot_of

from spacerobot_ros.estimation.balance.anchor import branches


@pytest.mark.parametrize('is_turned', [False, True])
def test_branches_do_not_depend_on_the_order_of_the_joints(rng, is_turned):
    parts = random_tree(rng, [0, 1, 0, 3, 4])
    joints = [part.joint for part in parts[1:]][:: -1 if is_turned else 1]
    robot = robot_of(parts, joints, base='fixed')
    named = [{robot.joints[j] for j in branch} for branch in branches(robot)]
    expected = [{part.joint for part in some} for some in (parts[1:3], parts[3:])]
    assert sorted(named, key=sorted) == sorted(expected, key=sorted)
