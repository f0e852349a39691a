"""The parameters that an adaptive law runs on: published, and saved as a robot file."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from spacerobot_msgs.msg import Parameters

from ..control.loop import ControlLoop
from ..errors import ConfigurationError
from ..model.settings import Settings
from ..model.writer import parameters_of, write_robot
from ..ros import convert
from ..ros.qos import LATCHED
from .base import RobotNode
from .beside import Beside

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
