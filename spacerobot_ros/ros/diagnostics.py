"""Health of a node on /diagnostics: a status a concern, rejected messages counted by reason."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from ..formats import counted
from ..recording.messages import kind_of
from .qos import STATE

OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN
ERROR, STALE = DiagnosticStatus.ERROR, DiagnosticStatus.STALE
_LONGEST = 200  # characters of a reason, which may quote what came
MOST_KINDS = 100  # of rejections that are counted apart: what comes from outside has no bound


@dataclass(frozen=True, slots=True)
class Status:
    """State of one concern.

    Args:
        name: The concern, such as `inputs`.
        level: OK, WARN, ERROR or STALE.
        message: One line.
        values: Figures; keys carry their unit, such as `age [s]`.
    """

    name: str
    level: bytes
    message: str
    values: dict[str, object] = field(default_factory=dict)


class NodeHealth:
    """Publishes the state of a node's concerns at 1 Hz of wall time, and counts what it rejected.

    Wall time, because a simulation that waits is when one wants to read why.

    Args:
        node: The node.
    """

    def __init__(self, node: Node) -> None:
        self.rejected: Counter[tuple[str, str]] = Counter()
        self._node = node
        self._concerns: list[Callable[[], Status]] = []
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', STATE)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(1.0, self.publish, clock=steady)

    def watch(self, *concerns: Callable[[], Status]) -> None:
        """Add concerns."""
        self._concerns.extend(concerns)

    def reject(self, topic: str, reason: object) -> None:
        """Count a message that must not be used, and say so once in a while."""
        text = str(reason)[:_LONGEST]
        kind = (topic, kind_of(text))
        if kind not in self.rejected and len(self.rejected) >= MOST_KINDS:
            kind = (topic, 'other reasons')
        self.rejected[kind] += 1
        self._node.get_logger().warning(f'{topic}: {text}', throttle_duration_sec=2.0)

    def count(self, topic: str | None = None) -> int:
        """Number of rejected messages, of one topic or of all."""
        return sum(n for (where, _), n in self.rejected.items() if topic in (None, where))

    def statuses(self) -> list[Status]:
        """State of all concerns now."""
        return [*(concern() for concern in self._concerns), self._rejections()]

    def publish(self) -> None:
        """Publish the state of all concerns now."""
        self._publisher.publish(self.message(self.statuses()))

    def message(self, statuses: Iterable[Status]) -> DiagnosticArray:
        """Some concerns as a message of now."""
        message = DiagnosticArray()
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.status = [self._to_message(status) for status in statuses]
        return message

    def _rejections(self) -> Status:
        kinds = sorted(self.rejected.items())
        values: dict[str, object] = {f'{topic}: {why} [messages]': n for (topic, why), n in kinds}
        total = self.count()
        text = f'{counted(total, "message")} rejected' if total else 'no message rejected'
        return Status('rejected', WARN if total else OK, text, values)

    def _to_message(self, status: Status) -> DiagnosticStatus:
        values = [KeyValue(key=key, value=_text(value)) for key, value in status.values.items()]
        return DiagnosticStatus(
            level=status.level,
            name=f'{self._node.get_name()}: {status.name}',
            message=status.message,
            hardware_id='spacerobot',
            values=values,
        )


def _text(value: object) -> str:
    return f'{value:.6g}' if isinstance(value, float) else str(value)
