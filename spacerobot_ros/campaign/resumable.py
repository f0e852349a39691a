"""Campaigns that go on where they stopped: one line of JSON a finished case."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..errors import RecordingError
from .tasks import Task, run_tasks

Line = dict[str, Any]
_CHUNK = 4  # cases a process between two writes


def run_resumable(
    path: Path,
    tasks: Sequence[Task],
    workers: int,
    done: Callable[[], None],
    minutes: float = math.inf,
) -> list[Line]:
    """Do the cases that a file lacks.

    Args:
        path: The file; it need not exist.
        tasks: All cases, their keys text; each returns plain data with its key as `case`.
        workers: Processes.
        done: Called after each case, and for each that is there.
        minutes: Time after which nothing new is begun.

    Returns:
        Every finished case, in the order of the tasks.

    Raises:
        RecordingError: the file is not a campaign's.
    """
    there = {line['case']: line for line in read_lines(path)}
    _drop_cut_line(path)
    missing = [task for task in tasks if task.key not in there]
    for _ in range(len(tasks) - len(missing)):
        done()
    started = time.monotonic()
    chunk = _CHUNK * workers if workers > 1 else 1
    for first in range(0, len(missing), chunk):
        if time.monotonic() - started > 60.0 * minutes:
            break
        finished = run_tasks(missing[first : first + chunk], workers, done)
        there |= {str(key): line for key, line in finished.items()}
        with path.open('a', encoding='utf-8') as file:
            file.writelines(json.dumps(line) + '\n' for line in finished.values())
    return [there[str(task.key)] for task in tasks if task.key in there]


def read_lines(path: Path) -> list[Line]:
    """Finished cases, none where the campaign has not begun; a line that was cut off is no case.

    Raises:
        RecordingError: a line that is no case.
    """
    if not path.exists():
        return []
    complete = path.read_text(encoding='utf-8').split('\n')[:-1]
    out = [_line_of(text) for text in complete]
    if None in out:
        raise RecordingError(f'{path}:{out.index(None) + 1}', 'is no case of a campaign')
    return [line for line in out if line is not None]


def _drop_cut_line(path: Path) -> None:
    """Cut off what an interruption left of a line, so that the next one begins a new line."""
    if path.exists():
        with path.open('rb+') as file:
            file.truncate(file.read().rfind(b'\n') + 1)


def _line_of(text: str) -> Line | None:
    """The case that a line holds, None where it holds none."""
    try:
        line = json.loads(text)
        return {**line, 'case': line['case']}
    except (ValueError, TypeError, KeyError):
        return None
