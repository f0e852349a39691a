"""`spacerobot compare`: what changed between two recordings of one machine.

Say what changed on an arm between two recordings, or two groups of them: a payload, a joint that
got stiffer, a sensor that was remounted. What both share is cancelled, so that a model that
explains neither of them well does for this. ROS is not needed.

writes: DIR/comparison.json      what changed, and what change would have been seen
        DIR/report.html          one page for a review

verdicts: unchanged   nothing changed by more than a machine that nobody touched does; joints at
                      which too much is left to tell are said
          changed     with what, where and by how much

examples:
  spacerobot compare empty.csv loaded.csv --map arm_columns.yaml --robot arm.yaml --out out/load
  spacerobot compare monday.csv friday.csv --before tuesday.csv --robot arm.yaml --out out/week

exit status: 0 unchanged, 1 changed, 2 unusable input
"""

from __future__ import annotations

import argparse
import shlex

from .options import check_folder
from .terminal import print_json, print_sections, progress

JSON_NAME, REPORT_NAME = 'comparison.json', 'report.html'


def run(args: argparse.Namespace) -> int:
    """Compare, write, print; 0 where nothing changed, else 1."""
    from ..diagnosis.comparison.compare import compare
    from ..effects.robot_file import load_robot_file
    from ..json_values import json_text
    from ..model.files import write_text
    from ..recording.read import read_groups
    from ..report.comparison_page import comparison_page, summary
    from ..report.html import write_report

    out = check_folder(args.out, (JSON_NAME, 'a comparison'), args.force)
    file = load_robot_file(args.robot)
    with progress() as stage:
        report = stage('reading', 1.0)
        groups = [[args.first, *args.before], [args.second, *args.after]]
        before, after = read_groups(groups, file.robot, args.map, split_gaps=args.split_gaps)
        comparison = compare(
            before, after, file.robot, file.effects, lambda what, share: report(share, what)
        )
    write_text(out / JSON_NAME, json_text(comparison))
    write_report(comparison_page(comparison, _command(args)), out / REPORT_NAME)
    if args.json:
        print_json(comparison)
    else:
        print_sections(summary(comparison))
        print(f'written: {out}: {JSON_NAME}, {REPORT_NAME}')
    return 0 if comparison.verdict == 'unchanged' else 1


def _command(args: argparse.Namespace) -> str:
    """The command line again."""
    words = ['spacerobot', 'compare', args.first, args.second]
    for name in ('before', 'after'):
        given = getattr(args, name)
        words += [f'--{name}', *given] * bool(given)
    words += ['--map', args.map] * bool(args.map)
    words += ['--split-gaps'] * args.split_gaps
    return shlex.join([*words, '--robot', args.robot, '--out', args.out])
