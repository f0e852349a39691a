"""Memory of the closed loop against hours of stamps: all four nodes in one process, in lockstep.

    python -m validation bench.long_run [--hours 24] [--rate 50]

Stamps go as fast as the machine computes, and further where the loop is slow and is solved and
judged seldom. What is kept of the past is bounded in stamps, in messages or not at all, and the
last would show. Status 1: an estimate that was not valid, or an alarm of the monitor's.

Not much below 50 Hz: where joints 1 and 3 of the servicer are parallel, a torque that is held for
0.1 s swings them out and back by 3 mrad between two samples, which no sample shows.
"""

from __future__ import annotations

import gc
import sys
import time

from nodes import options, run_to

from spacerobot_ros.nodes.controller import ControllerNode
from spacerobot_ros.nodes.identifier import IdentifierNode
from spacerobot_ros.nodes.monitor import MonitorNode
from spacerobot_ros.nodes.simulator import SimulatorNode
from spacerobot_ros.ros.session import Session
from validation.faults.process_loop import resident
from validation.hidden.diagnosis_scenario import packaged


def main() -> int:
    """Run, and print a line for every 10 minutes of stamps; 1 where something was wrong."""
    asked = options(__doc__, hours=24.0, rate=50.0)
    file = packaged('servicer')
    rates = dict.fromkeys(('joint_rate', 'imu_rate'), asked.rate)
    given = {'period': 1.0 / asked.rate, 'attitude_rate': asked.rate / 10.0, **rates}
    settings = file.settings.changed(
        {
            **{f'simulator.{name}': value for name, value in given.items()},
            'controller.state_timeout': 3.0 / asked.rate,
            'identifier.solve_period': 10.0,
            'monitor.block': 2.0,
            'reference.repeat': True,
            'simulator.lockstep': True,
        }
    )
    with Session() as session:
        nodes = [
            session.add(kind, settings, file.robot.urdf)
            for kind in (IdentifierNode, MonitorNode, ControllerNode)
        ]
        simulator = session.add(SimulatorNode, settings, file.robot.urdf, owns_time=True)
        identifier, monitor, _ = nodes
        is_right = True
        for part in range(1, round(6.0 * asked.hours) + 1):
            run_to(round(600.0 * part * asked.rate), simulator, session)
            gc.collect()
            found = identifier.estimate
            said = 'valid' if found and found.valid else 'not valid'
            alarms = monitor.monitor.state.alarms
            is_right = is_right and said == 'valid' and not alarms
            print(
                f'{part / 6:5.2f} h of stamps, {time.process_time():6.0f} s of the processor: '
                f'{resident("self") / 2**20:6.1f} MB; {said}, {alarms} alarms',
                flush=True,
            )
    return 0 if is_right else 1


if __name__ == '__main__':
    sys.exit(main())
