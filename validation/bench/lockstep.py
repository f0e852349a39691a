"""CPU time of a step of the closed loop in lockstep: nodes in one process, as fast as they go.

python -m validation bench.lockstep [--steps 1800] [--runs 3]
"""

from __future__ import annotations

import argparse
import time

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
        for stop in (BEGIN, BEGIN + steps):
            begin = time.process_time()
            simulator.stop_at = stop
            simulator.pause(False)
            session.until(
                lambda: simulator.step_index >= simulator.stop_at, lambda: simulator.step_index
            )
        return (time.process_time() - begin) / steps


def main() -> None:
    """Print a line for every loop."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--steps', type=int, default=1800)
    parser.add_argument('--runs', type=int, default=3)
    options = parser.parse_args()
    period = packaged('servicer').settings.simulator.period
    for name, kinds in LOOPS.items():
        times = [step_time(kinds, options.steps) for _ in range(options.runs)]
        milliseconds = ', '.join(f'{1e3 * t:.2f}' for t in times)
        real = ', '.join(f'{period / t:.1f}' for t in times)
        print(f'{name:24} {milliseconds} ms; {real} times real time', flush=True)


if __name__ == '__main__':
    main()
