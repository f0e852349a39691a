"""`spacerobot reproduce`: published experiments beside the figures that their paper prints."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ConfigurationError
from .options import Formatter, positive_float

if TYPE_CHECKING:
    from ..campaign.checks import Check
    from ..display import Table
    from .reproduce_report import Page

_RUNS = {'wheel-momentum': 10, 'adaptive-control': 6, 'diagnosis': 300, 'monitor': 4}
EXPERIMENTS = tuple(_RUNS)
_QUICK_RUNS = 2
_CAMPAIGN, _QUICK_CAMPAIGN = 200, 12

_Outcome = tuple[list['Check'], dict[str, Any], 'Page']

_DESCRIPTION = """\
Repeat experiments and show every figure beside the one that is printed or wanted.

wheel-momentum: momentum-based identification of the captured wheels (docs/reproduction.md):
  minimal sets, condition numbers, Table III without and with noise, estimators against the
  Cramer-Rao bound, tracking with and without knowledge of the wheels (Figs 4-7), on the correct
  plant and on the one that the paper's equations describe

adaptive-control: adaptive control of base attitude and joints (docs/adaptive.md), on a robot of
  our own, since the paper's is not published: set-points with wrong parameters, Lambda sweep,
  harmonic tracking with all laws, inertia histories, noise, sampling limit, time of a cycle

diagnosis: hidden effects found and named (docs/diagnosis.md): clean records, every effect at
  several strengths, pairs, effects taken out of the catalogue; confusion, detection, false alarms.
  A night's work that goes on where it stopped (OUT/diagnosis.jsonl); --quick takes minutes

monitor: false alarms in nominal flight and delays of detection of the monitor node
  (docs/nodes/monitor.md): quarter hours without a fault, and faults of several sizes that set in.
  Goes on where it stopped (OUT/monitor.jsonl)

writes OUT/report.html and OUT/results.json; diagnosis and monitor their tables as Markdown, too
"""

_EPILOG = """\
examples:
  spacerobot reproduce wheel-momentum
  spacerobot reproduce wheel-momentum --quick
  spacerobot reproduce wheel-momentum --campaign coverage --runs 200 --out out/coverage
  spacerobot reproduce adaptive-control --runs 20
  spacerobot reproduce diagnosis --jobs 2 --out out/diagnosis-campaign
  spacerobot reproduce monitor --runs 40 --out out/monitor-campaign
  spacerobot reproduce wheel-momentum --json | jq '.checks[] | select(.is_met | not)'

exit status: 0 every figure is reached, 1 some are not (they are listed), 2 unusable input
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the sub-command's arguments."""
    parser = subparsers.add_parser(
        'reproduce',
        help='repeat published experiments and campaigns beside their figures',
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=Formatter,
    )
    parser.add_argument('experiment', choices=EXPERIMENTS, help='which experiments')
    parser.add_argument('--json', action='store_true', help='print JSON, and nothing else')
    parser.add_argument('--out', default='out/reproduce', metavar='DIR', help='folder to write to')
    parser.add_argument(
        '--jobs', type=_at_least_one, metavar='N', help='processes (default: one a core)'
    )
    parser.add_argument(
        '--minutes',
        type=positive_float,
        metavar='M',
        help='diagnosis: begin nothing new after that time (default: none)',
    )
    parser.add_argument('--quick', action='store_true', help='a fifth of the work')
    parser.add_argument(
        '--campaign',
        choices=('coverage',),
        help='wheel-momentum: do 95 %% intervals hold in many runs? Goes on where it stopped '
        '(OUT/coverage.jsonl)',
    )
    parser.add_argument(
        '--runs',
        type=_at_least_two,
        metavar='N',
        help='noisy records an estimator, wrong priors a law, clean records, or quarter hours of '
        'nominal flight a robot (default: '
        f'{", ".join(f"{name} {runs}" for name, runs in _RUNS.items())}, '
        f'coverage {_CAMPAIGN}; fewer with --quick)',
    )


def run(args: argparse.Namespace) -> int:
    """Reproduce, write the report and print; 0 where every figure is reached."""
    from .reproduce_report import prepare, write

    started = time.monotonic()
    prepare(Path(args.out))
    experiments = {
        'wheel-momentum': _wheel_momentum,
        'adaptive-control': _adaptive_control,
        'diagnosis': _diagnosis,
        'monitor': _monitor,
    }
    work = _coverage if args.campaign else experiments[args.experiment]
    found, plain, shown = work(args)
    data = {**plain, 'wall_s': round(time.monotonic() - started, 1)}
    page = write(shown, found, Path(args.out), data)
    if args.json:
        print(json.dumps(data, indent=2, allow_nan=False))
    else:
        _print_human(shown.tables, found, page)
    return 0 if all(check.is_met for check in found) else 1


