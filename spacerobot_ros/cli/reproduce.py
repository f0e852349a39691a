"""`spacerobot reproduce`: published experiments and campaigns beside the figures to reach.

Repeat experiments and show every figure beside the one that is printed or wanted.

{campaigns}

writes OUT/report.html and OUT/results.json; diagnosis and monitor their tables as Markdown, too

examples:
  spacerobot reproduce wheel-momentum
  spacerobot reproduce wheel-momentum --quick
  spacerobot reproduce wheel-momentum --campaign coverage --runs 200 --out out/coverage
  spacerobot reproduce adaptive-control --runs 20
  spacerobot reproduce diagnosis --jobs 2 --out out/diagnosis-campaign
  spacerobot reproduce diagnosis --only left_out --out out/left-out
  spacerobot reproduce monitor --runs 40 --out out/monitor-campaign
  spacerobot reproduce wheel-momentum --json | jq '.checks[] | select(.is_met | not)'

exit status: 0 every figure is reached, 1 some are not (they are listed), 2 unusable input
"""

from __future__ import annotations

import argparse
import math
import re
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..campaign.description import COVERAGE, EXPERIMENTS, Campaign, Check
from ..display import GoodOrBad, KeyFigure, KeyFigures, Report, Section, Table, table_of
from ..errors import ConfigurationError
from .options import (
    check_folder,
    workers_of,
)

if TYPE_CHECKING:
    from ..campaign.runner import Finished


def known() -> dict[str, Any]:
    """What the arguments' texts and choices take from the code."""
    every = (*EXPERIMENTS.values(), COVERAGE)
    return {
        'choices': {'experiment': tuple(EXPERIMENTS), 'campaign': (COVERAGE.name,)},
        'campaigns': '\n\n'.join(map(_help, EXPERIMENTS.values())),
        'coverage': f'{COVERAGE.help.replace("%", "%%")} {_goes_on(COVERAGE)}',
        'runs': ', '.join(f'{c.name} {c.runs}' for c in every),
    }


def _help(campaign: Campaign) -> str:
    text = f'{campaign.name}: {campaign.help}'.replace('\n', '\n  ')
    return f'{text}.\n  {_goes_on(campaign)}' if campaign.file else text


def _goes_on(campaign: Campaign) -> str:
    return f'Goes on where it stopped (OUT/{campaign.file})'


def run(args: argparse.Namespace) -> int:
    """Reproduce, write the report and print; 0 where every figure is reached."""
    from ..campaign.runner import finish
    from ..json_values import json_text
    from ..model.files import write_text
    from .terminal import print_json, print_sections, progress

    started, campaign = time.monotonic(), EXPERIMENTS[args.experiment]
    folder = check_folder(args.out)  # before the work is done, not after
    folder.mkdir(parents=True, exist_ok=True)
    if args.campaign and campaign.name != 'wheel-momentum':
        raise ConfigurationError('--campaign coverage', 'belongs to wheel-momentum')
    campaign = COVERAGE if args.campaign else campaign
    experiment, workers = campaign.load(), workers_of(args, isolated=False)
    runs = args.runs or (campaign.quick_runs if args.quick else campaign.runs)
    keys = [key for key in experiment.trials(runs, args.quick) if (args.only or '') in key]
    if args.only and not keys:
        raise ConfigurationError(
            '--only', f'no trial of {campaign.name} has {args.only!r} in its key'
        )
    with progress() as stage:
        done = stage('reproducing', len(keys))
        minutes = (campaign.file and args.minutes) or math.inf  # others are judged as a whole
        found = finish(campaign, keys, folder, workers, done, minutes)
    records = found.records
    results = experiment.results(records)
    checks, tables = experiment.judge(results), experiment.tables(results)
    data = {'schema': 1, 'experiment': campaign.name, **results, 'checks': checks}
    data['failures'] = found.failures
    data['wall_s'] = round(time.monotonic() - started, 1)
    write_text(folder / 'results.json', json_text(data))
    sections = [Section(table.title, [replace(table, title='')]) for table in tables]
    page = _write(campaign, checks, campaign.drawings(records, results), sections, folder)
    if args.json:
        print_json(data)
    else:
        print_sections(
            [*sections, Section('', [*_missed(checks), *_failed(found), f'report: {page}'])]
        )
    return 0 if all(check.is_met for check in checks) and not found.failures else 1


def _write(
    campaign: Campaign,
    checks: Sequence[Check],
    plots: Sequence[Section],
    tables: Sequence[Section],
    folder: Path,
) -> Path:
    """Write `report.html`, and tables that are kept beside it; returns its path."""
    from ..display import markdown
    from ..model.files import write_text
    from ..report.html import write_report

    if campaign.markdown:
        write_text(folder / campaign.markdown, markdown(campaign.title, tables))
    asked = Section('Figures to reach', [_key_figures(campaign, checks), _checks(checks)])
    report = Report(campaign.title, campaign.subtitle, [asked, *plots, *tables])
    return write_report(report, folder / 'report.html')


def _key_figures(campaign: Campaign, checks: Sequence[Check]) -> KeyFigures:
    met = sum(check.is_met for check in checks)
    total = f'{met} of {len(checks)}'
    figures = [KeyFigure('figures reached', total, status=_status(met == len(checks)))]
    for c in checks:
        if re.search(campaign.headlines, c.what):
            wanted = f'wanted: {c.low:.4g} to {c.high:.4g}'
            figures.append(KeyFigure(c.what, f'{c.value:.4g}', c.unit, wanted, _status(c.is_met)))
    return KeyFigures(figures)


def _status(is_good: bool) -> GoodOrBad:
    return 'good' if is_good else 'bad'


def _checks(checks: Sequence[Check]) -> Table:
    return table_of(
        '',
        '',
        [{'c': c, 'reached': 'yes' if c.is_met else 'NO'} for c in checks],
        'figure | value | from | to | unit | reached',
        '{c.what} | {c.value:.4g} | {c.low:.4g} | {c.high:.4g} | {c.unit} | {reached}',
    )


def _missed(checks: Sequence[Check]) -> list[str]:
    """How many figures are reached, and which are not."""
    missed = [check for check in checks if not check.is_met]
    return [
        f'{len(checks) - len(missed)} of {len(checks)} figures are reached',
        *(
            f'missed: {c.what}: {c.value:.4g} (wanted: {c.low:g} to {c.high:g} {c.unit})'
            for c in missed
        ),
    ]


def _failed(found: Finished) -> list[str]:
    """Trials that gave no record, and why."""
    return [f'failed: {key}: {why}' for key, why in found.failures.items()]
