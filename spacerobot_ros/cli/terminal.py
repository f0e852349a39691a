"""What the commands print: sections of a report, JSON, progress."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ..display import Section, Table

if TYPE_CHECKING:
    from rich.console import Console

_WIDTH = 160  # columns, where the output is no terminal
_UPDATES = 200  # of a progress bar
_RATE_PERIOD = 600.0  # s over which the time that is left is estimated
_QUIET, _APART, _LONGEST = 5.0, 1.0, 60.0
"""Of lines, where no terminal is: none in the first s; s between two, at least and at the most."""


Advance = Callable[..., None]
"""Called with the part of a stage that is done, and what is being done where that changes."""
Stage = Callable[[str, float], Advance]
"""Called with what is being done and its total."""


def print_json(value: Any) -> None:
    """A result as JSON; what is not finite as null."""
    from ..json_values import json_text

    print(json_text(value), end='')


def print_answer(
    as_json: bool, value: Any, sections: Iterable[Section], written: str = ''
) -> None:
    """An answer for programs or for people.

    Args:
        as_json: Whether as JSON, and nothing else.
        value: What that is.
        sections: What people read.
        written: Named to people as written; empty for nothing.
    """
    if as_json:
        print_json(value)
    else:
        print_sections(sections)
        if written:
            print(f'written: {written}')


def print_sections(sections: Iterable[Section]) -> None:
    """Texts and tables of a report below their titles, texts indented; empty ones are left out."""
    from rich.console import Console

    console = Console(highlight=False, emoji=False, width=None if sys.stdout.isatty() else _WIDTH)
    for section in sections:
        if section.title and section.items:
            console.print(section.title, markup=False, style='bold')
        for item in section.items:
            if isinstance(item, str):
                text = f'  {item}' if section.title else item
                console.print(text, markup=False, soft_wrap=True)
            elif isinstance(item, Table):  # others are of the page
                _print_table(console, item)


def _print_table(console: Console, table: Table) -> None:
    from rich import box
    from rich.table import Table as Grid
    from rich.text import Text as Cell

    from ..formats import NO_NUMBERS, is_number

    if table.title:
        console.print(table.title, markup=False, style='bold')
    if table.caption:
        console.print(table.caption, markup=False, style='dim')
    grid = Grid(box=box.SIMPLE_HEAD, pad_edge=False)
    for column, name in enumerate(table.head):
        cells = [row[column] for row in table.rows] if column else ['first']
        is_right = all(cell in NO_NUMBERS or is_number(cell) for cell in cells)
        justify: Any = 'right' if is_right else 'left'
        grid.add_column(Cell(name), justify=justify, overflow='fold')
    for row in table.rows:
        grid.add_row(*(Cell(cell) for cell in row))
    console.print(grid)


@contextmanager
def progress() -> Iterator[Stage]:
    """Progress on stderr: a bar a stage; where that is no terminal a line now and then."""
    if not sys.stderr.isatty():
        yield _lines(time.monotonic())
        return
    from rich.console import Console
    from rich.progress import Progress, TimeElapsedColumn

    columns, console = Progress.get_default_columns(), Console(stderr=True)
    with Progress(
        TimeElapsedColumn(), *columns, console=console, transient=True,
        speed_estimate_period=_RATE_PERIOD,
    ) as bar:  # fmt: skip

        def stage(what: str, total: float) -> Advance:
            task, shown = bar.add_task(what, total=total), [0.0]

            def advance(done: float, what: str = '') -> None:
                if what or done >= total or done - shown[0] >= total / _UPDATES:
                    shown[0] = done
                    bar.update(task, completed=done, description=what or None)

            return advance

        yield stage


def _lines(start: float) -> Stage:
    """Lines in place of bars, none of a quick command.

    Args:
        start: `time.monotonic` when it began.
    """
    last = start + _QUIET - _APART

    def stage(what: str, total: float) -> Advance:
        name, shown, is_new = what, 0, True

        def advance(done: float, what: str = '') -> None:
            nonlocal last, name, shown, is_new
            name, is_new = what or name, is_new or bool(what)
            percent, since = int(100 * done // total) if total else 100, time.monotonic() - last
            is_worth_it = is_new or percent // 10 > shown // 10 or since >= _LONGEST
            if since >= _APART and is_worth_it:
                last, shown, is_new = last + since, percent, False
                print(f'{name}: {percent} %', file=sys.stderr, flush=True)

        return advance

    return stage
