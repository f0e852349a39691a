"""What an adaptive law has learned, in a file that is kept up to date while it learns."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from ..control.adaptive.prior import load, save
from ..control.controllers import FreeFlyingController
from ..model.robot import Robot
from .base import RobotNode
from .beside import Beside
from .kept_file import KeptFile

PERIOD_NS = 1_000_000_000
STOP = 1.0  # s that the end of the node waits for the disk


class AdaptationFile(KeptFile):
    """What a controller's law has learned; a disk that takes its time is not waited for.

    Args:
        node: The controller.
        controller: Its law.
        robot: What the parameters are of.
    """

    def __init__(self, node: RobotNode, controller: FreeFlyingController, robot: Robot) -> None:
        self._controller = controller  # an estimate gives it another law to adapt
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
            law = self._controller.adaptive
            if law.health.adapting and not self._beside.is_busy:
                self._learned = law.learned
                self._beside.start(partial(KeptFile.save, self), lambda _: None)

    def save(self) -> tuple[bool, str]:
        """Save now."""
        self._beside.finish(STOP)
        self._learned = self._controller.adaptive.learned
        return super().save()

    def close(self) -> None:
        """Let the disk finish."""
        self._beside.end(STOP)
