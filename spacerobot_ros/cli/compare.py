"""`spacerobot compare`: say what changed on an arm between two recordings, or that nothing did

Say what changed on an arm between two recordings, or two groups of them: a payload, a joint that
got stiffer, a sensor that was remounted. What both share is cancelled, so that a model that
explains neither of them well does for this. ROS is not needed.

BEFORE and AFTER are rosbag2 folders, mcap or db3 files, npz, CSV or JSON; AFTER is the same
machine later.

writes: DIR/comparison.json      what changed, and what change would have been seen
        DIR/report.html          one page for a review

verdicts: unchanged   nothing changed by more than a machine that nobody touched does; joints at
                      which too much is left to tell are said
          changed     with what, where and by how much
          changed, cause not identified
                      more is left at a joint than before, and no known cause explains it

examples:
  spacerobot compare empty.csv loaded.csv --map arm_columns.yaml --robot arm.yaml --out out/load
  spacerobot compare monday.csv friday.csv --before tuesday.csv --robot arm.yaml --out out/week

exit status: 0 unchanged, 1 changed (either way), 2 unusable input
"""

from __future__ import annotations

import shlex

from . import options as opt
from .terminal import print_answer, progress

JSON_NAME, REPORT_NAME = 'comparison.json', 'report.html'


@opt.command(__doc__)
@opt.path_argument('first', metavar='BEFORE')
@opt.path_argument('second', metavar='AFTER')
@opt.recording
@opt.path('--before', metavar='DATA...', multiple=True, help='further recordings like BEFORE')
@opt.path('--after', metavar='DATA...', multiple=True, help='further recordings like AFTER')
@opt.robot
@opt.out
@opt.switch('--force', help='replace an earlier comparison')
@opt.force_data
@opt.as_json
def run(
    first: str, second: str, mapping: str | None, split_gaps: bool, before: tuple[str, ...],
    after: tuple[str, ...], robot: str, out: str, force: bool, force_data: bool, as_json: bool,
) -> int:  # fmt: skip
    """Compare, write, print; 0 where nothing changed, else 1."""
    from ..diagnosis.comparison.compare import compare
    from ..effects.robot_file import load_robot_file
    from ..json_values import json_text
    from ..model.files import write_text
    from ..recording.read import read_groups
    from ..report.comparison_page import comparison_page, summary
    from ..report.html import write_report

    folder = opt.check_folder(out, (JSON_NAME, 'a comparison'), force)
    file = load_robot_file(robot)
    with progress() as stage:
        report = stage('reading', 1.0)
        groups = [[first, *before], [second, *after]]
        earlier, later = read_groups(
            groups, file.robot, mapping, split_gaps=split_gaps, force_data=force_data
        )
        comparison = compare(
            earlier, later, file.robot, file.effects, lambda what, share: report(share, what)
        )
    words = ['spacerobot', 'compare', first, second]
    words += ['--before', *before] * bool(before)
    words += ['--after', *after] * bool(after)
    words += ['--map', mapping] if mapping else []
    words += ['--split-gaps'] * split_gaps
    words += ['--force-data'] * force_data
    asked = shlex.join([*words, '--robot', robot, '--out', out])
    write_text(folder / JSON_NAME, json_text(comparison))
    write_report(comparison_page(comparison, asked), folder / REPORT_NAME)
    written = f'{folder}: {JSON_NAME}, {REPORT_NAME}'
    print_answer(as_json, comparison, summary(comparison), written)
    return 0 if comparison.verdict == 'unchanged' else 1
