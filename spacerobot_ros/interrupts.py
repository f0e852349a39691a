"""Ctrl-C where it does no harm."""

from __future__ import annotations

import _thread
import inspect
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

_AGAIN = 0.05  # s after which an interrupt that had to wait is tried again
_UNSAFE = ('numba', 'llvmlite', 'importlib._bootstrap', '_frozen_importlib')
"""Modules that an exception must not leave in the middle. llvmlite's callbacks lose one, and what
numba has half loaded is freed in an order that crashes; a C module whose import is interrupted
turns it into an ImportError, which would pass for something that is not installed."""


@contextmanager
def interruptible(is_answered: Callable[[], object] = lambda: False) -> Iterator[None]:
    """Raise KeyboardInterrupt on Ctrl-C, once no module or kernel is half loaded.

    Only the main thread gets signals; where somebody else handles them, nothing changes.

    Args:
        is_answered: Whether somebody else ends what is interrupted, and nothing is raised.
    """

    def answer(number: int, frame: FrameType | None) -> None:
        if not is_answered():
            _interrupt(number, frame)

    before = signal.getsignal(signal.SIGINT)
    is_ours = (
        before is signal.default_int_handler
        and threading.current_thread() is threading.main_thread()
    )
    if is_ours:
        signal.signal(signal.SIGINT, answer)
    try:
        yield
    finally:
        if is_ours:
            signal.signal(signal.SIGINT, before)


@contextmanager
def held_back() -> Iterator[Callable[[], None]]:
    """Have Ctrl-C wait for the next call of what is yielded, or for the end of the block.

    Executors of rclpy log what is raised in a callback as a fault of the node.
    """
    waiting: list[int] = []
    before = signal.getsignal(signal.SIGINT)
    is_ours = callable(before) and threading.current_thread() is threading.main_thread()

    def let_through() -> None:
        if waiting and callable(before):
            before(waiting.pop(), inspect.currentframe())

    if is_ours:
        signal.signal(signal.SIGINT, lambda number, _: waiting.append(number))
    try:
        yield let_through
    finally:
        if is_ours:
            signal.signal(signal.SIGINT, before)
    let_through()


def _interrupt(number: int, frame: FrameType | None) -> None:
    while frame is not None:
        if str(frame.f_globals.get('__name__')).startswith(_UNSAFE):
            again = threading.Timer(_AGAIN, _thread.interrupt_main)
            again.daemon = True
            again.start()
            return
        frame = frame.f_back
    raise KeyboardInterrupt
