"""Several nodes in one process, wired through real topics and run by one executor."""

from __future__ import annotations

import gc
import struct
import time
from collections import Counter
from collections.abc import Callable, Mapping
from itertools import count
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from ..errors import SpaceRobotError
from ..interrupts import held_back
from ..model.schema import leaves
from ..model.settings import Settings
from .convert import type_name
from .executor import make_executor, spin_once
from .middleware import set_up_middleware
from .qos import SAMPLES

_WAIT = 0.05  # s for a callback
_SPINS = 20  # from one look at whether something moves to the next
_STAMPS = {b'\0\0': struct.Struct('>4xiI'), b'\0\1': struct.Struct('<4xiI')}
"""By the beginning of a message in plain CDR: of which endianness its stamp is."""


class SessionError(SpaceRobotError, RuntimeError):
    """Nodes that wait for each other for ever."""


class Session:
    """A context, an executor and nodes, all gone when the `with` block ends.

    Args:
        stall: Wall time without what `until` waits for, after which it gives up [s].
    """

    def __init__(self, stall: float = 60.0) -> None:
        self._stall_ns = round(stall * 1e9)
        self.context = Context()
        self._nodes: list[Node] = []

    def __enter__(self) -> Session:
        """Start the context."""
        set_up_middleware()
        rclpy.init(args=[], context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        self._executor = make_executor(self.context)
        return self

    def __exit__(self, *_: object) -> None:
        """Destroy nodes, executor and context."""
        for node in self._nodes:
            self._executor.remove_node(node)
        self._executor.shutdown()
        for node in self._nodes:
            node.destroy_node()
        self.context.try_shutdown()
        gc.unfreeze()

    def add(
        self,
        node_type: Callable[..., Any],
        settings: Settings,
        urdf: str,
        *,
        owns_time: bool = False,
    ) -> Any:
        """Make a node with the settings of a robot file, on simulated time.

        Args:
            node_type: Class of the node.
            settings: Its parameters.
            urdf: URDF text of the robot.
            owns_time: Whether that time is its own, so that it needs not listen to it.
        """
        values = {
            leaf.name: leaf.value for leaf in leaves(settings) if leaf.value not in ((), None)
        }
        values |= {'robot.urdf': '', 'robot_description': urdf, 'use_sim_time': not owns_time}
        overrides = [
            Parameter(name, value=list(value) if isinstance(value, tuple) else value)
            for name, value in values.items()
        ]
        node = node_type(context=self.context, parameter_overrides=overrides, enable_rosout=False)
        return self._join(node)

    def plain(self, name: str) -> Node:
        """Make a node without parameters, to publish and listen with."""
        return self._join(Node(name, context=self.context, enable_rosout=False))

    def connect(self) -> None:
        """Run callbacks until every publisher of the session reaches all of its subscriptions."""
        topics = Counter(s.topic_name for node in self._nodes for s in node.subscriptions)
        publishers = [p for node in self._nodes for p in node.publishers]
        self.until(
            lambda: all(p.get_subscription_count() >= topics[p.topic_name] for p in publishers),
            lambda: [p.get_subscription_count() for p in publishers],
        )

    def until(self, predicate: Callable[[], object], progress: Callable[[], Any]) -> None:
        """Run callbacks until the predicate holds.

        Args:
            predicate: Asked after every callback.
            progress: Called now and then; its value must change within `stall`.

        Raises:
            SessionError: nothing moves any more.
        """
        gc.freeze()  # what exists by now stays: no search for garbage needs to look at it
        last, since = progress(), time.monotonic_ns()
        with held_back() as let_interrupts_through:
            for k in count(1):
                if predicate():
                    return
                spin_once(self._executor, _WAIT)
                let_interrupts_through()
                if k % _SPINS:
                    continue
                value, now = progress(), time.monotonic_ns()
                if value != last:
                    last, since = value, now
                elif now - since > self._stall_ns:
                    raise SessionError(f'the nodes stand still at {value}')

    def _join(self, node: Any) -> Any:
        self._nodes.append(node)
        self._executor.add_node(node)
        return node


class Recorder:
    """Collects the serialized messages of topics; what has no stamp is left out.

    Args:
        node: Node to listen with.
        topics: Message class of every topic; each message begins with its stamp.
        sink: Called with topic, type name, stamp [ns] and serialized message.
    """

    def __init__(
        self, node: Node, topics: dict[str, Any], sink: Callable[[str, str, int, bytes], None]
    ) -> None:
        self.newest_ns: dict[str, int] = dict.fromkeys(topics, -1)
        self._sink = sink
        for topic, message_type in topics.items():
            self._listen(node, topic, message_type)

    def has(self, newest_ns: Mapping[str, int]) -> bool:
        """Whether the messages of these topics up to these stamps [ns] are recorded."""
        return all(self.newest_ns.get(topic, ns) >= ns for topic, ns in newest_ns.items())

    def _listen(self, node: Node, topic: str, message_type: Any) -> None:
        name = type_name(message_type)

        def take(cdr: bytes) -> None:
            layout = _STAMPS.get(cdr[:2])
            if layout is None or len(cdr) < layout.size:
                return
            sec, nanosec = layout.unpack_from(cdr)
            stamp = sec * 1_000_000_000 + nanosec
            self.newest_ns[topic] = stamp
            self._sink(topic, name, stamp, cdr)

        node.create_subscription(message_type, topic, take, SAMPLES, raw=True)
