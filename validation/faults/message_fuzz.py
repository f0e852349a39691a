"""Messages with odd things in them, and nodes that get them, without a wire between."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from rclpy.clock import ClockType
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.time import Time

from spacerobot_ros.model.settings import Settings
from spacerobot_ros.recording.bags.message_types import decoded
from spacerobot_ros.ros.convert import type_name
from spacerobot_ros.ros.session import Session

_NUMBERS = (
    math.nan, math.inf, -math.inf, 1e308, -1e308, 1e300, 1e200, 1e16, 1e6, 0.01, -0.01, 0.0,
    5e-324, -1.0,
)  # fmt: skip
_WHOLE = (0, 1, -1, 2**31 - 1, -(2**31), 999_999_999, 1_000_000_000, 2**32 - 1)
_CLOCKED = ('/imu/data', '/attitude', '/joint_states')
_NOT_ON_A_WIRE = (
    AssertionError, AttributeError, OverflowError, RuntimeError, SystemError, TypeError,
    ValueError,
)  # fmt: skip
_TEXTS = ('', 'x', 'joint_1', 'base_link', 'inertial', '\x00', 'j' * 10_000)


def spoilt(message: Any, rng: np.random.Generator) -> Any:
    """A copy of a message with one to three odd fields."""
    out = copy.deepcopy(message)
    for _ in range(rng.integers(1, 4)):
        _spoil(out, rng)
    try:  # what can not go over a wire, nobody gets
        return deserialize_message(serialize_message(out), type(out))
    except _NOT_ON_A_WIRE:
        return spoilt(message, rng)


def _spoil(message: Any, rng: np.random.Generator) -> None:
    fields = list(message.get_fields_and_field_types())
    name = fields[rng.integers(len(fields))]
    value = getattr(message, name)
    if hasattr(value, 'get_fields_and_field_types'):
        _spoil(value, rng)
        return
    try:
        setattr(message, name, _odd(value, rng))
    except (AssertionError, OverflowError, TypeError):
        return  # what the type of the field can not hold, no message brings


def _odd(value: Any, rng: np.random.Generator) -> Any:
    if isinstance(value, bool):
        return not value
    if isinstance(value, str):
        return _TEXTS[rng.integers(len(_TEXTS))]
    if isinstance(value, float):
        return _NUMBERS[rng.integers(len(_NUMBERS))]
    if isinstance(value, int):
        return _WHOLE[rng.integers(len(_WHOLE))]
    items = list(value)
    change = rng.integers(4)
    if change == 0 and items:
        k = rng.integers(len(items))
        if hasattr(items[k], 'get_fields_and_field_types'):
            _spoil(items[k], rng)
        else:
            items[k] = _odd(items[k], rng)
    elif change == 1:
        items = items[: rng.integers(len(items) + 1)]
    elif change == 2:
        items = items + items
    else:
        rng.shuffle(items)
    return items


def is_finite(value: Any) -> bool:
    """Whether all numbers in a message are."""
    if isinstance(value, float):
        return math.isfinite(value)
    if hasattr(value, 'get_fields_and_field_types'):
        names = value.get_fields_and_field_types()
        return all(is_finite(getattr(value, name)) for name in names)
    if isinstance(value, str | bytes | bool | int):
        return True
    if is_dataclass(value):
        return all(is_finite(getattr(value, field.name)) for field in fields(value))
    if isinstance(value, np.ndarray):
        return bool(np.all(np.isfinite(value)))
    return all(is_finite(item) for item in value)


class Patient:
    """A node whose callbacks are called by hand, and whose messages are looked at.

    Args:
        session: Where it lives.
        kind: Its class.
        settings: Its parameters. urdf: Its robot.
    """

    def __init__(
        self, session: Session, kind: Callable[..., Any], settings: Settings, urdf: str
    ) -> None:
        self.node = session.add(kind, settings, urdf)
        self.published: dict[str, int] = {}  # messages by topic
        self.not_finite: list[str] = []
        self._inputs = {s.topic_name: s for s in self.node.subscriptions}
        for publisher in self.node.publishers:
            publisher.publish = self._watching(publisher.topic_name, type_name(publisher.msg_type))

    def hears(self, topic: str) -> bool:
        """Whether the node takes messages of a topic."""
        return topic in self._inputs

    def give(self, topic: str, message: Any, *, is_good: bool = True) -> None:
        """Have the node take a message; the clock goes with the stamps of good samples."""
        if is_good and topic in _CLOCKED:
            stamp = Time.from_msg(message.header.stamp, clock_type=ClockType.ROS_TIME)
            self.node.get_clock().set_ros_time_override(stamp)
        subscription = self._inputs[topic]
        subscription.callback(serialize_message(message) if subscription.raw else message)

    def _watching(self, topic: str, kind: str) -> Callable[[Any], None]:
        def publish(message: Any) -> None:
            if isinstance(message, bytes):
                message = decoded(kind, message)
            self.published[topic] = self.published.get(topic, 0) + 1
            # a condition number is infinite where nothing is known
            if not is_finite(message) and not getattr(message, 'reason', ''):
                self.not_finite.append(topic)

        return publish


def interleaved(
    stream: list[tuple[str, Any]], count: int, rng: np.random.Generator
) -> Iterator[tuple[str, Any, bool]]:
    """A stream of messages with `count` odd copies in between: topic, message, is it odd."""
    odd = np.bincount(rng.integers(len(stream), size=count), minlength=len(stream))
    for (topic, message), copies in zip(stream, odd, strict=True):
        for _ in range(copies):
            other = stream[rng.integers(len(stream))] if rng.random() < 0.2 else (topic, message)
            yield other[0], spoilt(other[1], rng), True
        yield topic, message, False
