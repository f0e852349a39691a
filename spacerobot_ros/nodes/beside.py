"""Work that takes long, beside the callbacks: one piece at a time, on a thread of its own."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from threading import Thread
from typing import Any

from rclpy.node import Node
from rclpy.task import Future

STOP = 1.0  # s that the end of a node waits for what is under way


class Beside:
    """Runs a piece of work on a thread, and hands its result to a callback of the node.

    Compiled kernels hold no lock of Python, so callbacks go on meanwhile.

    Args:
        node: Whose executor runs what follows on the work.
        is_threaded: Whether there is a thread; otherwise all is done at once, so that the order
            of callbacks alone decides what happens when.

    Attributes:
        is_busy: Whether a piece of work has been begun whose result was not handed over yet.
    """

    def __init__(self, node: Node, *, is_threaded: bool) -> None:
        self.is_threaded = is_threaded
        self.is_busy = False
        self._node = node
        self._thread: Thread | None = None
        self._outcome: Callable[[], None] | None = None
        self._handed_over: Future[None] = Future()

    def start(self, work: Callable[[], Any], then: Callable[[Any], None]) -> None:
        """Begin a piece of work, unless one is under way.

        Args:
            work: The work; what it raises ends the node.
            then: Takes what it returns, among the node's callbacks.
        """
        if not self.is_threaded:
            then(work())
        elif not self.is_busy:
            self.is_busy = True
            self._handed_over = Future()
            # at the end of a process that could not wait for it, it must not keep it alive
            self._thread = Thread(target=self._run, args=(work, then), daemon=True)
            self._thread.start()

    async def do(self, work: Callable[[], Any]) -> Any:
        """Have a piece of work done when those before it are, and wait for what it returns.

        Callbacks go on meanwhile, but those of the same group.
        """
        while self.is_busy:
            await self._handed_over
        returned: list[Any] = []
        self.start(work, returned.append)
        while not returned:
            await self._handed_over
        return returned[0]

    def finish(self, seconds: float) -> bool:
        """Wait for the work under way and hand its result over; whether that was done in time."""
        if self._thread is not None:
            self._thread.join(seconds)
            self._hand_over()
        return not self.is_busy

    def end(self, seconds: float) -> None:
        """Wait for the work under way, whose result nobody takes any more."""
        if self._thread is not None:
            self._thread.join(seconds)

    def _run(self, work: Callable[[], Any], then: Callable[[Any], None]) -> None:
        try:
            self._outcome = partial(then, work())
        except BaseException as error:  # noqa: BLE001  raised again where it is seen
            self._outcome = partial(_raise, error)
        executor = self._node.executor
        if executor is not None:
            executor.create_task(self._hand_over)

    def _hand_over(self) -> None:
        outcome, self._outcome = self._outcome, None
        if outcome is not None:
            self.is_busy = False
            outcome()
            self._handed_over.set_result(None)
            if self._node.executor is not None:
                self._node.executor.wake()  # which looks at who awaits this before it sleeps


def _raise(error: BaseException) -> None:
    raise error
