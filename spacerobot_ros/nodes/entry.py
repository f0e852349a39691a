"""What `ros2 run` and launch files start: a signal ends it while modules load, too.

Loading takes seconds on a busy machine, and modules written in C may lose a KeyboardInterrupt.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Sequence
from functools import partial
from importlib import import_module
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def _stop(number: int, frame: FrameType | None) -> None:
    os._exit(0)  # there is nothing yet that must be ended properly


def start(node: str, args: Sequence[str] | None = None) -> int:
    """Run a node, or all as `composed`, until it is stopped; its exit status.

    It is 2 where something is not installed.

    Args:
        node: Its name.
        args: Command line; None: that of the process.
    """
    gc.disable()  # until it runs: nothing that is loaded is garbage, and looking takes 0.1 s
    before = {number: signal.signal(number, _stop) for number in _SIGNALS}
    try:
        main = import_module('.program', __package__).program(node)
    except ImportError as error:
        if (error.name or '').startswith('spacerobot_ros'):
            raise
        from ..requirements import why_missing

        sys.stderr.write(f'{node}: {why_missing(error)}\n')
        return 2
    for number, handler in before.items():
        signal.signal(number, handler)
    status: int = main(args)
    return status


simulator = partial(start, 'simulator')
identifier = partial(start, 'identifier')
controller = partial(start, 'controller')
monitor = partial(start, 'monitor')
composed = partial(start, 'composed')
