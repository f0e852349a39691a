"""`spacerobot demo`: the whole loop on ROS 2 nodes, with a report

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

exit status: 0 what was identified tracks as it should, 1 it does not, 2 unusable input
"""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING

from . import options as opt
from .terminal import print_sections, progress

if TYPE_CHECKING:
    from ..simulation.replay.scene import Scene

_BAGS = ('bag', 'bag_no_aam', 'bag_identified')


@opt.command(__doc__)
@opt.path('--out', metavar='DIR', default='out/demo', help='folder for the results')
@opt.path('--robot', metavar='YAML', help='robot file (default: the servicer of the package)')
@opt.count('--seed', "seed of the sensor noise (default: the file's)")
@opt.switch('--quick', help='identify from one pass of the motion, not from two')
@opt.switch('--live', help='let other ROS 2 processes on this machine see the topics meanwhile')
def run(out: str, robot: str | None, seed: int | None, quick: bool, live: bool) -> int:
    """Run the demonstration; 0 when it reached its aims, 1 when not."""
    if not live:  # other nodes on these topics would disturb it
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'OFF'
    from ..effects.robot_file import load_robot_file
    from ..model.files import written_whole
    from ..model.loader import package_folder
    from ..recording.bags.bag_writer import check_target

    folder = opt.check_folder(out)
    for name in _BAGS:
        check_target(folder / name, overwrite=True)
    with written_whole(folder) as work:  # an interrupted run leaves the results before it
        work.mkdir()
        file = load_robot_file(
            robot or package_folder('spacerobot_ros') / 'config' / 'servicer.yaml'
        )
        file = replace(file, settings=file.settings.changed({'simulator.seed': seed}))
        from ..demo.page import demo_report, demo_summary
        from ..demo.run import demonstrate
        from ..json_values import json_text
        from ..model.files import write_text
        from ..recording.read import read_record
        from ..report.html import write_report
        from ..simulation.replay.scene import scene_of

        with progress() as stage:
            bags = {work / name: folder / name for name in _BAGS}
            results = demonstrate(file, 1 if quick else 2, bags, stage)

        def scene() -> Scene:
            return scene_of(read_record(work / _BAGS[0], file.robot), file)

        write_text(work / 'summary.json', json_text(results.summary()))
        write_report(demo_report(results, scene), work / 'report.html')
    print_sections(demo_summary(results, folder))
    return 0 if results.reached else 1
