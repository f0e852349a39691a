"""`spacerobot simulate`: a closed-loop run without ROS, recorded in a bag.

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
"""

from __future__ import annotations

import argparse
import math
import shutil
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ConfigurationError
from ..formats import counted
from ..model.control_settings import ADAPTIVE_LAWS, COMPUTED_TORQUE_LAWS
from .terminal import progress

if TYPE_CHECKING:
    from ..simulation.closed_loop import RunSummary

_LAST_STAMP = 2**31 - 1  # s, of builtin_interfaces/Time
_STEP_BYTES = 500  # of joints and commands in a period, at least


def known() -> dict[str, Any]:
    """What the arguments' texts and choices take from the code."""
    return {'choices': {'law': (*COMPUTED_TORQUE_LAWS, *ADAPTIVE_LAWS)}}


def run(args: argparse.Namespace) -> int:
    """Simulate and record; 0 when the bag is complete."""
    from ..effects.robot_file import load_robot_file
    from ..recording.bags.bag_writer import check_target
    from ..simulation.closed_loop import ClosedLoop, record_run

    check_target(args.output, args.force)  # before any work
    file = load_robot_file(args.robot)
    settings = file.settings.changed(
        {
            'simulator.seed': args.seed,
            'simulator.noise': False if args.no_noise else None,
            'controller.law': args.law,
            'reference.kind': args.reference,
        }
    )
    duration = args.duration or settings.reference.duration
    _check_duration(duration, settings.simulator.period, Path(args.output))
    steps = max(1, round(duration / settings.simulator.period))
    loop = ClosedLoop(file.robot, settings)
    adaptive = loop.controller.adaptive
    sampling = '' if adaptive is None else adaptive.health.sampling_warning
    for warning in filter(None, (sampling, loop.controller.reference_warning)):
        sys.stderr.write(f'warning: {warning}\n')
    started = time.perf_counter()
    with progress() as stage:
        advance = stage('simulating', steps)
        summary = record_run(loop, steps, args.output, overwrite=args.force, progress=advance)
    print(_line(args.output, summary, time.perf_counter() - started))
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
    errors = []
    if summary.max_joint_error is not None:
        errors.append(f'{math.degrees(summary.max_joint_error):.3g} deg')
    if summary.max_slide_error is not None:
        errors.append(f'{1e3 * summary.max_slide_error:.3g} mm')
    speed = summary.duration / wall
    speed_text = f'{speed:.0f}' if speed >= 10.0 else f'{speed:.1g}'
    return (
        f'{path}: {summary.duration:g} s in {summary.messages} messages, largest joint error '
        f'{" and ".join(errors) or "0 deg"}{attitude}{cut}, momentum drift '
        f'{summary.momentum_drift:.1e}, {speed_text} times real time'
    )
