"""All nodes in one process: simulator, identifier, controller and monitor.

    ros2 run spacerobot_ros composed --ros-args --params-file config/servicer.yaml

On simulated time, as all but the simulator are that follow its clock.
"""

from __future__ import annotations

import sys
from functools import partial

from rclpy.parameter import Parameter

from ..ros.run_node import run_nodes
from .controller import ControllerNode
from .identifier import IdentifierNode
from .monitor import MonitorNode
from .simulator import SimulatorNode

FOLLOWING = (IdentifierNode, ControllerNode, MonitorNode)


def main(args: list[str] | None = None) -> int:
    """Run the nodes until they are stopped."""
    simulated = [Parameter('use_sim_time', value=True)]
    following = [partial(kind, parameter_overrides=simulated) for kind in FOLLOWING]
    return run_nodes([*following, SimulatorNode], args)


if __name__ == '__main__':
    sys.exit(main())
