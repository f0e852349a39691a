"""How a process of a trial begins: with what a user's loads, and nothing else of the campaign."""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Callable
from multiprocessing import forkserver
from typing import Any

from spacerobot_ros.nodes.entry import start

_ENDS_WITH_PARENT = 1  # PR_SET_PDEATHSIG of sys/prctl.h


def alone(domain: int) -> dict[str, str]:
    """Environment of processes that hear each other and nobody else."""
    return {'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


def begin(domain: int, work: Callable[..., object], arguments: tuple[Any, ...]) -> None:
    """What a process does; it ends with the one that started it (Linux).

    Its parent is the fork server, which ends when nobody holds its pipe any more: as it shall with
    the campaign, however that ends, children let go of it.
    """
    ctypes.CDLL(None).prctl(_ENDS_WITH_PARENT, signal.SIGKILL)
    os.close(forkserver._forkserver._forkserver_alive_fd)  # type: ignore[attr-defined]
    os.environ.update(alone(domain))
    work(*arguments)


def run(node: str, arguments: list[str]) -> None:
    """Be a node until it is stopped."""
    raise SystemExit(start(node, arguments))
