"""What `ros2 run` and launch files start: a signal ends it while modules load, too.

Loading takes seconds on a busy machine, and modules written in C may lose a KeyboardInterrupt.
"""

from __future__ import annotations

import os
import signal
from functools import partial
from importlib import import_module
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def _stop(number: int, frame: FrameType | None) -> None:
    os._exit(0)  # there is nothing yet that must be ended properly


def _start(node: str) -> int:
    before = {number: signal.signal(number, _stop) for number in _SIGNALS}
    main = import_module('.program', __package__).program(node)
    for number, handler in before.items():
        signal.signal(number, handler)
    status: int = main()
    return status


simulator = partial(_start, 'simulator')
identifier = partial(_start, 'identifier')
controller = partial(_start, 'controller')
monitor = partial(_start, 'monitor')
composed = partial(_start, 'composed')
