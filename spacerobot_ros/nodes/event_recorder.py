"""Bags around events: the newest messages are kept, and written when something happens."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from rclpy.node import Node

from ..errors import RecordingError
from ..recording.bags.bag_writer import BagWriter
from ..ros.session import Recorder

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
        self._kept: deque[tuple[str, str, int, bytes]] = deque()
        self._newest_ns = 0
        self._bag: BagWriter | None = None
        self._stack = ExitStack()
        self._until_ns = 0
        self._recorder = Recorder(node, topics, self._take)

    def trigger(self, stamp_ns: int) -> None:
        """Record around an event; one that falls into another's recording is part of it."""
        if self._bag is not None:
            return
        path = self._free_path(stamp_ns)
        try:
            self._bag = self._stack.enter_context(BagWriter(path))
            self._until_ns = stamp_ns + self._after_ns
            first_ns = max(0, stamp_ns - self._before_ns)  # a bag knows no time before zero
            if self._urdf:
                self._bag.text('/robot_description', first_ns, self._urdf)
            for topic, kind, stamp, cdr in self._kept:
                if stamp >= first_ns:
                    self._bag.message(topic, kind, stamp, cdr)
        except RecordingError as error:
            self._give_up(error)
            return
        self._node.get_logger().info(f'recording {path}')

    def close(self) -> None:
        """Finish the bag that is being written."""
        try:
            self._stack.close()
        except RecordingError as error:
            self._node.get_logger().error(str(error))
        self._bag = None

    def reset(self) -> None:
        """Finish the bag and forget the messages, as when the time goes back."""
        self.close()
        self._kept.clear()
        self._newest_ns = 0

    def _take(self, topic: str, kind: str, stamp_ns: int, cdr: bytes) -> None:
        believed = self._newest()
        if believed is None or abs(stamp_ns - believed) > _LATENESS_NS:
            return
        self._newest_ns = max(self._newest_ns, stamp_ns)
        self._kept.append((topic, kind, stamp_ns, cdr))
        while self._kept[0][2] < self._newest_ns - self._before_ns - _LATENESS_NS:
            self._kept.popleft()
        if self._bag is None:
            return
        if self._newest_ns > self._until_ns:
            self.close()
            return
        try:
            self._bag.message(topic, kind, stamp_ns, cdr)
        except RecordingError as error:
            self._give_up(error)

    def _give_up(self, error: RecordingError) -> None:
        self._node.get_logger().error(f'not recorded: {error}')
        self._stack.pop_all()
        self._bag = None

    def _free_path(self, stamp_ns: int) -> Path:
        """Where neither a bag is nor what a kill left of one."""
        name, k = f'alarm_{stamp_ns // 1_000_000_000}', 1
        while any((self._folder / place).exists() for place in (name, f'.{name}.partial')):
            k += 1
            name = f'alarm_{stamp_ns // 1_000_000_000}_{k}'
        return self._folder / name
