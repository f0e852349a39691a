"""Which process computes first where several want the same processor (Linux)."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

_LOWEST_REAL_TIME = 1  # goes before all that is not real time, and after the kernel's own threads
_BEHIND = 10  # of 19: a tenth of the processor where somebody else wants it all


def answer_first() -> None:
    """Have all threads of this process run as soon as they can, where the system permits that.

    It does for root, and within the limit `rtprio` of a user. Not on a lone processor: a loop that
    can not keep up would leave the kernel's 5 % to all others, its sensors among them.
    """
    if len(os.sched_getaffinity(0)) < 2:
        return
    policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    with suppress(OSError):
        for thread in Path('/proc/self/task').iterdir():
            os.sched_setscheduler(int(thread.name), policy, os.sched_param(_LOWEST_REAL_TIME))


def give_way() -> None:
    """Have this thread and those that it starts from now on compute while nobody else wants to."""
    os.nice(_BEHIND)
