"""Runs the trials of a campaign: on all cores, going on where it stopped, always the same result.

A campaign that keeps its records has one line of JSON a finished trial in its own file: what was
interrupted goes on from there, and more trials add to those there are.
"""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from itertools import chain, islice, takewhile
from pathlib import Path
from typing import Any

from ..errors import RecordingError
from ..json_values import json_value
from .description import Campaign, Record

_THREAD_LIMITS = ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS')


def finish(
    campaign: Campaign,
    keys: Sequence[str],
    folder: Path,
    workers: int = 1,
    done: Callable[[float], None] = lambda _: None,
    minutes: float = math.inf,
) -> list[Record]:
    """Run the trials that a folder lacks.

    Args:
        campaign: What to run.
        keys: All trials.
        folder: Where records are kept; it exists.
        workers: Processes.
        done: Called with the number of finished trials after each.
        minutes: Time after which nothing new is begun.

    Returns:
        Every finished trial, in the order of the keys; each has its key as `case`.

    Raises:
        RecordingError: the folder's file is not a campaign's.
    """
    path = folder / campaign.file if campaign.file else Path(os.devnull)
    there = {campaign.key_of(record): record for record in read_records(campaign, folder)}
    if campaign.file and path.exists():
        _drop_cut_line(path)
    finished = len(there.keys() & set(keys))
    done(finished)
    last = time.monotonic() + 60.0 * minutes
    alone = [key for key in keys if key not in there and key.startswith(campaign.alone)]
    others = [key for key in keys if key not in there and not key.startswith(campaign.alone)]
    run = campaign.load().run
    with path.open('a', encoding='utf-8') as file:
        for key, result in chain(
            map_trials(run, _until(last, alone), 1), map_trials(run, _until(last, others), workers)
        ):
            there[key] = json_value({'case': key, **result})
            file.write(json.dumps(there[key]) + '\n')
            file.flush()
            finished += 1
            done(finished)
    return [there[key] for key in keys if key in there]


def map_trials(
    run: Callable[[str], Any], keys: Iterable[str], workers: int
) -> Iterator[tuple[str, Any]]:
    """Run every trial, on several processes; the one place that knows how they are spread.

    Args:
        run: A module's function of a key.
        keys: Of the trials; taken one by one, when a process is free.
        workers: Processes; 1 stays in this one.

    Yields:
        Key and result of each, as they finish.
    """
    if workers <= 1:
        yield from ((key, run(key)) for key in keys)
        return
    # spawned, since a copy of a process with threads (linear algebra, ROS) may lock up
    context = multiprocessing.get_context('spawn')
    with _single_threaded(), ProcessPoolExecutor(workers, mp_context=context) as pool:
        waiting, running = iter(keys), dict[Future[Any], str]()
        try:
            while True:
                for key in islice(waiting, workers - len(running)):
                    running[pool.submit(run, key)] = key
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def read_records(campaign: Campaign, folder: Path) -> list[Record]:
    """Finished trials, none where the campaign has not begun; a line that was cut off is none.

    Raises:
        RecordingError: a line that is no trial.
    """
    path = folder / campaign.file
    if not campaign.file or not path.exists():
        return []
    complete = path.read_text(encoding='utf-8').split('\n')[:-1]
    records = [_record(campaign, line) for line in complete]
    if None in records:
        raise RecordingError(f'{path}:{records.index(None) + 1}', 'is no case of a campaign')
    return [record for record in records if record is not None]


def _record(campaign: Campaign, line: str) -> Record | None:
    """The trial that a line holds, None where it holds none."""
    try:
        record: Record = json.loads(line)
        campaign.key_of(record)
    except (ValueError, TypeError, KeyError):
        return None
    return record


def _until(last: float, keys: Iterable[str]) -> Iterator[str]:
    return takewhile(lambda _: time.monotonic() <= last, keys)


def _drop_cut_line(path: Path) -> None:
    """Cut off what an interruption left of a line, so that the next one begins a new line."""
    with path.open('rb+') as file:
        file.truncate(file.read().rfind(b'\n') + 1)


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Processes started meanwhile use one thread each: for small matrices threads compete."""
    before = {name: os.environ.get(name) for name in _THREAD_LIMITS}
    os.environ.update(dict.fromkeys(_THREAD_LIMITS, '1'))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
