"""How messages travel between processes: by UDP, not through Fast DDS's shared memory.

A process that is killed while it holds the mutex of a port in shared memory stops everybody who
publishes to that port, for ever: they wait for it in `SharedMemManager::Port::regenerate_port` of
Fast DDS 3.2.3 (docs/faults.md). UDP on the loopback device has nothing that a dead process holds.
"""

from __future__ import annotations

import os
from pathlib import Path

from rclpy.utilities import get_rmw_implementation_identifier

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
_CHOSEN = {
    'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4',
    'FASTDDS_DEFAULT_PROFILES_FILE': str(Path(__file__).with_name('fastdds_localhost.xml')),
}
_OTHERS = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'ROS_STATIC_PEERS')


def avoid_shared_memory() -> None:
    """Set this process's environment so that Fast DDS uses UDP alone; before `rclpy.init`.

    What the user has chosen of Fast DDS's own settings stays; another middleware is left alone. In
    the range LOCALHOST rmw_fastrtps adds shared memory whatever these say: a profile describes
    that range without it.
    """
    is_chosen = any(os.environ.get(name, ours) != ours for name, ours in _CHOSEN.items())
    if is_chosen or any(map(os.environ.get, _OTHERS)):
        return
    if not get_rmw_implementation_identifier().startswith('rmw_fastrtps'):
        return
    os.environ['FASTDDS_BUILTIN_TRANSPORTS'] = _CHOSEN['FASTDDS_BUILTIN_TRANSPORTS']
    if os.environ.get(RANGE) == 'LOCALHOST':
        os.environ |= _CHOSEN | {RANGE: 'SYSTEM_DEFAULT'}
