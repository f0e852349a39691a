"""The executor of all nodes: rclpy's executor of events, where there is one (Kilted or later).

It takes half the processor time of the single-threaded one, which builds its wait set anew for
every callback.
"""

from __future__ import annotations

import io
import traceback

from rclpy import time_source
from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.logging import get_logger


def make_executor(context: Context | None = None) -> Executor:
    """An executor for the nodes of a context; None: the default one."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor

        return EventsExecutor(context=context)
    except (ImportError, io.UnsupportedOperation):  # before Kilted; or stderr is no file
        return SingleThreadedExecutor(context=context)


def spin_once(executor: Executor, timeout: float) -> None:
    """Run one callback, for which it waits for a while [s].

    rclpy's own listener to /clock raises ValueError at a time before zero: that is left out.
    """
    try:
        executor.spin_once(timeout_sec=timeout)
    except ValueError as error:
        frames = traceback.walk_tb(error.__traceback__)
        if not any(frame.f_code.co_filename == time_source.__file__ for frame, _ in frames):
            raise
        get_logger('clock').warning(
            '/clock: a time before zero is left out', throttle_duration_sec=2.0
        )
