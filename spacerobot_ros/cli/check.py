"""`spacerobot check`: is this recording worth anything, before anything else.

Look at a recording before anything is concluded from it: sensors, rates, gaps, jitter, clocks;
range, steps, saturation and noise of every channel; how the rates' errors are white or walk
(Allan deviation); slips of a data sheet by name; with a robot file the noise that it states, and
what the motion tells of every unknown. ROS is not needed.

examples:
  spacerobot check run --robot config/servicer.yaml
  spacerobot check arm.csv --map arm_columns.yaml --report out/check.html
  spacerobot check run --robot config/servicer.yaml --json | jq '.findings[]'

exit status: 0 nothing found, 1 something to look at was found, 2 unusable input
"""

from __future__ import annotations

import argparse

from .options import check_file
from .terminal import print_json, print_sections


def run(args: argparse.Namespace) -> int:
    """Look and print; 0 where nothing was found, else 1."""
    from ..diagnosis.quality.quality import check_record
    from ..effects.robot_file import load_robot_file
    from ..recording.read import read_record
    from ..report.html import write_report
    from ..report.quality_page import quality_page, quality_sections

    if args.report:
        check_file(args.report, args.force)
    file = None if args.robot is None else load_robot_file(args.robot)
    record = read_record(args.data, None if file is None else file.robot, args.map)
    quality = check_record(record, file)
    try:
        if args.report:
            write_report(quality_page(quality), args.report)
    finally:  # what was found is said even where no page can be written
        if args.json:
            print_json(quality)
        else:
            print_sections(quality_sections(quality, is_whole=False))
    return 1 if quality.findings else 0
