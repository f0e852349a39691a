"""`spacerobot excite`: design of an identification motion."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from typing import TYPE_CHECKING

from .options import Formatter, positive_float, seed

if TYPE_CHECKING:
    from ..effects.robot_file import RobotFile

CRITERIA = ('information', 'condition', 'unit_condition')

_DESCRIPTION = """\
Design a joint motion (Fourier series plus quintic) from which wheel momentum and inertia are
identified as precisely as the limits allow. Limits and search are section `excitation` of the
robot file; the URDF's position limits and 90 % of its effort limits hold besides. ROS is not
needed.

criteria: information     bits told of the whole estimate; does not depend on units
          condition       condition number of the paper's matrix A
          unit_condition  the same with columns of unit norm
"""

_EPILOG = """\
examples:
  spacerobot excite --robot config/servicer.yaml -o out/trajectory.yaml
  spacerobot excite --robot config/servicer_excite.yaml -o out/usable.yaml --report out/usable.html
  spacerobot simulate --robot out/trajectory.yaml -o run
  spacerobot excite --robot config/servicer.yaml -o out/separate.yaml \\
      --separate joint_viscous_friction@joint_2 joint_coulomb_friction@joint_2

The output is a complete robot file. Ctrl-C ends the search and keeps the best motion so far.

exit status: 0 written, 2 unusable input (limits that nothing can keep included),
130 stopped by Ctrl-C with the best motion so far written
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the sub-command's arguments."""
    parser = subparsers.add_parser(
        'excite',
        help='design the motion that an identification learns most from',
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=Formatter,
    )
    parser.add_argument('--robot', required=True, metavar='YAML', help='robot file')
    parser.add_argument(
        '-o', '--output', required=True, metavar='YAML', help='robot file with the motion to write'
    )
    parser.add_argument(
        '--separate',
        nargs=2,
        metavar='EFFECT[@WHERE]',
        help='design the motion that tells two effects of the diagnosis apart instead',
    )
    parser.add_argument('--criterion', choices=CRITERIA, help="what to optimise (default: file's)")
    parser.add_argument(
        '--duration', type=positive_float, metavar='S', help="of the motion (default: the file's)"
    )
    parser.add_argument(
        '--starts', type=_count, metavar='N', help="starting points (default: the file's)"
    )
    parser.add_argument(
        '--seed', type=seed, metavar='N', help="seed of the starting points (default: the file's)"
    )
    parser.add_argument('--report', metavar='HTML', help='write a report with plots')
    parser.add_argument('--force', action='store_true', help='replace files that are there')
    parser.add_argument('--json', action='store_true', help='print JSON, and nothing else')


def run(args: argparse.Namespace) -> int:
    """Design, write, print; 0 when the motion is written, 130 when Ctrl-C cut the search."""
    from ..effects.robot_file import load_robot_file
    from ..excitation.design import search
    from ..excitation.output import write_trajectory
    from ..excitation.problem import Problem
    from ..excitation.summary import summarise
    from ..report.html import write_report
    from .excite_report import report_of
    from .excite_separate import run_separate
    from .excite_tables import print_summary
    from .terminal import progress

    _check_target(args.output, args.robot, args.force)
    if args.separate:
        return run_separate(args)
    if args.report:
        _check_target(args.report, args.robot, args.force)
    problem = Problem(with_options(load_robot_file(args.robot), args))
    options = problem.settings.excitation
    with progress() as stage:
        advance = stage('designing', options.starts * options.iterations)
        design = search(problem, lambda steps, _: advance(steps))
    write_trajectory(problem, design.x, args.robot, args.output)
    summary = summarise(problem, design)
    if args.report:
        write_report(report_of(problem, design, summary), args.report)
    if args.json:
        print(json.dumps(summary.to_dict(), indent=2, allow_nan=False))
    else:
        print_summary(summary)
        print(f'written: {args.output}')
    if design.interrupted:
        print('spacerobot excite: stopped early, best motion so far kept', file=sys.stderr)
        return 130
    return 0


def with_options(file: RobotFile, args: argparse.Namespace) -> RobotFile:
    """The file with the options that were given."""
    given = {
        name: getattr(args, name)
        for name in ('criterion', 'duration', 'starts', 'seed')
        if getattr(args, name) is not None
    }
    settings = file.settings
    excitation = replace(settings.excitation, **given)
    return replace(file, settings=replace(settings, excitation=excitation))


def _check_target(path: str, robot: str, force: bool) -> None:
    """Refuse to replace a file, and the robot file itself in any case."""
    from pathlib import Path

    from ..errors import ConfigurationError

    target = Path(path)
    if target.is_dir():
        raise ConfigurationError(path, 'is a folder')
    if target.exists() and target.resolve() == Path(robot).resolve():
        raise ConfigurationError(path, 'is the robot file itself')
    if target.exists() and not force:
        raise ConfigurationError(path, 'is already there; --force replaces it')


def _count(text: str) -> int:
    value = seed(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f'{text} must be one or above')
    return value
