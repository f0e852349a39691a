"""What `spacerobot diagnose` prints for people."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from .diagnose_tables import (
    EVIDENCE_HEAD,
    PARAMETER_HEAD,
    RANKING_HEAD,
    RESIDUAL_HEAD,
    closed_loop_line,
    evidence_rows,
    gain_line,
    minor_lines,
    parameter_rows,
    ranking_rows,
    remaining,
    residual_rows,
    rival_lines,
    score_line,
)

if TYPE_CHECKING:
    from rich.console import Console

    from .diagnose_answer import Answer

_TEXT_COLUMNS = frozenset({'cause', 'where', 'parameter', 'unit', 'channel', 'effect'})


def print_summary(answer: Answer) -> None:
    """Print verdict, causes, evidence, residuals, gain and what to do next."""
    from rich.console import Console

    console = Console(highlight=False, width=None if sys.stdout.isatty() else 110)
    diagnosis = answer.diagnosis
    console.print(f'verdict: {diagnosis.verdict}', markup=False)
    console.print(diagnosis.sentence, markup=False, soft_wrap=True)
    if diagnosis.causes:
        _table(console, 'causes', PARAMETER_HEAD, parameter_rows(diagnosis.causes))
        _table(console, 'evidence', EVIDENCE_HEAD, evidence_rows(diagnosis.causes))
    _lines(console, 'rivals', rival_lines(diagnosis.causes))
    _lines(console, 'found, but too small to matter', minor_lines(diagnosis.minor))
    if diagnosis.verdict != 'consistent':
        _table(
            console,
            'best single effects, each against the model as it stands',
            RANKING_HEAD,
            ranking_rows(diagnosis),
        )
    _table(
        console,
        'residuals before and after (white p: probability that what is left is white noise)',
        RESIDUAL_HEAD,
        residual_rows(diagnosis),
    )
    console.print(gain_line(diagnosis), markup=False, soft_wrap=True)
    if answer.score:
        console.print(score_line(answer.score), markup=False, soft_wrap=True)
    if answer.closed_loop is not None:
        console.print(closed_loop_line(answer.closed_loop), markup=False, soft_wrap=True)
    _lines(console, 'what remains', remaining(diagnosis))
    _lines(console, 'what to fly next', diagnosis.next_motion)
    for note in diagnosis.notes:
        console.print(f'note: {note}', markup=False, soft_wrap=True)


def _lines(console: Console, title: str, lines: Iterable[str]) -> None:
    lines = list(lines)
    if not lines:
        return
    console.print(f'{title}:', markup=False)
    for line in lines:
        console.print(f'  {line}', markup=False, soft_wrap=True)


def _table(
    console: Console, title: str, head: Sequence[str], rows: Sequence[Sequence[str]]
) -> None:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name in head:
        table.add_column(name, justify='left' if name in _TEXT_COLUMNS else 'right')
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    console.print(title)
    console.print(table)
