"""What an adaptive law runs on and has learned: published, saved as a robot file, and kept."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from spacerobot_msgs.msg import Parameters

from ..control.adaptive.parameter_prior import load, save
from ..control.controllers import FreeFlyingController
from ..control.loop import ControlLoop
from ..errors import ConfigurationError
from ..model.robot import Robot
from ..model.settings import Settings
from ..model.writer import parameters_of, write_robot
from ..ros import convert
from ..ros.qos import LATCHED
from .base import RobotNode
from .beside import Beside
from .kept_file import KeptFile

PERIOD_NS = 1_000_000_000


class ParameterPublisher:
    """Publishes and saves what the adaptive law of a control loop runs on.

    Args:
        node: The controller.
        loop: Its loop, under an adaptive law.
        settings: All settings, written along with the robot.
    """

    def __init__(self, node: RobotNode, loop: ControlLoop, settings: Settings) -> None:
        self._node, self._loop, self._settings = node, loop, settings
        self._path = settings.controller.save_parameters
        self._published_ns: int | None = None
        self._publisher = node.create_publisher(Parameters, '~/parameters_in_force', LATCHED)
        self._beside = Beside(node, is_threaded=not settings.simulator.lockstep)
        node.offer_later('~/save_parameters', self._on_save)

    def publish(self, stamp_ns: int) -> None:
        """Publish them if the last time is a second of stamps ago, or in another run."""
        since = PERIOD_NS if self._published_ns is None else stamp_ns - self._published_ns
        if self._loop.adaptive is not None and not 0 <= since < PERIOD_NS:
            self._published_ns = stamp_ns
            is_from_estimate = self._loop.estimate is not None
            message = convert.parameters_message(stamp_ns, self._loop.adaptive, is_from_estimate)
            self._publisher.publish(message)

    def save_at_end(self) -> None:
        """Save where a path is given; a failure is only said."""
        if self._path and self._published_ns is not None:
            try:
                self._prepared()()
            except ConfigurationError as error:
                self._node.get_logger().error(f'parameters not saved: {error}')

    def _prepared(self) -> Callable[[], Path]:
        """What writes the robot with the parameters in force now, and returns the YAML's path.

        Raises:
            ConfigurationError: no path is given, or the parameters are not physical; what is
                returned raises it, too, where the files can't be written.
        """
        if not self._path:
            raise ConfigurationError('controller.save_parameters', 'is empty: give a path')
        if self._loop.adaptive is None:
            raise ConfigurationError('controller.law', 'has no parameters of its own')
        path, robot = Path(self._path).absolute(), self._loop.adaptive.robot_in_force()
        # a node does not know where its parameter file lies
        urdf = str(path.with_suffix('.urdf'))
        return lambda: write_robot(robot, parameters_of(self._settings), path, urdf)[0]

    async def _on_save(self) -> tuple[bool, str]:
        try:
            work = partial(_written, self._prepared())
        except ConfigurationError as error:
            return False, str(error)
        outcome: tuple[bool, str] = await self._beside.do(work)
        return outcome


def _written(write: Callable[[], Path]) -> tuple[bool, str]:
    """Whether it is done, and what there is to say."""
    try:
        return True, f'written to {write()}'
    except ConfigurationError as error:
        return False, str(error)


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
