"""What an adaptive law has learned, kept in a file while it runs and taken up at the start."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path

from ..control.adaptive.prior import Learned, load, save
from ..control.controllers import FreeFlyingController
from ..errors import SpaceRobotError
from ..model.robot import Robot
from .base import RobotNode
from .beside import Beside

PERIOD_NS = 1_000_000_000
STOP = 1.0  # s that the end of the node waits for the disk


class AdaptationFile:
    """Saves and loads what a controller's law has learned.

    Args:
        node: The controller.
        controller: Its law.
        robot: What the parameters are of.
    """

    def __init__(self, node: RobotNode, controller: FreeFlyingController, robot: Robot) -> None:
        self._node, self._controller, self._robot = node, controller, robot
        self._path = Path(node.settings.controller.save_file)
        # a disk may take its time
        self._beside = Beside(node, is_threaded=not node.settings.simulator.lockstep)
        self._saved_ns: int | None = None
        node.offer('~/save', self.save)
        node.offer('~/load', self.load)
        if any(self._path.parent.glob(f'{self._path.name}*')):
            node.get_logger().info(self.load()[1])

    def keep(self, stamp_ns: int) -> None:
        """Save every second of stamps [ns] in which something is learned."""
        since = PERIOD_NS if self._saved_ns is None else abs(stamp_ns - self._saved_ns)
        if since >= PERIOD_NS:
            self._saved_ns = stamp_ns
            # what was known before, saved again, would pass for younger than it is
            if self._controller.adaptive.health.adapting:
                learned = self._controller.adaptive.learned
                self._beside.start(partial(self._write, learned), self._note)

    def save(self) -> tuple[bool, str]:
        """Save now."""
        self._beside.finish(STOP)
        problem = self._write(self._controller.adaptive.learned)
        return not problem, problem or f'saved to {self._path}'

    def load(self) -> tuple[bool, str]:
        """Go on with what the file knows."""
        try:
            self._controller.resume(load(self._path, self._robot, time.time_ns()))
        except SpaceRobotError as error:
            return False, f'not loaded: {error}'
        return True, f'goes on with what {self._path} knows'

    def close(self) -> None:
        """Let the disk finish."""
        self._beside.end(STOP)

    def _write(self, learned: Learned) -> str:
        """Write a file; why it can not be written, empty where it is."""
        try:
            save(self._path, self._robot, learned, time.time_ns())
        except SpaceRobotError as error:
            return str(error)
        return ''

    def _note(self, problem: str) -> None:
        if problem:
            self._node.get_logger().error(f'not saved: {problem}', throttle_duration_sec=5.0)
