"""Runs tasks to the end: whoever works, going on where it stopped, always the same records.

What is kept has one line of JSON a finished task in a file of its own: what was interrupted goes
on from there, and more tasks add to those there are.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from io import RawIOBase
from itertools import chain, islice, takewhile
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError, RecordingError
from ..json_values import json_value
from .workers import ATTEMPTS, Outcome, TaskError, Workers, attempt

TrialRecord = dict[str, Any]
"""Plain JSON data of one task, its key as `case`."""
_HERE = Workers()


@dataclass(frozen=True, slots=True)
class Kept:
    """Records of finished tasks in a file, one line of JSON each.

    Args:
        path: The file; None keeps nothing.
    """

    path: Path | None

    def read(self) -> list[TrialRecord]:
        """Finished tasks, none where nothing has begun; a line that was cut off is none.

        Raises:
            RecordingError: a line that is no record.
        """
        if self.path is None or not self.path.exists():
            return []
        complete = self.path.read_text(encoding='utf-8').split('\n')[:-1]
        return [self._record(number, line) for number, line in enumerate(complete, 1)]

    def appending(self) -> AbstractContextManager[RawIOBase | None]:
        """The file to add to, without what an interruption left of a line; None: no file."""
        if self.path is None:
            return nullcontext()
        try:
            if self.path.exists():
                with self.path.open('rb+') as file:
                    file.truncate(file.read().rfind(b'\n') + 1)
            return self.path.open('ab', buffering=0)  # no rest that fails again when it is closed
        except OSError as error:
            raise self._unwritable(error) from error

    def add(self, file: RawIOBase, record: Mapping[str, Any]) -> None:
        """Write a finished task.

        Raises:
            ConfigurationError: the disk is full, or the file can't be written any more.
        """
        rest = memoryview(f'{json.dumps(record)}\n'.encode())
        try:
            while rest:
                rest = rest[file.write(rest) or 0 :]
        except OSError as error:
            raise self._unwritable(error) from error

    def _unwritable(self, error: OSError) -> ConfigurationError:
        why = f'can not be written: {error.strerror}; what was finished before stays'
        return ConfigurationError(str(self.path), why)

    def _record(self, number: int, line: str) -> TrialRecord:
        try:
            record: TrialRecord = json.loads(line)
            str(record['case'])
        except (ValueError, TypeError, KeyError):
            where = f'{self.path}:{number}'
            raise RecordingError(where, 'is no case of a campaign') from None
        return record


@dataclass(frozen=True, slots=True)
class Finished:
    """What came of tasks.

    Args:
        records: Of those that finished, in the order of their keys.
        failures: Why the others gave none, by key; the next run tries them anew.
    """

    records: list[TrialRecord]
    failures: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tasks:
    """What is to be done with keys.

    Args:
        run: A module's function of a key, or a `functools.partial` of one.
        kept: Where records are kept.
        record_of: Makes of key and result what is kept; it may write files before.
        alone: Beginnings of keys that are run in this process, before others compete.
    """

    run: Callable[[str], Any]
    kept: Kept
    record_of: Callable[[str, Any], TrialRecord] = lambda key, result: {'case': key, **result}
    alone: tuple[str, ...] = ()


def complete(
    tasks: Tasks,
    keys: Sequence[str],
    workers: Workers = _HERE,
    done: Callable[[float], None] = lambda _: None,
    minutes: float = math.inf,
) -> Finished:
    """Run the tasks that are not finished yet.

    Args:
        tasks: What is to be done.
        keys: All of them.
        workers: Who runs them.
        done: Called with the number of tasks that are over after each.
        minutes: Time after which nothing new is begun.

    Returns:
        Every finished task, in the order of the keys, and why others are none.

    Raises:
        RecordingError: the file of what is kept is none.
        ConfigurationError: workers that can't be used, or a record that can't be written; those
            before it are kept.
    """
    last = time.monotonic() + 60.0 * minutes
    there = {record['case']: record for record in tasks.kept.read()}
    before = len(there.keys() & set(keys))
    done(before)
    missing = [key for key in keys if key not in there]
    alone = [key for key in missing if key.startswith(tasks.alone)]
    others = [key for key in missing if not key.startswith(tasks.alone)]
    failures = {}
    with tasks.kept.appending() as file:
        found = (
            outcomes(tasks.run, takewhile(lambda _: time.monotonic() <= last, some), who)
            for some, who in ((alone, _HERE), (others, workers))
        )
        for over, outcome in enumerate(chain.from_iterable(found), before + 1):
            if outcome.failure:
                failures[outcome.key] = outcome.failure
            else:
                record = json_value(tasks.record_of(outcome.key, outcome.result))
                there[outcome.key] = record
                if file is not None:
                    tasks.kept.add(file, record)
            done(over)
    return Finished([there[key] for key in keys if key in there], failures)


def outcomes(
    run: Callable[[str], Any], keys: Iterable[str], workers: Workers
) -> Iterator[Outcome]:
    """Run every task; the one place that knows how they are spread.

    Args:
        run: A module's function of a key, or a `functools.partial` of one.
        keys: Of the tasks; taken one by one, when somebody is free.
        workers: Who runs them.

    Yields:
        One outcome a key, as they finish.

    Raises:
        ConfigurationError: no such cluster, or one without a worker that fits.
    """
    every = iter(keys)
    first = list(islice(every, 1))  # nobody starts a cluster for nothing
    if workers.number == 0 and not workers.scheduler:
        yield from (_insisted(run, key) for key in chain(first, every))
    elif first:
        from .cluster import spread

        yield from spread(run, chain(first, every), workers)


def _insisted(run: Callable[[str], Any], key: str, times: int = ATTEMPTS) -> Outcome:
    try:
        return attempt(run, key)
    except TaskError as error:
        if times > 1:
            return _insisted(run, key, times - 1)
        return Outcome(key, failure=str(error))
