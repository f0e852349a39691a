"""Memory of the closed loop against hours of stamps: all four nodes in one process, in lockstep.

    python -m validation bench.long_run [--hours 24] [--rate 50]

Stamps go as fast as the machine computes, and further where the loop is slow and is solved and
judged seldom. What is kept of the past is bounded in stamps, in messages or not at all, and the
last would show. Status 1: an estimate that was not valid, or an alarm of the monitor's.

Not much below 50 Hz: where joints 1 and 3 of the servicer are parallel, a torque that is held for
0.1 s swings them out and back by 3 mrad between two samples, which no sample shows.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
import time
from pathlib import Path

from spacerobot_ros.nodes.controller import ControllerNode
from spacerobot_ros.nodes.identifier import IdentifierNode
from spacerobot_ros.nodes.monitor import MonitorNode
from spacerobot_ros.nodes.simulator import SimulatorNode
from spacerobot_ros.ros.session import Session
from validation.hidden.diagnosis_scenario import packaged


def resident() -> float:
    """Memory of this process [MB]."""
    pages = int(Path('/proc/self/statm').read_text(encoding='ascii').split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE') / 2**20


def main() -> int:
    """Run, and print a line for every 10 minutes of stamps; 1 where something was wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--hours', type=float, default=24.0)
    parser.add_argument('--rate', type=float, default=50.0, help='of control and sensors [Hz]')
    options = parser.parse_args()
    file = packaged('servicer')
    rates = dict.fromkeys(('joint_rate', 'imu_rate'), options.rate)
    given = {'period': 1.0 / options.rate, 'attitude_rate': options.rate / 10.0, **rates}
    settings = file.settings.changed(
        {
            **{f'simulator.{name}': value for name, value in given.items()},
            'controller.state_timeout': 3.0 / options.rate,
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
        for part in range(1, round(6.0 * options.hours) + 1):
            simulator.stop_at = round(600.0 * part * options.rate)
            simulator.pause(False)
            session.until(
                lambda: simulator.step_index >= simulator.stop_at, lambda: simulator.step_index
            )
            gc.collect()
            found = identifier.estimate
            said = 'valid' if found and found.valid else 'not valid'
            alarms = monitor.monitor.state.alarms
            is_right = is_right and said == 'valid' and not alarms
            print(
                f'{part / 6:5.2f} h of stamps, {time.process_time():6.0f} s of the processor: '
                f'{resident():6.1f} MB; {said}, {alarms} alarms',
                flush=True,
            )
    return 0 if is_right else 1


if __name__ == '__main__':
    sys.exit(main())
