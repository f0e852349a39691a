"""`spacerobot identify`: wheel momentum and inertial parameters from a recording."""

from __future__ import annotations

import argparse
import json
import math
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import IdentificationError
from .options import Formatter

if TYPE_CHECKING:
    from rich.table import Table

    from ..identification.advice import Advice
    from ..identification.estimate import Estimate

METHODS = ('ml', 'recursive', 'ls')

_DESCRIPTION = """\
Estimate the momentum of the captured satellite's wheels and the minimal inertial parameters from
a recording (rosbag2: mcap or sqlite3; or an npz record). ROS is not needed.

methods: ml        maximum likelihood; the most accurate, with standard deviations of its own
         recursive least squares row by row in square-root form, as it can run on board
         ls        the paper's least squares, all rows at once
"""

_EPILOG = """\
examples:
  spacerobot identify run --robot config/servicer.yaml
  spacerobot identify run --robot config/servicer.yaml --json | jq .aam
  spacerobot identify run --robot config/servicer.yaml --write out/identified.yaml

exit status: 0 valid estimate, 1 the data do not suffice (the reason is given), 2 unusable input
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the sub-command's arguments."""
    parser = subparsers.add_parser(
        'identify',
        help='estimate wheel momentum and inertial parameters from a recording',
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=Formatter,
    )
    parser.add_argument('bag', metavar='BAG', help='rosbag2 folder, one mcap or db3 file, or npz')
    parser.add_argument('--robot', required=True, metavar='YAML', help='robot file')
    parser.add_argument('--method', choices=METHODS, default='ml', help='estimator')
    parser.add_argument(
        '--manifold',
        choices=('physical', 'linear'),
        help='ml only: over physical bodies, or over the free minimal set (default: robot file)',
    )
    parser.add_argument(
        '--write', metavar='YAML', help='write the robot with the bodies found, YAML and URDF'
    )
    parser.add_argument('--force', action='store_true', help='overwrite what --write names')
    parser.add_argument('--json', action='store_true', help='print JSON, and nothing else')


def run(args: argparse.Namespace) -> int:
    """Identify and print; 0 for a valid estimate, 1 where the data do not suffice."""
    from ..estimation.grouping import standard_parameters
    from ..estimation.minimal import minimal_set
    from ..estimation.momentum_process import MomentumModel
    from ..identification.advice import advise_on
    from ..identification.batch import identify_robot
    from ..json_values import json_value
    from ..model.loader import load_robot_file
    from ..model.writer import write_robot_file
    from ..recording.bag import read_bag
    from ..recording.npz import load_npz
    from ..sensing.correction import corrected_record

    file = load_robot_file(args.robot)
    record = load_npz(args.bag) if args.bag.endswith('.npz') else read_bag(args.bag, file.robot)
    record = corrected_record(record, file.robot, file.effects)
    robot, settings = file.believed, file.settings.identifier
    if args.manifold:
        settings = replace(settings, manifold=args.manifold)
    result = identify_robot(record, robot, settings, args.method)
    estimate = result.estimate
    minimal = minimal_set(robot, settings.structure)
    groups = standard_parameters(robot, minimal, settings.structure)
    advice = advise_on(record, MomentumModel(robot, minimal), estimate)
    if args.json:
        data = estimate.to_dict()
        for parameter, group in zip(data['parameters'], groups, strict=True):
            parameter['groups'] = group
        data['advice'] = [asdict(one) for one in advice]
        print(json.dumps(json_value(data), indent=2, allow_nan=False))
    else:
        _print_human(estimate, groups, advice)
    if args.write:
        if Path(args.write).exists() and not args.force:
            raise IdentificationError(f'{args.write}: exists; --force overwrites it')
        if result.robot is None:
            raise IdentificationError(
                f'{args.write} is not written: no physical bodies were found'
            )
        write_robot_file(file.before_effects(result.robot), args.robot, args.write)
    return 0 if estimate.valid else 1


def _print_human(estimate: Estimate, groups: tuple[str, ...], advice: tuple[Advice, ...]) -> None:
    from rich.console import Console

    console = Console(highlight=False, width=None if sys.stdout.isatty() else 100)
    for title, rows, notes in (
        ('wheel momentum of the captured body', _aam_rows(estimate), ()),
        ('total angular momentum, inertial frame', _momentum_rows(estimate), ()),
        (
            'minimal inertial parameters, each with the numbers of the bodies that it groups',
            _parameter_rows(estimate),
            groups,
        ),
    ):
        console.print(title)
        console.print(_table(rows, notes))
    console.print(
        f'method {estimate.method}, {estimate.samples} samples, rank {estimate.rank} of '
        f'{estimate.unknowns}, condition {estimate.condition:.4g}, '
        f'chi-square per degree of freedom {estimate.chi2_per_dof:.3g}',
        markup=False,
    )
    for note in estimate.notes:
        console.print(f'note: {note}', markup=False)
    if not estimate.valid:
        console.print(f'not valid: {estimate.reason}', markup=False)
    if advice:
        console.print(
            '\nwhat the data cannot tell, and the cheapest motions that would, in this order'
            '\n(A with -1.00 B: where A and B change so together, the data stay the same)'
        )
        console.print(_advice_table(advice))


def _aam_rows(estimate: Estimate) -> list[tuple[str, float, float, str]]:
    names = [f'{link} {axis}' for link in estimate.aam_links for axis in 'xyz']
    std = estimate.std[: len(names)].tolist()
    return _rows(names, estimate.aam.tolist(), std, 'N m s')


def _momentum_rows(estimate: Estimate) -> list[tuple[str, float, float, str]]:
    variances = estimate.total_momentum_covariance.diagonal().tolist()
    std = [math.sqrt(v) for v in variances]
    return _rows(list('xyz'), estimate.total_momentum.tolist(), std, 'N m s')


def _parameter_rows(estimate: Estimate) -> list[tuple[str, float, float, str]]:
    std = estimate.std[len(estimate.aam) :].tolist()
    return _rows(list(estimate.parameter_names), estimate.parameters.tolist(), std, 'kg m^2')


def _rows(
    names: list[str], values: list[float], stds: list[float], unit: str
) -> list[tuple[str, float, float, str]]:
    return [(name, v, s, unit) for name, v, s in zip(names, values, stds, strict=True)]


def _table(rows: list[tuple[str, float, float, str]], notes: tuple[str, ...] = ()) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column('name')
    for column in ('value', '+- std'):
        table.add_column(column, justify='right')
    table.add_column('unit')
    if notes:
        table.add_column('groups')
    for i, (name, value, std, unit) in enumerate(rows):
        digits = decimals(std)
        cells = (name, f'{value:.{digits}f}', f'{std:.{digits}f}', unit, *notes[i : i + 1])
        table.add_row(*(Text(cell) for cell in cells))
    return table


def _advice_table(advice: tuple[Advice, ...]) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table('extra motion', 'tells', box=box.SIMPLE_HEAD, pad_edge=False)
    for one in advice:
        table.add_row(Text(one.motion or 'none of those tried'), Text('\n'.join(one.tells)))
    return table


def decimals(std: float) -> int:
    """Decimals that show a standard deviation with two digits, and its value as far as it goes."""
    if not math.isfinite(std) or std <= 0.0:
        return 6
    return min(max(1 - math.floor(math.log10(std)), 0), 12)
