"""Nodes of the closed loop under ten thousand odd messages a second."""

from __future__ import annotations

import copy
import time
from itertools import cycle, islice
from typing import Any

import numpy as np
import rclpy
from rclpy.serialization import serialize_message

from ..campaign.description import Record
from ..ros.qos import SAMPLES
from .message_fuzz import spoilt
from .process_loop import loop_of_processes
from .wrong_streams import flight

FLOODED = {
    '/imu/data': ('identifier', 'controller', 'monitor'),
    '/base_torque': ('simulator', 'monitor'),
}
"""Topics that are flooded, and who takes them."""
_RATE = 10_000.0  # messages a second
_POOL = 500  # odd messages, sent again and again
_FILLED = 0.25  # share of the time after which queues are full


def _messages(topic: str, seed: int) -> tuple[Any, list[bytes]]:
    """Type and content of what floods a topic: odd ones, and good ones that are not of now."""
    rng = np.random.default_rng(seed)
    good = [copy.deepcopy(message) for name, message in flight() if name == topic]
    drawn = (good[k] for k in rng.integers(len(good), size=_POOL))
    sent = [spoilt(message, rng) if k % 2 else message for k, message in enumerate(drawn)]
    if topic == '/base_torque':
        for message in sent:
            message.header.frame_id = 'nowhere'  # the plant would turn under torques on its base
    return type(good[0]), [serialize_message(message) for message in sent]


def send_flood(kind: Any, topic: str, messages: list[bytes], count: int) -> None:
    """Publish messages over and over, at the rate of a flood."""
    with rclpy.init(args=[]):
        publisher = rclpy.create_node('flood').create_publisher(kind, topic, SAMPLES)
        begin, sent, endless = time.monotonic(), 0, cycle(messages)
        while sent < count:
            due = min(count, round((time.monotonic() - begin) * _RATE))
            for message in islice(endless, due - sent):
                publisher.publish(message)
            sent = due
            time.sleep(0.001)


def flooded(topic: str, seed: int, seconds: float) -> Record:
    """Flood nodes of a closed loop in real time.

    Args:
        topic: One of `FLOODED`.
        seed: Of the messages.
        seconds: Duration.

    Returns:
        How many messages it was, by which share the memory of those who take them grew once
        queues were full, whether there is a valid estimate when the joints follow again, what
        went wrong.
    """
    nodes, count = FLOODED[topic], round(seconds * _RATE)
    kind, messages = _messages(topic, seed)
    record: Record = {'odd': count, 'grown': None, 'valid': False}
    with loop_of_processes(is_lockstep=False) as loop:
        loop.start_all()
        flood = loop.run_beside(send_flood, kind, topic, messages, count)
        filled = time.monotonic() + _FILLED * seconds
        loop.until(lambda: time.monotonic() > filled)
        before = [loop.memory(node) for node in nodes]
        loop.until(lambda: not flood.is_alive())
        after = [loop.memory(node) for node in nodes]
        record['grown'] = max(np.divide(after, before)) - 1.0
        loop.settle()
        record['valid'] = bool(loop.estimate and loop.estimate.valid)
    return {**record, 'raised': loop.faults}
