"""Say whether this Python can run spacerobot_ros: nothing when it can, else one line and exit 1.

Runs on any Python 3, however old, because it is the first thing that a candidate is given.
"""

import os
import sys
import sysconfig

OLDEST = (3, 10)
NEWEST_WITH_WHEELS = (3, 13)


def sourced_ros(environ: 'dict[str, str]', root: str) -> 'list[str]':
    """Return the prefixes of a sourced ROS 2 installation outside root; empty without one."""
    inside = os.path.join(os.path.realpath(root), '')
    prefixes = [
        prefix
        for prefix in environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
        if prefix and not os.path.realpath(prefix).startswith(inside)
    ]
    is_sourced = environ.get('ROS_DISTRO') and any(has_rclpy(prefix) for prefix in prefixes)
    return prefixes if is_sourced else []


def has_rclpy(prefix: str) -> bool:
    """Return whether an installation prefix is the one that ROS 2's Python library is in."""
    return os.path.exists(os.path.join(prefix, 'share', 'rclpy', 'package.xml'))


def why_unfit(is_sourced: bool) -> str:
    """Return why this interpreter cannot be used; empty when it can."""
    version = '.'.join(str(part) for part in sys.version_info[:3])
    if sys.implementation.name != 'cpython':
        return 'is ' + sys.implementation.name + ' ' + version
    if sysconfig.get_config_var('Py_GIL_DISABLED'):
        return 'is ' + version + ' without the GIL'
    if sys.version_info[:2] < OLDEST:
        return 'is ' + version
    if not is_sourced and sys.version_info[:2] > NEWEST_WITH_WHEELS:
        return 'is ' + version
    if not os.path.exists(os.path.join(sysconfig.get_path('include'), 'Python.h')):
        return 'is ' + version + ' without its headers (on Debian: apt install python3-dev)'
    try:
        import ensurepip  # noqa: F401
        import venv  # noqa: F401
    except ImportError:
        return 'is ' + version + ' without venv (on Debian: apt install python3-venv)'
    return why_no_rclpy(version) if is_sourced else ''


def why_no_rclpy(version: str) -> str:
    """Return why the sourced ROS 2 does not work with this interpreter; empty when it does."""
    try:
        import numpy  # noqa: F401
        import rclpy  # noqa: F401, TID251
    except ImportError as error:
        return 'is ' + version + ', which the sourced ROS 2 does not fit (' + str(error) + ')'
    return ''


if __name__ == '__main__':
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    reason = why_unfit(bool(sourced_ros(dict(os.environ), root)))
    if reason:
        sys.stdout.write(reason.replace('\n', ' ') + '\n')
        sys.exit(1)
