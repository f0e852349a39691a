r"""`spacerobot excite`: design of an identification motion.

Design a joint motion (Fourier series plus quintic) from which wheel momentum and inertia are
identified as precisely as the limits allow. Limits and search are section `excitation` of the
robot file; the URDF's position limits, 90 % of its effort limits, and what gyro and star tracker
can follow hold besides. Where the file's own motion is better and keeps the limits, that is
written. ROS is not needed.

criteria: information     bits told of wheel momentum and bodies; does not depend on units
          condition       condition number of the paper's matrix A
          unit_condition  the same with columns of unit norm

examples:
  spacerobot excite --robot config/servicer.yaml -o out/trajectory.yaml
  spacerobot excite --robot config/servicer_excite.yaml -o out/usable.yaml --report out/usable.html
  spacerobot simulate --robot out/trajectory.yaml -o run
  spacerobot excite --robot config/servicer.yaml -o out/separate.yaml \
      --separate joint_viscous_friction@joint_2 joint_coulomb_friction@joint_2

The output is a complete robot file. Ctrl-C ends the search and keeps the best motion so far.

exit status: 0 written, 2 unusable input (limits that nothing can keep included),
130 stopped by Ctrl-C with the best motion so far written
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from typing import TYPE_CHECKING

from ..display import Item, Section, table_of
from ..errors import ConfigurationError
from .options import check_file
from .terminal import print_json, print_sections, progress

if TYPE_CHECKING:
    from ..effects.robot_file import RobotFile
    from ..excitation.separation import Place, Separated

_NESTED = 1e-3  # sine of the angle between signatures; below, one is a special case of the other


def run(args: argparse.Namespace) -> int:
    """Design, write, print; 0 when the motion is written, 130 when Ctrl-C cut the search."""
    from ..effects.robot_file import load_robot_file

    check_file(args.output, args.force, args.robot)
    if args.report:
        check_file(args.report, args.force, args.robot)
    file = load_robot_file(args.robot)
    names = ('criterion', 'duration', 'starts', 'seed')
    given = {f'excitation.{name}': getattr(args, name) for name in names}
    file = replace(file, settings=file.settings.changed(given))
    if args.separate:
        for option in ('criterion', 'report'):
            if getattr(args, option) is not None:
                raise ConfigurationError(f'--{option}', 'has no meaning with --separate')
        return _separate(args, file)
    return _design(args, file)


def _design(args: argparse.Namespace, file: RobotFile) -> int:
    from ..excitation.assessment import design_motion
    from ..excitation.motions import write_trajectory
    from ..report.excitation_page import excitation_page, excitation_sections
    from ..report.html import write_report

    options = file.settings.excitation
    with progress() as stage:
        advance = stage('designing', options.starts * options.iterations)
        summary = design_motion(file, lambda steps, _: advance(steps))
    write_trajectory(summary.chosen, args.robot, args.output)
    if args.json:
        print_json(summary)
    else:
        print_sections(excitation_sections(summary))
        print(f'written: {args.output}')
    if args.report:
        write_report(excitation_page(summary), args.report)
    if summary.found.interrupted:
        print('spacerobot excite: stopped early, best motion so far kept', file=sys.stderr)
        return 130
    return 0


def _separate(args: argparse.Namespace, file: RobotFile) -> int:
    """Design the motion that best tells two effects apart."""
    from ..effects.catalogue import kind_at
    from ..excitation.motions import Chosen, write_trajectory
    from ..excitation.separation import Place, budget, separate

    parts = (text.partition('@') for text in args.separate)
    first, second = (
        Place(*kind_at(name, where or None, file.robot, '--separate')) for name, _, where in parts
    )
    if first.name == second.name:
        raise ConfigurationError('--separate', f'{first.name} is given twice')
    with progress() as stage:
        advance = stage('designing', budget(file, args.duration))
        found = separate(file, (first, second), args.duration, advance)
    best = found.best
    motions = best.motions
    write_trajectory(Chosen(motions.family, best.x, motions.start), args.robot, args.output)
    if args.json:
        print_json(
            {
                'schema': 1,
                'separate': [first.name, second.name],
                'tried': found.tried,
                'best': best,
                'robot_file': found.own,
            }
        )
    else:
        print_sections([_separated(first, second, found)])
        print(f'written: {args.output}')
    return 0


def _separated(first: Place, second: Place, found: Separated) -> Section:
    best = found.best
    head = (
        f'best of {found.tried} motions: {best.origin}, {best.motions.family.duration:g} s; '
        "told apart: noise standard deviations of the part of an effect's plausible size that "
        'the other can not imitate'
    )
    rows = [
        {'of': of.name, 'other': other.name, 'seen': seen, 'motion': name}
        for name, trial in (('this one', best), ('robot file', found.own))
        if trial is not None
        for of, other, seen in ((first, second, trial.first), (second, first, trial.second))
    ]
    heads = 'effect | from | seen | told apart | smallest told, of plausible size | motion'
    cells = '{of} | {other} | {seen.visible:.4g} | {seen.apart:.4g} | {seen.smallest:number 3}'
    items: list[Item] = [head, table_of('', '', rows, heads, cells + ' | {motion}')]
    if min(best.first.sine, best.second.sine) < _NESTED:
        items.append(
            'note: one of them is all but a special case of the other; no motion tells it '
            'from the more general one'
        )
    return Section('', items)
