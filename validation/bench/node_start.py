"""Start and size of the four nodes, in processes at once and in real time, or of all in one.

    python -m validation bench.node_start [--composed] [--seconds 20] [--runs 3] [--json]

From the start of the processes to the first joint states, estimate and command on their topics;
CPU time of each process when the first of each has come; after some seconds at work, memory that
a process adds to the machine (proportional set size) and its share of a core.
"""

from __future__ import annotations

import json
import os
import subprocess
import time
from pathlib import Path
from typing import Any

import rclpy
from nodes import node, options, running
from sensor_msgs.msg import JointState
from spacerobot_msgs.msg import Estimate

NODES = ('simulator', 'identifier', 'controller', 'monitor')
TOPICS = {'/joint_states': JointState, '/estimate': Estimate, '/joint_commands': JointState}
TICKS = os.sysconf('SC_CLK_TCK')
Figures = dict[str, dict[str, Any]]
PATIENCE = 180.0  # s for all topics to have a message


def cpu(process: subprocess.Popen[bytes]) -> float:
    """CPU time of a process so far, of user and system [s]."""
    fields = Path(f'/proc/{process.pid}/stat').read_text(encoding='ascii').rpartition(')')[2]
    return sum(map(int, fields.split()[11:13])) / TICKS


def memory(process: subprocess.Popen[bytes]) -> float:
    """Proportional set size of a process [MB]."""
    lines = Path(f'/proc/{process.pid}/smaps_rollup').read_text(encoding='ascii').splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith('Pss:')) / 1024


def first_messages(processes: dict[str, subprocess.Popen[bytes]]) -> Figures:
    """Wall time and CPU time of each process when the first message of each topic came."""
    wall: dict[str, float] = {}
    spent: dict[str, dict[str, float]] = {}
    begin = time.monotonic()
    with rclpy.init():
        ears = rclpy.create_node('ears')

        def listen(topic: str) -> None:
            def take(_: bytes) -> None:
                if topic not in wall:
                    wall[topic] = time.monotonic() - begin
                    spent[topic] = {name: cpu(process) for name, process in processes.items()}

            ears.create_subscription(TOPICS[topic], topic, take, 10, raw=True)

        for topic in TOPICS:
            listen(topic)
        while len(wall) < len(TOPICS):
            rclpy.spin_once(ears, timeout_sec=0.2)
            if time.monotonic() > begin + PATIENCE or any(p.poll() for p in processes.values()):
                raise SystemExit(f'messages on {sorted(wall)} alone')
    return {'wall_s': wall, 'cpu_s': spent}


def at_work(processes: dict[str, subprocess.Popen[bytes]], seconds: float) -> Figures:
    """Share of a core and memory of each process."""
    begin, before = time.monotonic(), {name: cpu(p) for name, p in processes.items()}
    time.sleep(seconds)
    took = time.monotonic() - begin
    share = {name: (cpu(p) - before[name]) / took for name, p in processes.items()}
    return {'share': share, 'pss_mb': {name: memory(p) for name, p in processes.items()}}


def table(found: Figures) -> str:
    """The figures of a run."""
    wall, lines = found['wall_s'], []
    lines.append(', '.join(f'{topic} after {t:.1f} s' for topic, t in wall.items()))
    lines.append(f'{"":12}' + ''.join(f'{"CPU to " + topic:>24}' for topic in wall))
    lines[-1] += f'{"PSS":>8}{"share":>8}'
    for name, size in found['pss_mb'].items():
        times = ''.join(f'{found["cpu_s"][topic][name]:22.2f} s' for topic in wall)
        lines.append(f'{name:12}{times}{size:5.0f} MB{found["share"][name]:8.1%}')
    return '\n'.join(lines)


def main() -> None:
    """Run, and print a table or a JSON line a run."""
    asked = options(
        __doc__, composed=False, seconds=20.0, runs=3, robot='config/servicer.yaml', json=False
    )
    names = ('composed',) if asked.composed else NODES
    for _ in range(asked.runs):
        with running({name: node(name, asked.robot) for name in names}) as processes:
            found = first_messages(processes) | at_work(processes, asked.seconds)
        print(json.dumps(found) if asked.json else table(found), flush=True)


if __name__ == '__main__':
    main()
