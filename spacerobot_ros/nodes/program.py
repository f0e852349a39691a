"""The nodes as programs: one in a process, or all in one.

    ros2 run spacerobot_ros composed --ros-args --params-file config/servicer.yaml

Composed, all are on simulated time but the simulator, whose clock it is.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

from rclpy.parameter import Parameter

from ..ros.run_node import run_nodes

NODES = ('simulator', 'identifier', 'controller', 'monitor')


def node_class(name: str) -> Any:
    """The class of a node; its modules are loaded when it is asked for."""
    return getattr(import_module(f'.{name}', __package__), f'{name.title()}Node')


def program(name: str) -> Callable[..., int]:
    """What runs a node, or all as `composed`, with ROS arguments until it is stopped."""
    nodes = NODES if name == 'composed' else (name,)
    kinds = [node_class(node) for node in nodes]
    if name != 'composed':
        return partial(run_nodes, kinds)
    simulated = [Parameter('use_sim_time', value=True)]
    following = [partial(kind, parameter_overrides=simulated) for kind in kinds[1:]]
    return partial(run_nodes, [*following, kinds[0]])
