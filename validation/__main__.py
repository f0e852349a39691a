"""`python -m validation NAME`: experiments, campaigns and benchmarks

Every figure stands beside the one that is published or wanted. A campaign writes
OUT/report.html and OUT/results.json; most write their tables as Markdown, too, and go on where
they stopped.

{campaigns}

programs with options of their own, shown by `python -m validation NAME --help`:
{programs}

examples:
  python -m validation wheel-momentum --quick
  python -m validation coverage --runs 200 --out out/coverage
  python -m validation diagnosis --only left_out --jobs 2 --out out/left-out
  python -m validation wheel-momentum --json | jq '.checks[] | select(.is_met | not)'
  python -m validation replay --quick

exit status: 0 every figure is reached, 1 some are not (they are listed), 2 unusable input
"""

from __future__ import annotations

import math
import os
import re
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import click

from spacerobot_ros.cli import options as opt
from spacerobot_ros.cli.main import settled
from spacerobot_ros.cli.terminal import print_json, print_sections, progress
from spacerobot_ros.display import (
    KeyFigure,
    KeyFigures,
    Report,
    Section,
    table_of,
)
from spacerobot_ros.errors import ConfigurationError
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
    return settled('validation', lambda words: opt.invoked(run, 'validation', words), words)


def _program(name: str, *words: str) -> NoReturn:
    """Become a program: a benchmark is a script, whose peers know nothing of this package."""
    script = str(_HERE.joinpath(*name.split('.')).with_suffix('.py'))
    module = f'{__package__}.{name}'
    begin = [script] if name.startswith('bench.') else ['-m', module]
    path = os.pathsep.join([str(_HERE.parent), os.environ.get('PYTHONPATH', '')])
    sys.stdout.flush()
    os.execve(sys.executable, [sys.executable, *begin, *words], {**os.environ, 'PYTHONPATH': path})


def _about() -> str:
    described = (f'{c.name}: {c.help}'.replace('\n', '\n  ') for c in CAMPAIGNS.values())
    programs = '\n'.join(f'  {name:<22}{what}' for name, what in PROGRAMS.items())
    return str(__doc__).format(campaigns='\n\n'.join(described), programs=programs)


@opt.command(_about())
@click.argument('name', metavar='NAME', type=click.Choice([*CAMPAIGNS]))
@opt.count('--runs', 'what it counts depends on NAME', 2)
@opt.switch('--quick', help='a fifth of the work or less')
@opt.option('--only', default='', metavar='TEXT', help='trials whose key holds this')
@opt.positive('--minutes', metavar='M', help='begin nothing new after that time')
@opt.path('--out', metavar='DIR', help='folder to write (default: out/NAME)')
@opt.as_json
@opt.workers
def run(
    name: str, runs: int | None, quick: bool, only: str, minutes: float | None, out: str | None,
    as_json: bool, **who: Any,
) -> int:  # fmt: skip
    """Run a campaign, write its page and print it; 0 where every figure is reached."""
    started, campaign = time.monotonic(), CAMPAIGNS[name]
    folder = opt.check_folder(out or f'out/{name}')
    folder.mkdir(parents=True, exist_ok=True)
    experiment = campaign.load()
    runs = runs or (campaign.quick_runs if quick else campaign.runs)
    keys = [key for key in experiment.trials(runs, quick) if only in key]
    if only and not keys:
        raise ConfigurationError('--only', f'no trial of {name} has {only!r} in it')
    workers = opt.workers_of(isolated=False, **who)
    limit = (campaign.is_kept and minutes) or math.inf  # others are judged as a whole
    with progress() as stage:
        found = finish(campaign, keys, folder, workers, stage('running', len(keys)), limit)
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
    if as_json:
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
