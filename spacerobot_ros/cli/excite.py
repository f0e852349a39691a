r"""`spacerobot excite`: design the motion that an identification learns most from

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

import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..errors import ConfigurationError
from . import options as opt
from .terminal import print_answer, progress

if TYPE_CHECKING:
    from ..effects.robot_file import RobotFile

_CRITERIA = ('information', 'condition', 'unit_condition')
_SEPARATE = 'design the motion that tells two effects of the diagnosis apart instead'


@opt.command(__doc__)
@opt.robot
@opt.path('-o', '--output', metavar='YAML', required=True, help='robot file with the motion')
@opt.option('--separate', metavar='EFFECT[@WHERE] EFFECT[@WHERE]', nargs=2, help=_SEPARATE)
@opt.choice('--criterion', _CRITERIA, help="what to optimize (default: file's)")
@opt.positive('--duration', metavar='S', help="of the motion (default: the file's)")
@opt.count('--starts', "starting points (default: the file's)", 1)
@opt.count('--seed', "seed of the starting points (default: the file's)")
@opt.path('--report', metavar='HTML', help='write a report with plots')
@opt.switch('--force', help='replace files that are there')
@opt.as_json
def run(
    robot: str, output: str, separate: tuple[str, str] | None, report: str | None, force: bool,
    as_json: bool, **own: Any,
) -> int:  # fmt: skip
    """Design, write, print; 0 when the motion is written, 130 when Ctrl-C cut the search."""
    from ..effects.robot_file import load_robot_file

    for written in filter(None, (output, report)):
        opt.check_file(written, force, robot)
    file = load_robot_file(robot)
    given = {f'excitation.{name}': value for name, value in own.items()}
    file = replace(file, settings=file.settings.changed(given))
    if not separate:
        return _design(file, robot, output, report, as_json)
    for name, value in (('criterion', own['criterion']), ('report', report)):
        if value is not None:
            raise ConfigurationError(f'--{name}', 'has no meaning with --separate')
    return _separate(file, robot, output, separate, own['duration'], as_json)


def _design(file: RobotFile, robot: str, output: str, report: str | None, as_json: bool) -> int:
    from ..excitation.assessment import design_motion
    from ..excitation.motions import write_trajectory
    from ..report.excitation_page import excitation_page, excitation_sections
    from ..report.html import write_report

    settings = file.settings.excitation
    with progress() as stage:
        advance = stage('designing', settings.starts * settings.iterations)
        summary = design_motion(file, lambda steps, _: advance(steps))
    write_trajectory(summary.chosen, robot, output)
    print_answer(as_json, summary, excitation_sections(summary), output)
    if report:
        write_report(excitation_page(summary), report)
    if summary.found.interrupted:
        print('spacerobot excite: stopped early, best motion so far kept', file=sys.stderr)
        return 130
    return 0


def _separate(
    file: RobotFile, robot: str, output: str, names: tuple[str, str], duration: float | None,
    as_json: bool,
) -> int:  # fmt: skip
    """Design the motion that best tells two effects apart."""
    from ..effects.catalogue import kind_at
    from ..excitation.motions import Chosen, write_trajectory
    from ..excitation.separation import Place, budget, separate
    from ..report.excitation_page import separation_section

    parts = (text.partition('@') for text in names)
    first, second = (
        Place(*kind_at(name, where or None, file.robot, '--separate')) for name, _, where in parts
    )
    if first.name == second.name:
        raise ConfigurationError('--separate', f'{first.name} is given twice')
    with progress() as stage:
        advance = stage('designing', budget(file, duration))
        found = separate(file, (first, second), duration, advance)
    best = found.best
    motions = best.motions
    write_trajectory(Chosen(motions.family, best.x, motions.start), robot, output)
    values = {'schema': 1, 'separate': [first.name, second.name], 'tried': found.tried}
    values |= {'best': best, 'robot_file': found.own}
    print_answer(as_json, values, [separation_section(first, second, found)], output)
    return 0
