"""Bags around events: the newest messages are kept, and written when something happens.

They are written beside the callbacks: nobody waits for the disk.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypeAlias

from rclpy.node import Node

from ..errors import RecordingError
from ..recording.bags.bag_writer import BagWriter
from ..ros.session import Recorder
from .beside import STOP, Beside

_Message: TypeAlias = tuple[str, str, int, bytes]  # topic, type, stamp [ns], serialized
_Coming: TypeAlias = 'SimpleQueue[_Message | None]'
_SILENCE = 0.5  # s without a message, after which the disk has what came before
_LATENESS_NS = 10_000_000_000  # by which an event may be noticed after it happened


class EventRecorder:
    """Records topics from a while before an event to a while after it.

    Args:
        node: Node to listen with.
        topics: Message class of every topic; each message begins with its stamp.
        folder: Where the bags go, one folder `alarm_<second>` an event.
        span: Seconds before and after the event.
        urdf: URDF text, recorded along.
        newest: Gives the newest stamp that the node believes [ns]; messages far from it are left
            out, for one of them would end the recording and hold all others in memory.
    """

    def __init__(
        self,
        node: Node,
        topics: dict[str, Any],
        folder: Path,
        span: tuple[float, float],
        urdf: str,
        newest: Callable[[], int | None],
    ) -> None:
        self._node, self._folder, self._urdf = node, folder, urdf
        self._newest = newest
        self._before_ns, self._after_ns = (round(seconds * 1e9) for seconds in span)
        self._kept: deque[_Message] = deque()
        self._newest_ns = 0
        self._beside = Beside(node, is_threaded=True)
        self._coming: _Coming | None = None
        self._until_ns = 0
        self._recorder = Recorder(node, topics, self._take)

    def trigger(self, stamp_ns: int) -> None:
        """Record around an event; one that falls into another's recording is part of it."""
        if self._coming is not None:
            return
        if self._beside.is_busy:
            self._node.get_logger().error('not recorded: the disk is busy with the bag before')
            return
        self._until_ns = stamp_ns + self._after_ns
        first_ns = max(0, stamp_ns - self._before_ns)  # a bag knows no time before zero
        kept = [message for message in self._kept if message[2] >= first_ns]
        self._coming = SimpleQueue()
        write = partial(self._write, stamp_ns, first_ns, kept, self._coming)
        self._beside.start(write, lambda _: None)

    def close(self) -> None:
        """Finish the bag that is being written; the disk is waited for a while."""
        self._end()
        self._beside.end(STOP)

    def reset(self) -> None:
        """Finish the bag and forget the messages, as when the time goes back."""
        self._end()
        self._kept.clear()
        self._newest_ns = 0

    def _end(self) -> None:
        if self._coming is not None:
            self._coming.put(None)
            self._coming = None

    def _take(self, topic: str, kind: str, stamp_ns: int, cdr: bytes) -> None:
        believed = self._newest()
        if believed is None or abs(stamp_ns - believed) > _LATENESS_NS:
            return
        self._newest_ns = max(self._newest_ns, stamp_ns)
        message = topic, kind, stamp_ns, cdr
        self._kept.append(message)
        while self._kept[0][2] < self._newest_ns - self._before_ns - _LATENESS_NS:
            self._kept.popleft()
        if self._newest_ns > self._until_ns:
            self._end()
        elif self._coming is not None:
            self._coming.put(message)

    def _write(self, stamp_ns: int, first_ns: int, kept: list[_Message], coming: _Coming) -> None:
        """Write what was kept and what comes, until None does; on a thread of its own."""
        path = self._free_path(stamp_ns)
        try:
            with BagWriter(path) as bag:
                if self._urdf:
                    bag.text('/robot_description', first_ns, self._urdf)
                for message in kept:
                    bag.message(*message)
                bag.flush()  # what led to the event: a kill may be its next part
                self._node.get_logger().info(f'recording {path}')
                _follow(bag, coming)
        except RecordingError as error:
            self._node.get_logger().error(f'not recorded: {error}')

    def _free_path(self, stamp_ns: int) -> Path:
        """Where neither a bag is nor what a kill left of one."""
        name, k = f'alarm_{stamp_ns // 1_000_000_000}', 1
        while any((self._folder / place).exists() for place in (name, f'.{name}.partial')):
            k += 1
            name = f'alarm_{stamp_ns // 1_000_000_000}_{k}'
        return self._folder / name


def _follow(bag: BagWriter, coming: _Coming) -> None:
    """Write what comes until None does."""
    while True:
        try:
            message = coming.get(timeout=_SILENCE)
        except Empty:
            bag.flush()
            continue
        if message is None:
            return
        bag.message(*message)
