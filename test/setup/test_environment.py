"""env.sh, in a workspace that is set up."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(
        not (ROOT / 'install' / 'spacerobot-stamp').exists(), reason='not set up: make setup'
    ),
]
CLEARED = ('AMENT_PREFIX_PATH', 'CMAKE_PREFIX_PATH', 'PYTHONPATH', 'LD_LIBRARY_PATH')
OURS = ('ROS_AUTOMATIC_DISCOVERY_RANGE', '_ROS_WHEELS_BOOTSTRAP_COMPLETE', 'VIRTUAL_ENV')


def in_shell(script, **environ):
    """Run a bash script after `source env.sh`, from another folder; return its output's lines."""
    env = {name: value for name, value in os.environ.items() if name not in OURS}
    if not os.environ.get('ROS_DISTRO'):  # else the sourced ROS 2 has to stay
        env = {name: value for name, value in env.items() if name not in CLEARED}
    done = subprocess.run(
        ['bash', '--noprofile', '--norc', '-c', f'set -u; source {ROOT}/env.sh\n{script}'],
        cwd='/', env={**env, **environ}, capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    return done.stdout.splitlines()


def test_messages_and_package_are_found():
    lines = in_shell(
        'python -c "import rclpy, spacerobot_ros; from spacerobot_msgs.msg import Estimate;'
        ' print(spacerobot_ros.__file__)"; command -v spacerobot'
    )
    assert lines == [f'{ROOT}/spacerobot_ros/__init__.py', f'{ROOT}/.venv/bin/spacerobot']


def test_discovery_stays_on_this_machine_unless_told_otherwise():
    show = 'echo $ROS_AUTOMATIC_DISCOVERY_RANGE'
    assert in_shell(show) == ['LOCALHOST']
    assert in_shell(show, ROS_AUTOMATIC_DISCOVERY_RANGE='SUBNET') == ['SUBNET']


def test_sourcing_twice_changes_nothing_and_leaves_nothing_behind():
    show = 'env | sort | grep -E "PATH|ROS_|VIRTUAL"'
    assert in_shell(show) == in_shell(f'source {ROOT}/env.sh; {show}')
    assert in_shell('set | grep "^_spacerobot" || true') == []


def test_every_program_is_installed():
    folder = ROOT / 'install' / 'spacerobot_ros' / 'lib' / 'spacerobot_ros'
    programs = {path.name for path in (ROOT / 'programs').iterdir()}
    assert programs >= {'simulator', 'identifier', 'controller', 'monitor', 'composed'}
    assert {path.name for path in folder.iterdir() if os.access(path, os.X_OK)} == programs
