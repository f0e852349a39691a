"""What a node has learned, in a file: kept up to date, and taken up at the start."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from ..errors import SpaceRobotError
from .base import RobotNode


class KeptFile:
    """Saves and loads, as `~/save` and `~/load` as well; loads at once what is there.

    Args:
        node: The node.
        path: The file; empty: none.
        write: Writes what is known to a path at a wall time [ns]; whether anything is new.
        take: Takes up what a path knows at a wall time [ns].
    """

    def __init__(
        self,
        node: RobotNode,
        path: str,
        write: Callable[[Path, int], bool],
        take: Callable[[Path, int], None],
    ) -> None:
        self._node, self._path, self._write, self._take = node, path, write, take
        node.offer('~/save', self.save)
        node.offer('~/load', self.load)
        if path and any(Path(path).parent.glob(f'{Path(path).name}*')):
            node.get_logger().info(self.load()[1])

    def save(self) -> tuple[bool, str]:
        """Save now; whether it is done, and what there is to say."""
        return self._do(self._write, 'saved to {}', 'not saved')

    def load(self) -> tuple[bool, str]:
        """Go on with what the file knows; as `save`."""
        return self._do(self._take, 'goes on with what {} knows', 'not loaded')

    def _do(
        self, act: Callable[[Path, int], bool | None], done: str, failed: str
    ) -> tuple[bool, str]:
        if not self._path:
            return False, 'save_file names no file'
        try:
            is_news = act(Path(self._path), time.time_ns())
        except SpaceRobotError as error:
            if act is self._write:
                self._node.get_logger().error(f'{failed}: {error}', throttle_duration_sec=5.0)
            return False, f'{failed}: {error}'
        if is_news is False:
            return False, 'nothing new is known that is valid'
        return True, done.format(self._path)
