"""Ctrl-C where it does no harm."""

from __future__ import annotations

import inspect
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_UNSAFE = ('numba', 'llvmlite', 'importlib._bootstrap', '_frozen_importlib')
"""Modules that an exception must not leave in the middle. llvmlite's callbacks lose one, and what
numba has half loaded is freed in an order that crashes; a C module whose import is interrupted
turns it into an ImportError, which would pass for something that is not installed."""


@contextmanager
def interruptible() -> Iterator[None]:
    """Raise KeyboardInterrupt on Ctrl-C, once no module or kernel is half loaded.

    Only the main thread gets signals; where somebody else handles them, nothing changes.
    """
    is_ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    answer = (lambda _, frame: _raise_outside(frame)) if is_ours else None
    with _handler(answer, signal.SIGINT):
        yield


@contextmanager
def noted(*numbers: int) -> Iterator[list[int]]:
    """Have signals do nothing but stand in the list that is yielded."""
    came: list[int] = []
    with _handler(lambda number, _: came.append(number), *numbers):
        yield came


@contextmanager
def held_back() -> Iterator[Callable[[], None]]:
    """Have Ctrl-C wait for the next call of what is yielded, or for the end of the block.

    Executors of rclpy log what is raised in a callback as a fault of the node.
    """
    waiting: list[int] = []
    before = signal.getsignal(signal.SIGINT)

    def let_through() -> None:
        if waiting and callable(before):
            before(waiting.pop(), inspect.currentframe())

    note = (lambda number, _: waiting.append(number)) if callable(before) else None
    with _handler(note, signal.SIGINT):
        yield let_through
    let_through()


@contextmanager
def _handler(
    answer: Callable[[int, FrameType | None], None] | None, *numbers: int
) -> Iterator[None]:
    """Have signals call a function within the block, where this is the main thread."""
    if answer is None or threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, answer) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _raise_outside(frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt now, or in the innermost caller of all that is unsafe.

    Python calls a frame's trace function before its next instruction, so it is raised as soon as
    the caller goes on, whatever becomes of the handler meanwhile.
    """
    outside = begun = frame
    while frame is not None:
        if str(frame.f_globals.get('__name__')).startswith(_UNSAFE):
            outside = frame.f_back
        frame = frame.f_back
    if outside is begun or outside is None:
        raise KeyboardInterrupt
    outside.f_trace, outside.f_trace_opcodes = _interrupt, True
    sys.settrace(lambda *_: None)


def _interrupt(frame: FrameType, *_: Any) -> None:
    frame.f_trace, frame.f_trace_opcodes = None, False
    sys.settrace(None)
    raise KeyboardInterrupt
