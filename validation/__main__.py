"""Experiments, campaigns and benchmarks: `python -m validation NAME`.

Every figure stands beside the one that is published or wanted. A campaign writes
OUT/report.html and OUT/results.json; most write their tables as Markdown, too, and go on where
they stopped.

{campaigns}

programs with options of their own, shown by `python -m validation NAME --help`:
{programs}

Examples:
  python -m validation wheel-momentum --quick
  python -m validation coverage --runs 200 --out out/coverage
  python -m validation diagnosis --only left_out --jobs 2 --out out/left-out
  python -m validation wheel-momentum --json | jq '.checks[] | select(.is_met | not)'
  python -m validation replay --quick

exit status: 0 every figure is reached, 1 some are not (they are listed), 2 unusable input
"""

from __future__ import annotations

import argparse
import math
import os
import re
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

from spacerobot_ros.batch.workers import Workers
from spacerobot_ros.cli.terminal import print_json, print_sections, progress
from spacerobot_ros.display import (
    KeyFigure,
    KeyFigures,
    Report,
    Section,
    table_of,
)
from spacerobot_ros.errors import ConfigurationError, SpaceRobotError
from spacerobot_ros.interrupts import interruptible
from spacerobot_ros.json_values import json_text
from spacerobot_ros.model.files import write_text
from spacerobot_ros.report.html import write_report

from .campaigns import CAMPAIGNS, Campaign, Check, finish
from .tables import markdown

PROGRAMS = {
    'replay': 'what a change of the code changed of the answers to 130 recordings',
    'bench.simulation': 'simulators side by side at equal accuracy',
    'bench.regressor': "regressors beside Pinocchio's",
    'bench.scaling': 'time and memory of a diagnosis by joints and samples',
    'bench.node_start': 'time from the start of a node to its first message',
    'bench.latency': 'time from a sample to the command that answers it',
    'bench.lockstep': 'speed of all nodes in lockstep',
    'bench.long_run': 'memory of all nodes in a long run',
    'bench.executor_kills': 'nodes of which peers are killed',
    'bench.killed_workers': 'records of a cluster whose workers are killed',
}
"""Modules that parse options of their own, and what they measure."""
_HERE = Path(__file__).resolve().parent


def main(argv: Sequence[str] | None = None) -> int:
    """Run the campaign or the program that the arguments name; returns the exit status."""
    words = sys.argv[1:] if argv is None else list(argv)
    if words and words[0] in PROGRAMS:
        _program(*words)
    args = _parser().parse_args(words)
    try:
        with interruptible():
            return run(CAMPAIGNS[args.name], args)
    except SpaceRobotError as error:
        print(f'validation: {error}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print('validation: interrupted', file=sys.stderr)
        return 130


def _program(name: str, *words: str) -> NoReturn:
    """Become a program: a benchmark is a script, whose peers know nothing of this package."""
    script = str(_HERE.joinpath(*name.split('.')).with_suffix('.py'))
    module = f'{__package__}.{name}'
    begin = [script] if name.startswith('bench.') else ['-m', module]
    path = os.pathsep.join([str(_HERE.parent), os.environ.get('PYTHONPATH', '')])
    sys.stdout.flush()
    os.execve(sys.executable, [sys.executable, *begin, *words], {**os.environ, 'PYTHONPATH': path})


def _parser() -> argparse.ArgumentParser:
    described = (f'{c.name}: {c.help}'.replace('\n', '\n  ') for c in CAMPAIGNS.values())
    programs = '\n'.join(f'  {name:<22}{what}' for name, what in PROGRAMS.items())
    parser = argparse.ArgumentParser(
        prog='python -m validation',
        description=__doc__.format(campaigns='\n\n'.join(described), programs=programs),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add('name', metavar='NAME', choices=(*CAMPAIGNS, *PROGRAMS), help='one of those above')
    add('--runs', type=_count, metavar='N', help='2 or more; what it counts depends on NAME')
    add('--quick', action='store_true', help='a fifth of the work or less')
    add('--only', default='', metavar='TEXT', help='trials whose key holds this')
    add('--minutes', type=float, default=math.inf, help='begin nothing new after that time')
    add('--jobs', type=int, default=len(os.sched_getaffinity(0)), help='processes')
    add('--scheduler', default='', help='address of a Dask cluster that exists')
    add('--out', default='', metavar='DIR', help='default: out/NAME')
    add('--json', action='store_true', help='print JSON, and nothing else')
    return parser


def _count(text: str) -> int:
    value = int(text)
    if value < 2:
        raise argparse.ArgumentTypeError(f'{text} must be 2 or above')
    return value


def run(campaign: Campaign, args: argparse.Namespace) -> int:
    """Run a campaign, write its page and print it; 0 where every figure is reached."""
    started = time.monotonic()
    folder = Path(args.out or f'out/{campaign.name}')
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError('--out', f'{folder}: {error.strerror}') from error
    experiment = campaign.load()
    runs = args.runs or (campaign.quick_runs if args.quick else campaign.runs)
    keys = [key for key in experiment.trials(runs, args.quick) if args.only in key]
    if args.only and not keys:
        raise ConfigurationError('--only', f'no trial of {campaign.name} has {args.only!r} in it')
    workers = Workers(number=args.jobs if args.jobs > 1 else 0, scheduler=args.scheduler)
    minutes = args.minutes if campaign.is_kept else math.inf  # others are judged as a whole
    with progress() as stage:
        found = finish(campaign, keys, folder, workers, stage('running', len(keys)), minutes)
    results = experiment.results(found.records)
    checks, tables = campaign.judge(results), campaign.tables(results)
    data = {
        **{'schema': 1, 'experiment': campaign.name, **results, 'checks': checks},
        **{'failures': found.failures, 'wall_s': round(time.monotonic() - started, 1)},
    }
    write_text(folder / 'results.json', json_text(data))
    sections = [Section(table.title, [replace(table, title='')]) for table in tables]
    if campaign.is_kept:
        write_text(folder / campaign.markdown, markdown(campaign.title, sections))
    shown = [_asked(campaign, checks), *campaign.drawings(found.records, results), *sections]
    page = write_report(Report(campaign.title, campaign.subtitle, shown), folder / 'report.html')
    missed = [check for check in checks if not check.is_met]
    if args.json:
        print_json(data)
    else:
        said = [f'{len(checks) - len(missed)} of {len(checks)} figures are reached']
        said += [f'missed: {check}' for check in missed]
        said += [f'failed: {key}: {why}' for key, why in found.failures.items()]
        print_sections([*sections, Section('', [*said, f'report: {page}'])])
    return int(bool(missed or found.failures))


def _asked(campaign: Campaign, checks: Sequence[Check]) -> Section:
    """Figures to reach; those that the reader came for in large."""
    met, total = sum(check.is_met for check in checks), len(checks)
    reached = f'{met} of {total}'
    figures = [KeyFigure('figures reached', reached, status='good' if met == total else 'bad')]
    for c in checks:
        if re.search(campaign.headlines, c.what):
            wanted, status = f'wanted: {c.low:.4g} to {c.high:.4g}', 'good' if c.is_met else 'bad'
            figures.append(KeyFigure(c.what, f'{c.value:.4g}', c.unit, wanted, status))
    table = table_of(
        [{'c': c, 'reached': 'yes' if c.is_met else 'NO'} for c in checks],
        'figure | value | from | to | unit | reached',
        '{c.what} | {c.value:.4g} | {c.low:.4g} | {c.high:.4g} | {c.unit} | {reached}',
    )
    return Section('Figures to reach', [KeyFigures(figures), table])


if __name__ == '__main__':
    sys.exit(main())
