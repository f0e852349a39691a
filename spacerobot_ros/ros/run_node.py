"""Run nodes as a process, with errors as one line and an exit status."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import rclpy
from rclpy.exceptions import NotInitializedException, ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

from ..errors import ConfigurationError, SpaceRobotError
from ..interrupts import interruptible
from ..model.files import read_yaml
from .middleware import set_up_middleware

SWITCH = 5e-4  # s after which a thread that computes lets callbacks go on; a tenth of Python's
CONFIGURATION = (ConfigurationError, ParameterException, rclpy_implementation.RCLError)
STOPPED = (
    rclpy_implementation.RCLError, rclpy_implementation.InvalidHandle, NotInitializedException,
)  # fmt: skip


def run_nodes(
    factories: Sequence[Callable[[], Node]],
    args: Sequence[str] | None = None,
    schedule: Callable[[Any], object] = lambda node: None,
) -> int:
    """Spin nodes in one process until they are stopped.

    Args:
        factories: Make the nodes.
        args: Command line; None: that of the process.
        schedule: Called with the last of the nodes when all are there.

    Returns:
        0 when stopped from outside, 1 when the run failed, 2 for an unusable configuration.
    """
    sys.setswitchinterval(SWITCH)
    set_up_middleware()
    try:
        _check_parameter_files(sys.argv if args is None else args)
        with ExitStack() as stack:
            # an exception within rclpy's calls would pass for an error: it stops them by itself
            running: list[object] = []
            stack.enter_context(interruptible(running.copy))
            running += [stack.enter_context(rclpy.init(args=None if args is None else list(args)))]
            try:
                executor = SingleThreadedExecutor()
                for factory in factories:
                    node = factory()
                    stack.callback(node.destroy_node)
                    executor.add_node(node)
                gc.freeze()  # what stays is no garbage: looking for it takes 0.1 s now and then
                gc.enable()
                schedule(node)
                executor.spin()
            except STOPPED:
                if rclpy.ok():  # otherwise stopped while nodes were made, or in a callback
                    raise
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    except CONFIGURATION as error:
        return _fail(error, 2)
    except SpaceRobotError as error:
        return _fail(error, 1)
    return 0


def _check_parameter_files(args: Sequence[str]) -> None:
    """Refuse what rcl takes in silence: of a key that is given twice it takes the last."""
    for option, path in pairwise(args):
        if option == '--params-file':
            read_yaml(Path(path), 'parameter file')


def _fail(error: Exception, status: int) -> int:
    line = ' '.join(str(error).split())
    if 'required parameter is missing' in line:
        line += '; give a robot file: --ros-args --params-file FILE.yaml'
    sys.stderr.write(f'{line}\n')
    return status


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
