"""What all nodes have in common: settings, robot, health, messages that are counted if bad."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from ..errors import MessageRejectedError, SpaceRobotError
from ..model.robot import Robot
from ..model.settings import Settings
from ..ros.diagnostics import NodeHealth
from ..ros.params import declare_settings, let_change, open_robot
from ..ros.qos import best_effort


class RobotNode(LifecycleNode):
    """A lifecycle node about one robot, whose parameters are those of a robot file.

    It configures and activates itself as soon as the robot is known, unless `autostart` is false.

    Args:
        name: Of the node.
        node_kwargs: Node arguments of rclpy.

    Attributes:
        settings: All settings.
        health: What it says on /diagnostics.
        is_open: Whether the robot is known.
        is_active: Whether it does its work.
        live: Parameters that may change while it runs (`retune`).
        steady: Clock of timers that go on while no time is simulated.
        wall_ns: Time of such a clock [ns], for a tenth of what asking a Clock of rclpy takes.

    Raises:
        ConfigurationError: bad parameters.
    """

    live: frozenset[str] = frozenset()
    wall_ns: Callable[[], int] = staticmethod(time.monotonic_ns)
    is_open = is_active = False

    def __init__(self, name: str, **node_kwargs: Any) -> None:
        super().__init__(name, automatically_declare_parameters_from_overrides=True, **node_kwargs)
        with self._destroyed_by_failure():
            self.settings = declare_settings(self)
        self.health = NodeHealth(self)
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)
        let_change(self, lambda: self.settings, self.live, self.retune)

    @abstractmethod
    def on_robot(self, robot: Robot) -> None:
        """Take up the robot, once it is known."""

    def retune(self, settings: Settings) -> None:
        """Take up settings in which parameters in `live` may differ.

        Raises:
            ConfigurationError: they can't be; nothing has changed.
        """
        self.settings = settings

    def find_robot(self) -> None:
        """Have `on_robot` called: now, or when /robot_description says what the robot is."""

        def use(robot: Robot) -> None:
            self.on_robot(robot)
            if self.get_parameter('autostart').value:
                self.trigger_configure()
                self.trigger_activate()

        with self._destroyed_by_failure():
            open_robot(self, self.settings, use)

    @contextmanager
    def _destroyed_by_failure(self) -> Iterator[None]:
        """Leave no half-made node, which would keep its name."""
        try:
            yield
        except SpaceRobotError:
            self.destroy_node()
            raise

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Fails while there is no robot."""
        if not self.is_open:
            self.get_logger().warning('no robot yet: waiting for /robot_description')
            return TransitionCallbackReturn.FAILURE
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start to work."""
        self.is_active = True
        return super().on_activate(state)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop to work; what is known is kept."""
        self.is_active = False
        return super().on_deactivate(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop for good."""
        self.is_active = False
        return super().on_shutdown(state)

    def listen(
        self,
        topic: str,
        kind: Any,
        qos: QoSProfile,
        take: Callable[[Any], None],
        events: SubscriptionEventCallbacks | None = None,
    ) -> Any:
        """Subscribe; a message for which `take` raises MessageRejectedError is counted."""

        def on_message(message: Any) -> None:
            try:
                take(message)
            except MessageRejectedError as error:
                self.health.reject(topic, error)

        return self.create_subscription(kind, topic, on_message, qos, event_callbacks=events)

    def listen_to_driver(
        self, topic: str, kind: Any, qos: QoSProfile, take: Callable[[Any], None]
    ) -> None:
        """Subscribe as `listen`, reliably; where a driver offers best effort alone, so."""
        is_weak = False

        def take_strong(message: Any) -> None:
            if not is_weak:
                take(message)

        def on_mismatch(_: Any) -> None:
            nonlocal is_weak
            if not is_weak:
                is_weak = True
                self.get_logger().info(f'{topic} is offered with best effort: taken so')
                self.listen(topic, kind, best_effort(qos), take)

        # the first subscription stays: one that ends within its own event may end the process
        events = SubscriptionEventCallbacks(incompatible_qos=on_mismatch)
        self.listen(topic, kind, qos, take_strong, events)

    def offer(self, name: str, act: Callable[[], tuple[bool, str]]) -> None:
        """Offer a Trigger service that answers with success and a message."""

        def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = act()
            return response

        self.create_service(Trigger, name, answer)

    def offer_later(self, name: str, act: Callable[[], Awaitable[tuple[bool, str]]]) -> None:
        """Offer such a service that waits for something, while all others go on."""

        async def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = await act()
            return response

        alone = MutuallyExclusiveCallbackGroup()
        self.create_service(Trigger, name, answer, callback_group=alone)

    def now_ns(self) -> int:
        """Time of the node's clock [ns]."""
        return int(self.get_clock().now().nanoseconds)
