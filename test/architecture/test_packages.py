"""The packages are described as ROS 2 wants it, and say all that they need of it."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

package = pytest.importorskip('catkin_pkg.package')

ROOT = Path(__file__).resolve().parents[2]
OF_ROS = re.compile(r'(rclpy|launch|launch_ros|\w+_(msgs|srvs|interfaces))$')
STARTED = {'robot_state_publisher', 'rviz2'}  # by the launch file


def imported(folder: str) -> set[str]:
    """Packages of ROS that a folder imports."""
    names = set()
    for path in (ROOT / folder).rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Import):
                names |= {alias.name.partition('.')[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names.add(node.module.partition('.')[0])
    return {name for name in names if OF_ROS.match(name)}


def messages(text: str) -> set[str]:
    """Packages whose messages are made by name."""
    return set(re.findall(r"'(\w+_msgs|\w+_interfaces)/(?:msg|action)/", text))


@pytest.mark.parametrize('folder', ['.', 'msg_defs'])
def test_the_description_of_a_package_is_valid(folder):
    warnings: list[str] = []
    described = package.parse_package(ROOT / folder, warnings=warnings)
    described.validate(warnings=warnings)
    assert warnings == []
    assert described.licenses == ['Apache-2.0']
    assert 'Apache License' in (ROOT / 'LICENSE').read_text(encoding='utf-8')


def test_what_is_used_of_ros_is_what_the_package_depends_on():
    described = package.parse_package(ROOT)
    stated = {d.name for d in described.exec_depends if not d.name.startswith('python3-')}
    used = imported('spacerobot_ros') | imported('launch') | STARTED
    for path in (ROOT / 'spacerobot_ros').rglob('*.py'):
        used |= messages(path.read_text(encoding='utf-8'))
    assert stated == used
