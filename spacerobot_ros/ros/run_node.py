"""Run one node as a process, with errors as one line and an exit status."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

from ..errors import ConfigurationError, SpaceRobotError
from ..model.files import read_yaml

CONFIGURATION = (ConfigurationError, ParameterException, rclpy_implementation.RCLError)
STOPPED = (rclpy_implementation.RCLError, rclpy_implementation.InvalidHandle)


def run_node(factory: Callable[[], Node], args: Sequence[str] | None = None) -> int:
    """Spin a node until it is stopped.

    Args:
        factory: Makes the node.
        args: Command line; None: that of the process.

    Returns:
        0 when stopped from outside, 1 when the run failed, 2 for an unusable configuration.
    """
    try:
        _check_parameter_files(sys.argv if args is None else args)
        with rclpy.init(args=None if args is None else list(args)):
            node = factory()
            try:
                rclpy.spin(node)
            except STOPPED:
                if rclpy.ok():  # otherwise stopped in the middle of a callback
                    raise
            finally:
                node.destroy_node()
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
