"""`spacerobot reproduce`: published experiments beside the figures that their paper prints."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from .options import Formatter

if TYPE_CHECKING:
    from ..report.html import Table
    from ..reproduce.checks import Check
    from ..reproduce.wheel_momentum import Options

EXPERIMENTS = ('wheel-momentum',)
_RUNS, _QUICK_RUNS = 10, 2

_DESCRIPTION = """\
Repeat a paper's experiments and show every figure beside the printed one.

wheel-momentum: momentum-based identification of the captured wheels (docs/reproduction.md):
  minimal sets, condition numbers, Table III without and with noise, estimators against the
  Cramer-Rao bound, tracking with and without knowledge of the wheels (Figs 4-7), on the correct
  plant and on the one that the paper's equations describe

writes OUT/report.html and OUT/results.json
"""

_EPILOG = """\
examples:
  spacerobot reproduce wheel-momentum
  spacerobot reproduce wheel-momentum --quick
  spacerobot reproduce wheel-momentum --json | jq '.checks[] | select(.is_met | not)'

exit status: 0 every figure is reached, 1 some are not (they are listed), 2 unusable input
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the sub-command's arguments."""
    parser = subparsers.add_parser(
        'reproduce',
        help="repeat a paper's experiments beside its printed figures",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=Formatter,
    )
    parser.add_argument('experiment', choices=EXPERIMENTS, help='which paper')
    parser.add_argument('--json', action='store_true', help='print JSON, and nothing else')
    parser.add_argument('--out', default='out/reproduce', metavar='DIR', help='folder to write to')
    parser.add_argument('--quick', action='store_true', help='a fifth of the work')
    parser.add_argument(
        '--runs',
        type=_at_least_two,
        metavar='N',
        help=f'noisy records an estimator (default: {_RUNS}; {_QUICK_RUNS} with --quick)',
    )


def run(args: argparse.Namespace) -> int:
    """Reproduce, write the report and print; 0 where every figure is reached."""
    from ..reproduce.checks import checks
    from ..reproduce.to_dict import to_dict
    from ..reproduce.wheel_momentum import count_tasks
    from ..reproduce.wheel_momentum import run as reproduce
    from .reproduce_report import prepare, write
    from .reproduce_tables import tables

    started = time.monotonic()
    options = _options(args)
    prepare(Path(args.out))
    with _progress(count_tasks(options)) as done:
        results = reproduce(options, done)
    found = checks(results)
    data = {**to_dict(results, found), 'wall_s': round(time.monotonic() - started, 1)}
    page = write(results, found, Path(args.out), data)
    if args.json:
        print(json.dumps(data, indent=2, allow_nan=False))
    else:
        _print_human(tables(results), found, page)
    return 0 if all(check.is_met for check in found) else 1


def _options(args: argparse.Namespace) -> Options:
    from ..reproduce.wheel_momentum import Options

    workers = min(len(os.sched_getaffinity(0)), 8)
    if args.quick:
        return Options.quick(runs=args.runs or _QUICK_RUNS, workers=workers)
    return Options(runs=args.runs or _RUNS, workers=workers)


@contextmanager
def _progress(total: int) -> Iterator[Callable[[], None]]:
    """A progress bar on stderr where that is a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn

    columns = ('reproducing', BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    hidden = not sys.stderr.isatty()
    with Progress(*columns, console=Console(stderr=True), transient=True, disable=hidden) as bar:
        task = bar.add_task('reproducing', total=total)
        yield lambda: bar.advance(task)


def _print_human(tables: list[tuple[str, Table]], found: list[Check], page: Path) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table as Printed
    from rich.text import Text

    console = Console(highlight=False, width=None if sys.stdout.isatty() else 120)
    for title, table in tables:
        console.print(Text(title, style='bold'))
        if table.caption:
            console.print(Text(table.caption, style='dim'))
        printed = Printed(box=box.SIMPLE_HEAD, pad_edge=False)
        for column, name in enumerate(table.head):
            is_number = column > 0 and all(_is_number(row[column]) for row in table.rows)
            printed.add_column(Text(name), justify='right' if is_number else 'left')
        for row in table.rows:
            printed.add_row(*(Text(cell) for cell in row))
        console.print(printed)
    missed = [check for check in found if not check.is_met]
    console.print(f'{len(found) - len(missed)} of {len(found)} figures are reached')
    for check in missed:
        limits = f'{check.low:g} to {check.high:g} {check.unit}'
        console.print(f'missed: {check.what}: {check.value:.4g} (wanted: {limits})', markup=False)
    console.print(f'report: {page}', markup=False)


def _is_number(text: str) -> bool:
    return not text or text == '-' or text[0].isdigit() or text[0] in '+-<'


def _at_least_two(text: str) -> int:
    """A number of runs: a root mean square of one says nothing."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is not a whole number') from None
    if not 2 <= value <= 10_000:
        raise argparse.ArgumentTypeError(f'{text} must be from 2 to 10000')
    return value
