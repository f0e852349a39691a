"""Say whether this Python can run spacerobot_ros: nothing when it can, else why not, and exit 1.

Runs on any Python 3, however old: it is the first thing that a candidate is given. The argument
`sourced` asks for one that fits the sourced ROS 2.
"""

import os
import sys
import sysconfig

OLDEST = (3, 10)
NEWEST_WITH_WHEELS = (3, 13)


def why_unfit(is_sourced: bool) -> str:
    """Return why this interpreter cannot be used; empty when it can."""
    version = '.'.join(str(part) for part in sys.version_info[:3])
    if sys.implementation.name != 'cpython':
        return sys.implementation.name + ' ' + version
    if sysconfig.get_config_var('Py_GIL_DISABLED'):
        return version + ' without the GIL'
    if sys.version_info[:2] < OLDEST:
        return version
    if not is_sourced and sys.version_info[:2] > NEWEST_WITH_WHEELS:
        return version
    if not os.path.exists(os.path.join(sysconfig.get_path('include'), 'Python.h')):
        return version + ' without its headers (on Debian: apt install python3-dev)'
    try:
        import ensurepip  # noqa: F401
        import venv  # noqa: F401
    except ImportError:
        return version + ' without venv (on Debian: apt install python3-venv)'
    try:
        if is_sourced:
            import numpy  # noqa: F401
            import rclpy  # noqa: F401, TID251
    except ImportError as error:
        return version + ', which the sourced ROS 2 does not fit (' + str(error) + ')'
    return ''


if __name__ == '__main__':
    reason = why_unfit('sourced' in sys.argv[1:])
    if reason:
        sys.stdout.write('is ' + reason.replace('\n', ' ') + '\n')
        sys.exit(1)
