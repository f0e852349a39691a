"""What a node has learned, in a file: kept up to date, and taken up at the start."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from ..control.adaptive.prior import load, save
from ..control.controllers import FreeFlyingController
from ..errors import SpaceRobotError
from ..model.robot import Robot
from .base import RobotNode
from .beside import Beside

PERIOD_NS = 1_000_000_000
STOP = 1.0  # s that the end of the node waits for the disk


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


class AdaptationFile(KeptFile):
    """What a controller's law has learned; a disk that takes its time is not waited for.

    Args:
        node: The controller.
        controller: Its law.
        robot: What the parameters are of.
    """

    def __init__(self, node: RobotNode, controller: FreeFlyingController, robot: Robot) -> None:
        self._adaptive = controller.adaptive
        self._beside = Beside(node, is_threaded=not node.settings.simulator.lockstep)
        self._saved_ns: int | None = None

        def write(path: Path, now_ns: int) -> bool:
            save(path, robot, self._learned, now_ns)
            return True

        def take(path: Path, now_ns: int) -> None:
            controller.resume(load(path, robot, now_ns))

        super().__init__(node, node.settings.controller.save_file, write, take)

    def keep(self, stamp_ns: int) -> None:
        """Save every second of stamps [ns] in which something is learned."""
        since = PERIOD_NS if self._saved_ns is None else abs(stamp_ns - self._saved_ns)
        if since >= PERIOD_NS:
            self._saved_ns = stamp_ns
            # what was known before, saved again, would pass for younger than it is
            if self._adaptive.health.adapting and not self._beside.is_busy:
                self._learned = self._adaptive.learned
                self._beside.start(partial(KeptFile.save, self), lambda _: None)

    def save(self) -> tuple[bool, str]:
        """Save now."""
        self._beside.finish(STOP)
        self._learned = self._adaptive.learned
        return super().save()

    def close(self) -> None:
        """Let the disk finish."""
        self._beside.end(STOP)
