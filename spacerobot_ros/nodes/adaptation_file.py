"""What an adaptive law has learned, in a file that is kept up to date while it learns."""

from __future__ import annotations

from ..control.adaptive.prior import load, save
from ..control.controllers import FreeFlyingController
from ..model.robot import Robot
from .base import RobotNode
from .kept_file import KeptFile

PERIOD_NS = 1_000_000_000


class AdaptationFile:
    """What a controller's law has learned.

    Args:
        node: The controller.
        controller: Its law.
        robot: What the parameters are of.
    """

    def __init__(self, node: RobotNode, controller: FreeFlyingController, robot: Robot) -> None:
        self._controller = controller  # an estimate gives it another law to adapt
        self._saved_ns: int | None = None
        self._file = KeptFile(
            node,
            node.settings.controller.save_file,
            lambda: controller.adaptive.learned,
            lambda path, learned, now_ns: save(path, robot, learned, now_ns),
            lambda path, now_ns: load(path, robot, now_ns),
            controller.resume,
        )

    def keep(self, stamp_ns: int) -> None:
        """Save every second of stamps [ns] in which something is learned."""
        since = PERIOD_NS if self._saved_ns is None else abs(stamp_ns - self._saved_ns)
        if since >= PERIOD_NS:
            self._saved_ns = stamp_ns
            # what was known before, saved again, would pass for younger than it is
            if self._controller.adaptive.health.adapting:
                self._file.keep()

    def close(self) -> None:
        """Let the disk finish."""
        self._file.close()
