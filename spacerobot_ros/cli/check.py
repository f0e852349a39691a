"""`spacerobot check`: say what a recording is worth: rates, clocks, noise, faults, excitation

Look at a recording before anything is concluded from it: sensors, rates, gaps, jitter, clocks;
range, steps, saturation and noise of every channel; how the rates' errors are white or walk
(Allan deviation); slips of a data sheet by name; with a robot file the noise that it states, and
what the motion tells of every unknown. ROS is not needed.

DATA is a rosbag2 folder, mcap or db3 file, npz, CSV or JSON (.gz).

examples:
  spacerobot check run --robot config/servicer.yaml
  spacerobot check arm.csv --map arm_columns.yaml --report out/check.html
  spacerobot check run --robot config/servicer.yaml --json | jq '.findings[]'

exit status: 0 nothing found, 1 something to look at was found, 2 unusable input
"""

from __future__ import annotations

from . import options as opt
from .terminal import print_answer


@opt.command(__doc__)
@opt.path_argument('data', metavar='DATA')
@opt.path('--robot', metavar='YAML', help='robot file')
@opt.mapping
@opt.path('--report', metavar='HTML', help='write a report with plots')
@opt.switch('--force', help='replace a report that is there')
@opt.as_json
def run(
    data: str,
    robot: str | None,
    mapping: str | None,
    report: str | None,
    force: bool,
    as_json: bool,
) -> int:
    """Look and print; 0 where nothing was found, else 1."""
    from ..diagnosis.quality.quality import check_record
    from ..effects.robot_file import load_robot_file
    from ..recording.read import read_record
    from ..report.html import write_report
    from ..report.quality_page import quality_page, quality_sections

    if report:
        opt.check_file(report, force)
    file = load_robot_file(robot) if robot else None
    record = read_record(data, file.robot if file else None, mapping)
    quality = check_record(record, file)
    try:
        if report:
            write_report(quality_page(quality), report)
    finally:  # what was found is said even where no page can be written
        print_answer(as_json, quality, quality_sections(quality, is_whole=False))
    return 1 if quality.findings else 0
