"""Nodes that are killed, starved and flooded in the closed loop: genuine processes.

Kills are in lockstep, so that what is found does not depend on how busy the machine is; how soon a
plant is free of the torque of a controller that is gone is seen in real time alone. Floods are ten
thousand odd messages a second, in real time.
"""

from __future__ import annotations

import copy
import time
from functools import partial
from itertools import cycle, islice
from typing import Any

import numpy as np
import rclpy
from rclpy.serialization import serialize_message

from spacerobot_ros.ros.middleware import set_up_middleware
from spacerobot_ros.ros.qos import SAMPLES

from ..campaigns import TrialRecord
from .message_fuzz import spoilt
from .process_loop import Loop, loop_of_processes
from .wrong_streams import flight

STOPPED = 0.5 + 0.1 * 1.25 + 5.0 / 5.0
"""s: time-outs of lockstep and, with the watch's period, of joint states; 5 / damping."""
RELEASED = 0.5 + 0.1  # s: command_timeout, and stamps on their way
_STARVED = 0.2, 3.0  # s


def broken_in_the_loop(kind: str, what: str, seed: int, count: int) -> TrialRecord:
    """Kill or starve a node of a closed loop again and again.

    Args:
        kind: `kills` (SIGKILL, and another process) or `starved` (no processor for a while).
        what: The node, perhaps `in real time`; in lockstep otherwise.
        seed: Of when, and for how long.
        count: How often.

    Returns:
        Largest times [s] until the effort was zero (of the controller in the plant's time, of the
        simulator in the controller's commands), of the processor until the identifier was valid
        again, and of the plant until the joints followed; largest error from then on [deg]; what
        went wrong.
    """
    rng = np.random.default_rng(seed)
    node, _, mode = what.partition(' ')
    is_killed, worst = kind == 'kills', 0.0
    took: dict[str, list[float]] = {'zero': [], 'known': [], 'following': []}
    with loop_of_processes(is_lockstep=not mode) as loop:
        loop.start_all()
        for _ in range(count):
            loop.until(partial(loop.is_past, loop.stamp + rng.uniform(0.05, 0.5)))
            worst = max(worst, loop.worst)
            if is_killed:
                _kill(loop, node, took)
            else:
                loop.starve(node, rng.uniform(*_STARVED))
            begun = 0.0 if is_killed and node == 'simulator' else loop.stamp
            took['following'].append(max(0.0, loop.settle() - begun))
    return {
        'odd': count,
        **{name: max(times, default=None) for name, times in took.items()},
        'error': float(np.degrees(max(worst, loop.worst))),
        'raised': loop.faults,
    }


def _kill(loop: Loop, node: str, took: dict[str, list[float]]) -> None:
    loop.kill(node)
    if node == 'controller' and not loop.is_lockstep:
        commanded = loop.commanded
        loop.until(lambda: np.all(np.abs(loop.efforts) < loop.noise))
        took['zero'].append(loop.stamp - commanded)
    elif node == 'simulator':
        took['zero'].append(loop.until(lambda: not loop.command.any()))
    loop.estimate = None if node == 'identifier' else loop.estimate
    loop.start(node)
    if node == 'identifier':
        loop.until(lambda: loop.estimate is not None and loop.estimate.valid)
        took['known'].append(loop.processor_time(node))


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
    set_up_middleware()
    with rclpy.init(args=[]):
        publisher = rclpy.create_node('flood').create_publisher(kind, topic, SAMPLES)
        begin, sent, endless = time.monotonic(), 0, cycle(messages)
        while sent < count:
            due = min(count, round((time.monotonic() - begin) * _RATE))
            for message in islice(endless, due - sent):
                publisher.publish(message)
            sent = due
            time.sleep(0.001)


def flooded(topic: str, seed: int, seconds: float) -> TrialRecord:
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
    record: TrialRecord = {'odd': count, 'grown': None, 'valid': False}
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
