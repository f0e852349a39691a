"""How a process shares the processor: the node option `scheduling`."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

_LOWEST_REAL_TIME = 1  # before all that is not real time, after the kernel's own threads
_BEHIND = 10  # of 19: a tenth of the processor where others want it all


def run_first() -> None:
    """Run all threads of this process as soon as they can (SCHED_FIFO), where that is permitted.

    It is for root, and within the limit `rtprio` of a user. Not on a lone processor: a loop that
    cannot keep up would leave the kernel's 5 % to all others, its sensors among them.
    """
    if len(os.sched_getaffinity(0)) < 2:
        return
    policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    with suppress(OSError):
        for thread in Path('/proc/self/task').iterdir():
            os.sched_setscheduler(int(thread.name), policy, os.sched_param(_LOWEST_REAL_TIME))


def run_last() -> None:
    """Run this thread, and those that it starts from now on, behind all others (nice)."""
    os.nice(_BEHIND)


SCHEDULING: dict[str, Callable[[], None]] = {
    'none': lambda: None,
    'nice': run_last,
    'fifo': run_first,
}

"""By value of the option."""
