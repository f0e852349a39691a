"""What benchmarks of nodes share: options, processes of nodes, the closed loop in one process."""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

Running = dict[str, subprocess.Popen]
_PATIENCE = 20.0  # s for a process that was asked to end


def options(about: str, **defaults: Any) -> argparse.Namespace:
    """Options of a program, of the types of their defaults; False is a switch."""
    parser = argparse.ArgumentParser(
        description=about, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, default in defaults.items():
        if default is False:
            parser.add_argument(f'--{name}', action='store_true')
        else:
            parser.add_argument(
                f'--{name}', type=type(default), default=default, help='default: %(default)s'
            )
    return parser.parse_args()


def node(name: str, robot: str, **parameters: object) -> list[str]:
    """The command of a node in real time, as `ros2 run` starts it, or of all, `composed`."""
    given = {'simulator.lockstep': 'false', 'reference.repeat': 'true', **parameters}
    if name not in ('simulator', 'composed'):
        given['use_sim_time'] = 'true'
    words = [word for key, value in given.items() for word in ('-p', f'{key}:={value}')]
    begin = f'import sys; from spacerobot_ros.nodes.entry import {name}; sys.exit({name}())'
    return ['-c', begin, '--ros-args', '--params-file', robot, *words]


@contextmanager
def running(commands: Mapping[str, Sequence[str]]) -> Iterator[Running]:
    """Processes of this interpreter by name; they end with the block."""
    processes = {
        name: subprocess.Popen([sys.executable, *words]) for name, words in commands.items()
    }
    try:
        yield processes
    finally:
        for process in processes.values():
            process.send_signal(signal.SIGINT)
        for process in processes.values():
            _end(process)


def _end(process: subprocess.Popen) -> None:
    try:
        process.wait(_PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()


def run_to(step: int, simulator: Any, session: Any) -> None:
    """Let all nodes of a session go on in lockstep, as fast as they compute, up to a step."""
    simulator.stop_at = step
    simulator.pause(False)
    session.until(lambda: simulator.step_index >= step, lambda: simulator.step_index)
