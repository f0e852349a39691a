"""CPU time of a step of the closed loop in lockstep: nodes in one process, as fast as they go.

python -m validation bench.lockstep [--steps 1800] [--runs 3]
"""

from __future__ import annotations

import time

from nodes import options, run_to

from spacerobot_ros.nodes.controller import ControllerNode
from spacerobot_ros.nodes.identifier import IdentifierNode
from spacerobot_ros.nodes.monitor import MonitorNode
from spacerobot_ros.nodes.simulator import SimulatorNode
from spacerobot_ros.ros.session import Session
from validation.hidden.diagnosis_scenario import packaged

LOOPS = {
    'simulator, controller': (ControllerNode,),
    'and identifier': (ControllerNode, IdentifierNode),
    'and monitor': (ControllerNode, IdentifierNode, MonitorNode),
}
BEGIN = 200  # steps before the clock runs: kernels are loaded, first estimates made


def step_time(kinds: tuple, steps: int) -> float:
    """CPU time of a step [s] of the simulator and nodes of these ``kinds``."""
    file = packaged('servicer')
    settings = file.settings.changed({'simulator.lockstep': True, 'reference.repeat': True})
    with Session() as session:
        for kind in kinds:
            session.add(kind, settings, file.robot.urdf)
        simulator = session.add(SimulatorNode, settings, file.robot.urdf, owns_time=True)
        run_to(BEGIN, simulator, session)
        begin = time.process_time()
        run_to(BEGIN + steps, simulator, session)
        return (time.process_time() - begin) / steps


def main() -> None:
    """Print a line for every loop."""
    asked = options(__doc__, steps=1800, runs=3)
    period = packaged('servicer').settings.simulator.period
    for name, kinds in LOOPS.items():
        times = [step_time(kinds, asked.steps) for _ in range(asked.runs)]
        milliseconds = ', '.join(f'{1e3 * t:.2f}' for t in times)
        real = ', '.join(f'{period / t:.1f}' for t in times)
        print(f'{name:24} {milliseconds} ms; {real} times real time', flush=True)


if __name__ == '__main__':
    main()
