"""What is needed and not found, in one line with the command that brings it."""

from __future__ import annotations

import re
from importlib.metadata import PackageNotFoundError, requires, version

MESSAGES = 'spacerobot_msgs'
BUILD = 'colcon build --base-paths src src/spacerobot_ros/msg_defs'
"""Builds messages and package in a ROS 2 workspace."""
LIBRARIES = 'pip install --no-deps -r src/spacerobot_ros/requirements/sourced.txt'
"""Installs what a ROS 2 distribution does not have."""
SET_UP = 'make setup, then source env.sh'


def why_missing(error: ImportError) -> str:
    """Say what an import lacks: the messages, a library, or a newer version of one.

    Args:
        error: What the import raised.
    """
    missing = (error.name or '').partition('.')[0]
    if missing == MESSAGES:
        return f'{MESSAGES} is not built: {SET_UP}; in a ROS 2 workspace: {BUILD}'
    if missing in ('rclpy', 'ament_index_python') or missing.endswith(('_msgs', '_srvs')):
        return f'{missing} is not installed: source your ROS 2, or {SET_UP}'
    what = _outdated() or (
        f'{missing} is not installed' if isinstance(error, ModuleNotFoundError) else str(error)
    )
    return f'{what}: {SET_UP}; with a ROS 2 distribution: {LIBRARIES}'


def _outdated() -> str:
    """The first library that is older than needed; empty where none is."""
    for needed in _needed():
        if match := re.fullmatch(r'([\w.-]+)>=([\d.]+)', needed):
            try:
                found = version(match[1])
            except PackageNotFoundError:
                continue  # what it has may come from elsewhere, or the error names it
            if _numbers(found) < _numbers(match[2]):
                return f'{match[1]} {found} is too old, {needed} is needed'
    return ''


def _needed() -> list[str]:
    try:
        return requires(__package__) or []
    except PackageNotFoundError:  # a checkout that was not installed
        return []


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(int(number) for number in re.findall(r'\d+', text))
