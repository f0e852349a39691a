"""Whether starts and kills of peers end a process that runs nodes.

    python -m validation bench.executor_kills [--trials 200] [--seed 1]

Two peers publish, subscribe and destroy subscriptions; every fifth trial kills one (SIGKILL) and
starts another. Each trial starts a process of `run_nodes`, waits until it hears the peers, and
ends it by SIGINT or SIGTERM. Prints how the processes ended: `0` alone is right.
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
from collections import Counter

import rclpy
from nodes import options
from rclpy.node import Node
from sensor_msgs.msg import JointState

from spacerobot_ros.ros.middleware import set_up_middleware
from spacerobot_ros.ros.qos import SAMPLES, STATE
from spacerobot_ros.ros.run_node import run_nodes

TOPICS = 8
PERIOD = 0.01  # s
LONGEST = 120.0  # s for a process to start or to end


def churn() -> None:
    """Publish, subscribe, and drop subscriptions until killed."""
    set_up_middleware()
    with rclpy.init():
        node = Node('peer')
        publishers = [node.create_publisher(JointState, f'to_{k}', STATE) for k in range(TOPICS)]

        def act() -> None:
            for publisher in publishers:
                publisher.publish(JointState(name=['a'], position=[1.0]))
            passing = node.create_subscription(JointState, 'from_0', lambda _: None, STATE)
            node.destroy_subscription(passing)

        node.create_timer(PERIOD, act)
        rclpy.spin(node)


def listen() -> int:
    """Run two nodes that hear the peers; say so once they do."""
    said: list[bool] = []

    def hear(_: JointState) -> None:
        if not said:
            said.append(True)
            print('hears', flush=True)

    def node(name: str) -> Node:
        made = Node(name)
        for k in range(TOPICS):
            made.create_subscription(JointState, f'to_{k}', hear, SAMPLES)
        publisher = made.create_publisher(JointState, 'from_0', STATE)
        made.create_timer(PERIOD, lambda: publisher.publish(JointState()))
        return made

    return run_nodes([lambda: node('first'), lambda: node('second')], [])


def started(what: str) -> subprocess.Popen[str]:
    """A process of this file."""
    return subprocess.Popen([sys.executable, __file__, what], stdout=subprocess.PIPE, text=True)


def trials(count: int, seed: int) -> Counter[object]:
    """How the processes of some trials ended: exit statuses, or what did not come."""
    rng, ends = random.Random(seed), Counter[object]()
    peers = [started('--churn') for _ in range(2)]
    try:
        for k in range(count):
            if k % 5 == 4:
                one = rng.randrange(2)
                peers[one].kill()
                peers[one].wait()
                peers[one] = started('--churn')
            process = started('--listen')
            assert process.stdout is not None
            heard = process.stdout.readline()
            process.send_signal(rng.choice((signal.SIGINT, signal.SIGTERM)))
            try:
                ends[process.wait(LONGEST) if heard else 'ended by itself'] += 1
            except subprocess.TimeoutExpired:
                process.kill()
                ends['did not end'] += 1
            if sys.stderr.isatty() or k % 20 == 19:
                print(f'{k + 1} of {count}: {dict(ends)}', file=sys.stderr)
    finally:
        for peer in peers:
            peer.kill()
    return ends


def main() -> int:
    """Run the trials, or a process of them."""
    args = options(__doc__, trials=200, seed=1, churn=False, listen=False)
    if args.churn:
        churn()
    if args.listen:
        return listen()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's `&` has it ignored
    ends = trials(args.trials, args.seed)
    print(dict(ends))
    return int(set(ends) != {0})


if __name__ == '__main__':
    sys.exit(main())
