"""What nodes load before they are at work: a killed one is waited for, and memory is small."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import spacerobot_ros.control

pytestmark = pytest.mark.ros

_LOADS = """
import sys
from spacerobot_ros.nodes.program import node_class
node_class({node!r})
print(*sys.modules)
"""
LIBRARIES = ('matplotlib', 'mujoco', 'pinocchio', 'pytest', 'rich', 'rosbags')
OF_SCIPY = tuple(
    f'scipy.{room}'
    for room in (
        *('constants', 'fft', 'integrate', 'interpolate', 'linalg', 'ndimage', 'optimize'),
        *('signal', 'sparse', 'spatial', 'special', 'stats'),
    )
)
"""They load when they are called first, which most are not in most runs."""
OUTSIDE = ('batch', 'cli', 'demo', 'excitation', 'report', 'recording.tables.table')
OTHERS = {
    'simulator': ('control.loop', 'diagnosis', 'estimation', 'identification.online'),
    'identifier': ('control.loop', 'diagnosis', 'simulation'),
    'controller': ('diagnosis', 'identification.online', 'simulation'),
    'monitor': ('control.loop', 'diagnosis.arms', 'identification.online', 'simulation'),
}
"""Rooms and files that are the business of other nodes."""


@pytest.mark.parametrize('node', OTHERS)
def test_a_node_loads_what_it_needs_alone(node):
    code = _LOADS.format(node=node)
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, check=True, text=True)
    loaded = set(done.stdout.split())
    assert f'spacerobot_ros.nodes.{node}' in loaded
    ours = {f'spacerobot_ros.{place}' for place in (*OUTSIDE, *OTHERS[node])}
    assert not loaded & {*LIBRARIES, *OF_SCIPY, *ours}


_SOLVERS = """
import sys
from spacerobot_ros.nodes.controller import load_solvers
load_solvers()
print(*sys.modules)
"""


def test_a_controller_in_real_time_loads_nothing_in_its_loop():
    done = subprocess.run(
        [sys.executable, '-c', _SOLVERS], capture_output=True, check=True, text=True
    )
    (folder,) = spacerobot_ros.control.__path__
    texts = [path.read_text(encoding='utf-8') for path in Path(folder).rglob('*.py')]
    called = {room for text in texts for room in re.findall(r'(scipy\.\w+)\.', text)}
    assert called
    assert called <= set(done.stdout.split())


_BEGINS = """
import sys
from validation.faults import own_process
print(*(m for m in ('numpy', 'rclpy', 'spacerobot_ros.batch') if m in sys.modules))
"""


def test_a_process_of_a_trial_begins_with_nothing_that_a_node_does_not_load_itself():
    done = subprocess.run([sys.executable, '-c', _BEGINS], capture_output=True, check=True)
    assert done.stdout.split() == []
