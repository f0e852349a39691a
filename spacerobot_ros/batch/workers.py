"""Who runs tasks: this process, or workers of a Dask cluster; one outcome a task.

A task is a function of its key alone, so that its result is the same whoever runs it, and in
whatever order. One that raises, whose process dies or that takes too long is tried again; after
that its message is its outcome, and the others go on.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..errors import SpaceRobotError, shortened

ATTEMPTS = 3
"""A worker that is killed from outside may take a task along, hardly ever the same one thrice."""
_LONGEST = 300  # characters of a message


@dataclass(frozen=True, slots=True, kw_only=True)
class Workers:
    """Who runs tasks.

    Args:
        number: Processes on this machine; 0 stays in this one.
        scheduler: Address of a Dask cluster that exists, in place of processes of our own.
        memory: Of each process of our own [bytes]; None: an equal share of the machine's.
        timeout: Time after which a task hangs [s]; needs a process of its own.
        dashboard: Whether Dask shows its page on this machine.
        notice: Told a line, such as who works.
    """

    number: int = 0
    scheduler: str = ''
    memory: int | None = None
    timeout: float = 3600.0
    dashboard: bool = False
    notice: Callable[[str], None] = lambda _: None


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a task.

    Args:
        key: Its key.
        result: What it returned.
        failure: Why it returned nothing; empty where it did.
    """

    key: str
    result: Any = None
    failure: str = ''


class TaskError(Exception):
    """A task failed, and not on purpose: another attempt may not."""


def has_dask() -> bool:
    """Whether the extra `fleet` is installed."""
    return importlib.util.find_spec('distributed') is not None


def attempt(run: Callable[[str], Any], key: str) -> Outcome:
    """Run a task once.

    Raises:
        TaskError: whatever another attempt may do without.
    """
    try:
        return Outcome(key, run(key))
    except SpaceRobotError as error:
        return Outcome(key, failure=in_a_line(error))
    except Exception as error:  # noqa: BLE001  whatever it is, it costs this task only
        raise TaskError(in_a_line(error, is_ours=True)) from None


def in_a_line(error: BaseException, is_ours: bool = False) -> str:
    """The message of an error, with its kind where nobody raised it on purpose."""
    text = f'{type(error).__name__}: {error}' if is_ours else str(error)
    return shortened(' '.join(text.split()), _LONGEST)