def _wheel_momentum(args: argparse.Namespace) -> _Outcome:
    from ..campaign.checks import checks
    from ..campaign.to_dict import to_dict
    from ..campaign.wheel_momentum import count_tasks
    from ..campaign.wheel_momentum import run as reproduce
    from .reproduce_report import wheel_momentum_page

    options = _options(args)
    with _progress(count_tasks(options)) as done:
        results = reproduce(options, done)
    found = checks(results)
    return found, to_dict(results, found), wheel_momentum_page(results, found)


def _coverage(args: argparse.Namespace) -> _Outcome:
    from ..campaign.coverage import campaign_checks, run_campaign, score_campaign
    from .reproduce_coverage import page, to_dict

    if args.experiment != 'wheel-momentum':
        raise ConfigurationError('--campaign coverage', 'belongs to wheel-momentum')
    runs = args.runs or (_QUICK_CAMPAIGN if args.quick else _CAMPAIGN)
    with _progress(runs) as done:
        there = run_campaign(Path(args.out), runs, _workers(args), done)
    scores = score_campaign(there)
    found = campaign_checks(scores)
    return found, to_dict(scores, found), page(scores, found)


def _adaptive_control(args: argparse.Namespace) -> _Outcome:
    from ..campaign.adaptive_checks import checks
    from ..campaign.adaptive_control import count_tasks
    from ..campaign.adaptive_control import run as reproduce
    from .reproduce_adaptive import page, to_dict

    options = _options(args)
    with _progress(count_tasks(options)) as done:
        results = reproduce(options, done)
    found = checks(results)
    return found, to_dict(results, found), page(results, found)


def _diagnosis(args: argparse.Namespace) -> _Outcome:
    from ..campaign.diagnosis_campaign import Options, cases, run_campaign
    from ..campaign.diagnosis_score import campaign_checks, score
    from .reproduce_diagnosis import page, to_dict

    workers = _workers(args)
    options = Options.quick(workers) if args.quick else Options(workers=workers)
    if args.runs or not args.quick:
        options = replace(options, clean=args.runs or _RUNS['diagnosis'])
    if args.minutes:
        options = replace(options, minutes=args.minutes)
    with _progress(len(cases(options))) as done:
        lines = run_campaign(Path(args.out), options, done)
    scores = score(lines)
    found = campaign_checks(scores)
    return found, to_dict(scores, found), page(scores, found)


def _monitor(args: argparse.Namespace) -> _Outcome:
    from ..campaign.monitor_campaign import (
        Options,
        monitor_checks,
        run_campaign,
        score_monitor,
        tasks,
    )
    from .reproduce_monitor import page, to_dict

    workers = _workers(args)
    options = Options(flights=args.runs or _RUNS['monitor'], workers=workers)
    if args.quick:
        options = Options.quick(workers, args.runs or _QUICK_RUNS)
    with _progress(len(tasks(options))) as done:
        lines = run_campaign(Path(args.out), options, done)
    scores = score_monitor(lines)
    found = monitor_checks(scores)
    return found, to_dict(scores, found), page(scores, found)


def _options(args: argparse.Namespace) -> Any:
    from ..campaign import adaptive_control, wheel_momentum

    kinds = {
        'wheel-momentum': wheel_momentum.Options,
        'adaptive-control': adaptive_control.Options,
    }
    kind: Any = kinds[args.experiment]
    workers = _workers(args)
    if args.quick:
        return kind.quick(runs=args.runs or _QUICK_RUNS, workers=workers)
    return kind(runs=args.runs or _RUNS[args.experiment], workers=workers)


def _workers(args: argparse.Namespace) -> int:
    return args.jobs or min(len(os.sched_getaffinity(0)), 8)


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


def _print_human(tables: Sequence[tuple[str, Table]], found: list[Check], page: Path) -> None:
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


def _at_least_one(text: str) -> int:
    """A number of processes."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f'{text!r} is not a number of processes')
    return int(text)


def _at_least_two(text: str) -> int:
    """A number of runs: a root mean square of one says nothing."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is not a whole number') from None
    if not 2 <= value <= 10_000:
        raise argparse.ArgumentTypeError(f'{text} must be from 2 to 10000')
    return value
