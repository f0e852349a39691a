"""From joint states to the command that answers them: four nodes in processes, in real time.

    python -m validation bench.latency [--seconds 60] [--robot config/servicer.yaml]

Times are those at which the middleware took the messages over from their senders. Beside the
nodes runs the least that rclpy can do: a node that sends joint states back as they come. On a
machine that does other work, too, its times say what that work costs.
"""

from __future__ import annotations

import os
import time
from contextlib import suppress

import numpy as np
import rclpy
from nodes import node, options, running
from rclpy.executors import ExternalShutdownException
from sensor_msgs.msg import JointState
from spacerobot_msgs.msg import Estimate

from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.ros.qos import LATCHED, SAMPLES, STATE
from spacerobot_ros.simulation.truth import build_plant

NODES = {'simulator': 'none', 'identifier': 'nice', 'controller': 'fifo', 'monitor': 'nice'}
"""How each shares the processor."""
BEGIN = 15.0  # s in which nodes start and the first estimates come


def echo() -> None:
    """Send joint states back until stopped."""
    with suppress(KeyboardInterrupt, ExternalShutdownException), rclpy.init():
        mirror = rclpy.create_node('echo')
        publisher = mirror.create_publisher(JointState, '/echo', STATE)
        mirror.create_subscription(JointState, '/joint_states', publisher.publish, STATE)
        rclpy.spin(mirror)


def heard(seconds: float) -> tuple[dict[str, dict], list[Estimate]]:
    """When each message was sent [ns], by topic and stamp; and the estimates."""
    sent: dict[str, dict] = {'/joint_states': {}, '/joint_commands': {}, '/echo': {}}
    estimates: list[Estimate] = []
    os.nice(19)  # who listens is in nobody's way
    with rclpy.init():
        ears = rclpy.create_node('ears')

        def listen(topic: str) -> None:
            def take(message: JointState, info: dict) -> None:
                stamp = message.header.stamp
                sent[topic].setdefault((stamp.sec, stamp.nanosec), info['source_timestamp'])

            ears.create_subscription(JointState, topic, take, SAMPLES)

        for topic in sent:
            listen(topic)
        ears.create_subscription(Estimate, '/estimate', estimates.append, LATCHED)
        begin = time.monotonic() + BEGIN
        while time.monotonic() < begin + seconds:
            rclpy.spin_once(ears, timeout_sec=0.1)
            if time.monotonic() < begin:
                for times in sent.values():
                    times.clear()
    return sent, estimates


def main() -> None:
    """Run, and print a table."""
    asked_for = options(__doc__, seconds=60.0, robot='config/servicer.yaml', echo=False)
    if asked_for.echo:
        echo()
        return
    robot = asked_for.robot
    commands = {name: node(name, robot, scheduling=share) for name, share in NODES.items()}
    with running({**commands, 'echo': [__file__, '--echo']}):
        sent, estimates = heard(asked_for.seconds)
    asked = sent.pop('/joint_states')
    print(f'{"":16s} {"median":>7s} {"90 %":>7s} {"99 %":>7s} {"99.9 %":>7s} {"all":>7s}  [ms]')
    for topic, times in sent.items():
        late = [(times[stamp] - ns) * 1e-6 for stamp, ns in asked.items() if stamp in times]
        row = ' '.join(f'{x:7.2f}' for x in np.percentile(late, [50.0, 90.0, 99.0, 99.9, 100.0]))
        print(f'{topic:16s} {row}  of {len(late)}; {len(asked) - len(late)} without')
    file = load_robot_file(robot)
    true = build_plant(file.robot, file.settings).robot.target_momentum
    if estimates and len(true):
        last = estimates[-1]
        off = np.abs(np.array(last.aam) - true).max() / np.abs(true).max()
        print(f'last estimate: {"valid" if last.valid else last.reason}, {off:.2%} off')
    print(f'load of the machine: {os.getloadavg()[0]:.1f}, processors: {os.cpu_count()}')


if __name__ == '__main__':
    main()
