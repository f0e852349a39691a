"""`spacerobot simulate`: simulate a robot in closed loop (no ROS needed) and record a bag

Simulate the robot of a robot file in closed loop, without ROS, and record a rosbag2 (mcap).

The plant is the robot with the file's `truth`; the controller sees noisy sensors only and knows
what the file believes. The same file and seed give the same messages to the last bit.

topics: /joint_states /imu/data /attitude /joint_commands /simulator/ledger /robot_description,
/base_torque where the law controls the attitude, too; /wheel_states where the servicer's wheels
are true rotors

examples:
  spacerobot simulate --robot config/servicer.yaml -o run
  spacerobot simulate --robot config/servicer.yaml -o quiet --no-noise --duration 5
  spacerobot simulate --robot config/servicer.yaml -o run2 --seed 2 --law computed_torque_no_aam
  spacerobot simulate --robot config/minisat.yaml -o adapting --law adaptive_composite
  ros2 bag info run

exit status: 0 recorded, 2 unusable input
"""

from __future__ import annotations

import math
import shutil
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import ConfigurationError
from ..formats import counted
from ..model.control_settings import ADAPTIVE_LAWS, COMPUTED_TORQUE_LAWS
from . import options as opt
from .terminal import progress

if TYPE_CHECKING:
    from ..simulation.closed_loop import RunSummary

_LAST_STAMP = 2**31 - 1  # s, of builtin_interfaces/Time
_STEP_BYTES = 500  # of joints and commands in a period, at least
_LAWS = (*COMPUTED_TORQUE_LAWS, *ADAPTIVE_LAWS)
_REFERENCES = ('fourier', 'harmonic', 'hold', 'set_point', 'step')
_DURATION = 'simulated time [s] (default: reference.duration of the robot file)'


@opt.command(__doc__)
@opt.robot
@opt.path('-o', '--output', metavar='BAG', required=True, help='folder to create')
@opt.positive('--duration', metavar='S', help=_DURATION)
@opt.count('--seed', "seed of the sensor noise (default: the file's)")
@opt.choice('--law', _LAWS, help="control law (default: the file's)")
@opt.choice('--reference', _REFERENCES, help="motion to follow (default: the file's)")
@opt.switch('--no-noise', help='exact sensors')
@opt.switch('--force', help='replace a bag that is there')
def run(
    robot: str, output: str, duration: float | None, seed: int | None, law: str | None,
    reference: str | None, no_noise: bool, force: bool,
) -> int:  # fmt: skip
    """Simulate and record; 0 when the bag is complete."""
    from ..effects.robot_file import load_robot_file
    from ..recording.bags.bag_writer import check_target
    from ..simulation.closed_loop import ClosedLoop, record_run

    check_target(output, force)  # before any work
    file = load_robot_file(robot)
    given = {'simulator.seed': seed, 'controller.law': law, 'reference.kind': reference}
    settings = file.settings.changed({**given, 'simulator.noise': False if no_noise else None})
    duration = duration or settings.reference.duration
    _check_duration(duration, settings.simulator.period, Path(output))
    steps = max(1, round(duration / settings.simulator.period))
    loop = ClosedLoop(file.robot, settings)
    adaptive = loop.controller.adaptive
    sampling = '' if adaptive is None else adaptive.health.sampling_warning
    for warning in filter(None, (sampling, loop.controller.reference_warning)):
        sys.stderr.write(f'warning: {warning}\n')
    started = time.perf_counter()
    with progress() as stage:
        advance = stage('simulating', steps)
        summary = record_run(loop, steps, output, overwrite=force, progress=advance)
    print(_line(output, summary, time.perf_counter() - started))
    return 0


def _check_duration(duration: float, period: float, output: Path) -> None:
    """Refuse a run longer than stamps can say, or than the disk can hold.

    Raises:
        ConfigurationError: it is.
    """
    if duration > _LAST_STAMP:
        raise ConfigurationError('--duration', f'{duration:g} s: stamps end at {_LAST_STAMP} s')
    above = next(folder for folder in output.absolute().parents if folder.is_dir())
    needed, free = duration / period * _STEP_BYTES, shutil.disk_usage(above).free
    if needed > free:
        why = f'a bag of {duration:g} s needs {needed / 1e9:.3g} GB, free are {free / 1e9:.3g} GB'
        raise ConfigurationError('--duration', why)


def _line(path: str, summary: RunSummary, wall: float) -> str:
    cut = f', limits changed {counted(summary.saturated, "command")}' if summary.saturated else ''
    attitude = ''
    if summary.max_attitude_error is not None:
        attitude = f', of the attitude {math.degrees(summary.max_attitude_error):.3g} deg'
    of_joints = ((summary.max_joint_error, math.degrees(1.0), 'deg'),
                 (summary.max_slide_error, 1e3, 'mm'))  # fmt: skip
    errors = [f'{by * error:.3g} {unit}' for error, by, unit in of_joints if error is not None]
    speed = summary.duration / wall
    speed_text = f'{speed:.0f}' if speed >= 10.0 else f'{speed:.1g}'
    return (
        f'{path}: {summary.duration:g} s in {summary.messages} messages, largest joint error '
        f'{" and ".join(errors) or "0 deg"}{attitude}{cut}, momentum drift '
        f'{summary.momentum_drift:.1e}, {speed_text} times real time'
    )
