"""The demonstration's results in the terminal and as JSON."""

from __future__ import annotations

import json
import os
from pathlib import Path

from rich.console import Console
from rich.table import Table

from .page import AIM_AAM_PERCENT, AIM_DRIFT, AIM_RATIO
from .results import Results


def reached(results: Results) -> bool:
    """Whether the demonstration shows what it promises."""
    ratio = results.no_aam.max_error_deg / results.identified.max_error_deg
    is_known = results.estimate.valid and results.aam_error_percent < AIM_AAM_PERCENT
    return is_known and ratio > AIM_RATIO and results.momentum_drift < AIM_DRIFT


def write_summary(results: Results, path: Path) -> None:
    """Write summary.json, complete or not at all."""
    partial = path.with_suffix('.tmp')
    partial.write_text(json.dumps(results.summary(), indent=2) + '\n', encoding='utf-8')
    os.replace(partial, path)


def print_table(results: Results, out: Path) -> None:
    """Print what was found, and where the rest lies."""
    console = Console()
    estimate = results.estimate
    table = Table(title='Momentum of the captured wheels [N m s]', title_justify='left')
    for title in ('link, axis', 'estimate', '3 std', 'truth', 'error [%]'):
        table.add_column(title, justify='left' if title == 'link, axis' else 'right')
    for i, (value, std, true) in enumerate(
        zip(estimate.aam, estimate.std, results.truth.aam, strict=False)
    ):
        percent = f'{100.0 * (value - true) / abs(true):+.3f}' if true else '-'
        where = f'{estimate.aam_links[i // 3]}, {"xyz"[i % 3]}'
        table.add_row(where, f'{value:.4f}', f'{3.0 * std:.4f}', f'{true:.4f}', percent)
    console.print(table)
    no_aam, identified = results.no_aam.max_error_deg, results.identified.max_error_deg
    lines = (
        f'largest joint error    {no_aam:.3f} deg without, {identified:.4f} deg with it '
        f'({no_aam / identified:.0f} times smaller)',
        f'inertial parameters    within {results.parameter_error_percent:.3f} %',
        f'momentum drift         {results.momentum_drift:.1e} relative',
        f'wall time              {results.wall:.1f} s',
        f'report                 {out / "report.html"}',
        f'bags                   {", ".join(results.bags)}',
    )
    for line in lines:
        console.print(line, highlight=False, soft_wrap=True)
