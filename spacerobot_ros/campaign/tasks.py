"""Independent, seeded computations on all cores; results do not depend on their number."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

_THREAD_LIMITS = ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS')


@dataclass(frozen=True, slots=True)
class Task:
    """A call to make.

    Args:
        key: Under which its result is found.
        function: A module's function.
        arguments: What can be pickled.
    """

    key: Hashable
    function: Callable[..., Any]
    arguments: tuple[Any, ...]


def run_tasks(
    tasks: Sequence[Task], workers: int, done: Callable[[], None]
) -> dict[Hashable, Any]:
    """Make all calls.

    Args:
        tasks: The calls; the longest first keeps all workers busy to the end.
        workers: Processes; 1 stays in this one.
        done: Called after each.

    Returns:
        Results by key, in the order of the tasks.
    """
    if workers <= 1:
        results = {}
        for task in tasks:
            results[task.key] = task.function(*task.arguments)
            done()
        return results
    # spawned, since a copy of a process with threads (linear algebra, ROS) may lock up
    context = multiprocessing.get_context('spawn')
    with _single_threaded(), ProcessPoolExecutor(workers, mp_context=context) as pool:
        futures = {pool.submit(task.function, *task.arguments): task.key for task in tasks}
        try:
            for future in as_completed(futures):
                future.result()
                done()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        return {key: future.result() for future, key in futures.items()}


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
