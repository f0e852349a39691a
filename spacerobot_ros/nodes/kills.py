"""Nodes that are killed in the closed loop: genuine processes, SIGKILL, and what it costs.

In lockstep, so that what is found does not depend on how busy the machine is; how soon a plant is
free of the torque of a controller that is gone is seen in real time alone.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from ..campaign.description import Record
from .process_loop import Loop, loop_of_processes

STOPPED = 0.5 + 0.1 * 1.25 + 5.0 / 5.0
"""s: time-outs of lockstep and, with the watch's period, of joint states; 5 / damping."""
RELEASED = 0.5 + 0.1  # s: command_timeout, and stamps on their way
_STARVED = 0.2, 3.0  # s


def broken_in_the_loop(kind: str, what: str, seed: int, count: int) -> Record:
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
