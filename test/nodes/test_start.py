"""What nodes load before they are at work: a killed one is waited for."""

import subprocess
import sys

import pytest

pytestmark = pytest.mark.ros

_LOADS = """
import sys
from spacerobot_ros.nodes.program import node_class
for name in ('identifier', 'monitor'):
    node_class(name)
print(*(m for m in ('integrate', 'interpolate', 'ndimage', 'optimize', 'signal', 'stats')
        if f'scipy.{m}' in sys.modules))
"""


def test_nodes_that_learn_start_without_what_they_solve_with():
    done = subprocess.run([sys.executable, '-c', _LOADS], capture_output=True, check=True)
    assert done.stdout.split() == []


_BEGINS = """
import sys
from spacerobot_ros.nodes.fault_trials import own_process
print(*(m for m in ('numpy', 'rclpy', 'spacerobot_ros.campaign') if m in sys.modules))
"""


def test_a_process_of_a_trial_begins_with_nothing_that_a_node_does_not_load_itself():
    done = subprocess.run([sys.executable, '-c', _BEGINS], capture_output=True, check=True)
    assert done.stdout.split() == []
