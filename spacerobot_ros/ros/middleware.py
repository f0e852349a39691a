"""How Fast DDS is set up, so that a process that is killed stops no other.

Two things of Fast DDS 3.2.3 do not survive SIGKILL (docs/faults.md has how often they did not):

- Shared memory: who publishes to a process that held the mutex of its port waits for ever in
  `SharedMemManager::Port::regenerate_port`. UDP on the loopback device has nothing to be held.
- Type lookup: endpoints of a type that a process does not know yet match when one of their
  participants has said what it is. Where the answer never comes, `TypeLookupManager` asks nobody
  else, and no endpoint of that type matches any more. Without it, names of types decide.

A participant that starts asks who is there, but of the answers some are lost: then it waits until
the others say so by themselves, every 3 s. On this machine they do twice a second, which takes a
thousandth of a processor of each: none of 24 nodes started anew was heard after more than 0.64 s,
where it had taken up to 3 s.
"""

from __future__ import annotations

import os
from pathlib import Path

from rclpy.utilities import get_rmw_implementation_identifier

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
_TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
_PROFILES = 'FASTDDS_DEFAULT_PROFILES_FILE'
_HERE = Path(__file__).parent
_OURS = {
    _TRANSPORTS: ('UDPv4',),
    _PROFILES: (str(_HERE / 'fastdds.xml'), str(_HERE / 'fastdds_localhost.xml')),
    'FASTRTPS_DEFAULT_PROFILES_FILE': (),
    'ROS_STATIC_PEERS': (),
}
"""What is set, by variable; of others the user alone."""


def set_up_middleware() -> None:
    """Set this process's environment for Fast DDS, before `rclpy.init`.

    What the user has chosen of Fast DDS's own settings stays; another middleware is left alone. In
    the range LOCALHOST rmw_fastrtps adds shared memory whatever its settings say: a profile
    describes that range without it.
    """
    if any(os.environ.get(name, '') not in ('', *ours) for name, ours in _OURS.items()):
        return
    if not get_rmw_implementation_identifier().startswith('rmw_fastrtps'):
        return
    os.environ[_TRANSPORTS] = 'UDPv4'
    anywhere, localhost = _OURS[_PROFILES]
    if os.environ.get(RANGE) == 'LOCALHOST':
        os.environ |= {RANGE: 'SYSTEM_DEFAULT', _PROFILES: localhost}
    else:
        os.environ.setdefault(_PROFILES, anywhere)
