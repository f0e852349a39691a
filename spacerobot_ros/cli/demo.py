"""`spacerobot demo`: identify and use the wheels' momentum, on ROS 2 nodes in one process.

Run simulator, identifier and controller as ROS 2 nodes in one process, in lockstep:
  1. excite the arm with a controller that knows nothing of the captured satellite's wheels, and
     identify, from noisy sensors, their momentum and the inertial parameters;
  2. track the same motion with what was identified.

Writes report.html, summary.json and three bags: bag (1), bag_no_aam (the first pass of 1, which
tracks without the wheels), bag_identified (2).
The same robot file and seed give the same messages in the bags, on any machine.

Any robot file will do that has a free base, joints that turn, a captured body whose wheels spin
(robot.target_wheels, truth) and a motion that excites (reference.kind: fourier).

examples:
  spacerobot demo
  spacerobot demo --seed 7 --out out/seed_7
  spacerobot demo --robot config/seven_joints.yaml
  ros2 bag play out/demo/bag
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from .options import check_folder
from .terminal import Stage, print_sections, progress

if TYPE_CHECKING:
    from ..demo.results import DemoResults
    from ..effects.robot_file import RobotFile
    from ..simulation.replay.scene import Scene

_BAGS = ('bag', 'bag_no_aam', 'bag_identified')


def run(args: argparse.Namespace) -> int:
    """Run the demonstration; 0 when it reached its aims, 1 when not."""
    if not args.live:  # other nodes on these topics would disturb it
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'OFF'
    from ..model.files import written_whole
    from ..recording.bags.bag_writer import check_target

    out = check_folder(args.out)
    for name in _BAGS:
        check_target(out / name, overwrite=True)
    with written_whole(out) as work:  # an interrupted run leaves the results before it
        work.mkdir()
        file = _robot_file(args)
        results = _results(args, file, work)
        from ..demo.page import demo_report, demo_summary
        from ..json_values import json_text
        from ..model.files import write_text
        from ..recording.read import read_record
        from ..report.html import write_report
        from ..simulation.replay.scene import scene_of

        def scene() -> Scene:
            return scene_of(read_record(work / _BAGS[0], file.robot), file)

        write_text(work / 'summary.json', json_text(results.summary()))
        write_report(demo_report(results, scene), work / 'report.html')
    print_sections(demo_summary(results, out))
    return 0 if results.reached else 1


def _results(args: argparse.Namespace, file: RobotFile, work: Path) -> DemoResults:
    """All runs."""
    from ..demo.results import DemoResults, truth_of
    from ..demo.run import check_file, identify, track
    from ..simulation.truth import true_robot

    started = time.perf_counter()
    check_file(file)
    settings = file.settings
    bags = [work / name for name in _BAGS]
    passes, length = 1 if args.quick else 2, settings.reference.duration
    truth = truth_of(file.robot, true_robot(file.robot, settings), settings.identifier.structure)
    with progress() as bars:
        exciting = _stage(bars, 'tracking without the wheels, identifying them', passes * length)
        found = identify(file, passes, bags[:2], exciting)
        tracking = _stage(bars, 'tracking with them', length)
        identified = track(file, found.estimates[-1], bags[2], tracking)
    return DemoResults(
        robot=file.robot.name,
        joints=file.robot.arm,
        seed=settings.simulator.seed,
        identification=found,
        no_aam=found.until(length),
        identified=identified,
        truth=truth,
        bags=tuple(str(Path(args.out) / name) for name in _BAGS),
        wall=time.perf_counter() - started,
    )


def _robot_file(args: argparse.Namespace) -> RobotFile:
    from ..effects.robot_file import load_robot_file
    from ..model.loader import package_folder

    path = args.robot or package_folder('spacerobot_ros') / 'config' / 'servicer.yaml'
    file = load_robot_file(path)
    return replace(file, settings=file.settings.changed({'simulator.seed': args.seed}))


def _stage(bars: Stage, what: str, total: float) -> Callable[[float], None]:
    """A progress bar; one line where stderr is no terminal."""
    if not sys.stderr.isatty():
        print(f'{what} ({total:g} s simulated)', file=sys.stderr, flush=True)
    return bars(what, total)
