"""Run nodes as a process, with errors as one line and an exit status."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path

import rclpy
from rclpy.exceptions import NotInitializedException, ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

from ..errors import ConfigurationError, SpaceRobotError
from ..interrupts import interruptible
from ..model.files import read_yaml
from .executor import make_executor, spin_once
from .middleware import set_up_middleware
from .scheduling import SCHEDULING

_LOOK = 0.1  # s between two looks at whether a signal has ended the context
SWITCH = 5e-4  # s after which a thread that computes lets callbacks go on; a tenth of Python's
CONFIGURATION = (ConfigurationError, ParameterException, rclpy_implementation.RCLError)
# RCLError is one; the executor of events reports what a callback raises then as another
STOPPED = (RuntimeError, rclpy_implementation.InvalidHandle, NotInitializedException)


def run_nodes(factories: Sequence[Callable[[], Node]], args: Sequence[str] | None = None) -> int:
    """Spin nodes in one process until they are stopped.

    Args:
        factories: Make the nodes; the last one's parameter `scheduling` is that of the process.
        args: Command line; None: that of the process.

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
                executor = make_executor()
                for factory in factories:
                    node = factory()
                    stack.callback(node.destroy_node)
                    executor.add_node(node)
                    stack.callback(executor.remove_node, node)
                gc.freeze()  # what stays is no garbage: looking for it takes 0.1 s now and then
                gc.enable()
                if node.has_parameter('scheduling'):
                    SCHEDULING[node.get_parameter('scheduling').value]()
                while rclpy.ok():
                    spin_once(executor, _LOOK)
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
