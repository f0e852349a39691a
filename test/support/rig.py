"""Nodes in one process, run callback by callback: no sleeps, no threads, a context a test."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import rclpy
import yaml
from rclpy.clock import ClockType
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor, TimeoutException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time

from spacerobot_ros.ros.middleware import set_up_middleware


class LockstepExecutor(SingleThreadedExecutor):
    """Runs one callback at a time, and lets its exception out."""

    def step(self, timeout_sec: float = 0.0) -> bool:
        """Run at most one callback; True if one ran."""
        try:
            handler, _, _ = self.wait_for_ready_callbacks(timeout_sec=timeout_sec)
        except TimeoutException:
            return False
        handler()
        error = handler.exception()
        if error is not None:
            raise error
        return True


def flatten(values: Mapping[str, Any], prefix: str = '') -> dict[str, Any]:
    """Nested parameters to dotted names."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            flat.update(flatten(value, f'{prefix}{key}.'))
        else:
            flat[prefix + key] = value
    return flat


def file_parameters(path: Any) -> dict[str, Any]:
    """The parameters in a robot file, by dotted name."""
    with open(path, encoding='utf-8') as stream:
        return flatten(yaml.safe_load(stream)['/**']['ros__parameters'])


class Wall:
    """A steady clock that stands still until a test moves it, in place of a node's own."""

    def __init__(self) -> None:
        self.ms = 0

    def ns(self) -> int:
        """Time since the test began."""
        return self.ms * 1_000_000


class Rig:
    """One context, one executor, many nodes."""

    def __init__(self) -> None:
        set_up_middleware()  # not only where another test of this process did
        self.context = Context()
        rclpy.init(context=self.context)
        self.executor = LockstepExecutor(context=self.context)
        self.nodes: list[Node] = []
        self.now_ns = 0

    def add(
        self, node_type: Callable[..., Any], parameters: Mapping[str, Any], **more: Any
    ) -> Any:
        """Make a node with parameters by dotted name."""
        overrides = [Parameter(k, value=v) for k, v in {**parameters, **more}.items()]
        node = node_type(context=self.context, parameter_overrides=overrides, enable_rosout=False)
        return self.join(node)

    def join(self, node: Any) -> Any:
        """Take in a node that was made elsewhere, in this rig's context."""
        self.nodes.append(node)
        self.executor.add_node(node)
        return node

    def plain(self, name: str = 'probe') -> Node:
        """Make a node to publish and listen with."""
        return self.join(Node(name, context=self.context, enable_rosout=False))

    def listen(self, node: Node, message_type: Any, topic: str, qos: Any) -> list[Any]:
        """Collect the messages of a topic in a list."""
        messages: list[Any] = []
        node.create_subscription(message_type, topic, messages.append, qos)
        return messages

    def until(self, predicate: Callable[[], object]) -> None:
        """Run callbacks until the predicate holds, for as long as pytest lets a test run."""
        while not predicate():
            self.executor.step(timeout_sec=0.05)

    def drain(self) -> None:
        """Run callbacks until none is ready twice in a row: one empty wait can be spurious."""
        empty = 0
        while empty < 2:
            empty = 0 if self.executor.step(timeout_sec=0.01) else empty + 1

    def deliver(self) -> None:
        """Run callbacks until none is ready three times in a row, without waiting for any.

        What is published in this process is there when `publish` returns; after a callback one
        look finds nothing but the executor's own guard condition. Where nothing is to come of
        timers either, `drain`.
        """
        empty = 0
        while empty < 3:
            empty = 0 if self.executor.step() else empty + 1

    def set_time(self, ns: int) -> None:
        """Move the ROS clock of all nodes that use simulated time, without /clock."""
        self.now_ns = ns
        for node in self.nodes:
            node.get_clock().set_ros_time_override(
                Time(nanoseconds=ns, clock_type=ClockType.ROS_TIME)
            )

    def close(self) -> None:
        """Shut everything down."""
        self.executor.shutdown()
        for node in self.nodes:
            node.destroy_node()
        self.context.try_shutdown()
