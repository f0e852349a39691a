"""Tasks on a Dask cluster: processes of our own on this machine, or a cluster that exists.

A worker has one task at a time, given to it by name: whatever ends its process costs that task an
attempt and no other. Which workers there are is asked again and again, so they may come and go.
"""

from __future__ import annotations

import faulthandler
import hashlib
import logging
import os
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from itertools import count
from pathlib import Path
from typing import Any

import dask
from distributed import Client, Future, LocalCluster, wait

from .. import __version__
from ..errors import ConfigurationError
from ..formats import counted
from .workers import ATTEMPTS, Outcome, Workers, attempt, in_a_line

_HOST = '127.0.0.1'
_ANSWER = 15.0  # s in which a scheduler answers
_LOOK = 0.5  # s after which workers are asked for again
_GRACE = 10.0  # s beyond a task's time after which its worker is given up, should it not end
_NUMBERS = ('numpy', 'scipy', 'numba', 'pin')  # what results depend on beside the package
_CONFIG = {
    # one attempt: what is tried again is decided here
    'distributed.scheduler.allowed-failures': 0,
    # results are small; a process beyond its share is ended, not slowed
    'distributed.worker.memory.target': False,
    'distributed.worker.memory.spill': False,
    'distributed.worker.memory.pause': False,
    'distributed.worker.memory.terminate': 0.95,
}
_NO_PAGES: dict[str, Any] = {'distributed.scheduler.http.routes': []}
_THREADS = {name: '1' for name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS')}


def spread(run: Callable[[str], Any], keys: Iterable[str], workers: Workers) -> Iterator[Outcome]:
    """Run every task on a cluster; see `runner.outcomes`."""
    with _client(workers) as client:
        yield from _Spread(client, run, workers).outcomes(keys)


@contextmanager
def _client(workers: Workers) -> Iterator[Client]:
    """A client of the cluster that is asked for.

    Raises:
        ConfigurationError: no scheduler answers.
    """
    with ExitStack() as stack:
        if workers.scheduler:
            address: Any = workers.scheduler
        else:
            pages = {} if workers.dashboard else _NO_PAGES
            stack.enter_context(dask.config.set({**_CONFIG, **pages}))
            address = stack.enter_context(
                LocalCluster(
                    n_workers=workers.number,
                    threads_per_worker=1,
                    host=_HOST,
                    memory_limit='auto' if workers.memory is None else workers.memory,
                    dashboard_address=f'{_HOST}:0',
                    silence_logs=logging.CRITICAL,
                    env=_THREADS,
                )
            )
        try:
            client = stack.enter_context(Client(address, timeout=_ANSWER))
        except (OSError, ValueError, TypeError) as error:
            why = f'no Dask scheduler answers there within {_ANSWER:g} s ({in_a_line(error)})'
            raise ConfigurationError(f'--scheduler {workers.scheduler}', why) from error
        workers.notice(_in_words(client))
        if workers.dashboard:
            workers.notice(f'dashboard: {client.dashboard_link}')
        yield client


def _in_words(client: Client) -> str:
    """Who works, with how much memory."""
    there = client.scheduler_info(n_workers=-1)['workers'].values()
    sizes = sorted({w['memory_limit'] / 1e9 for w in there if w['memory_limit']})
    each = f', at most {" to ".join(f"{s:.1f}" for s in sizes[:: len(sizes) - 1 or 1])} GB each'
    return f'{len(there)} {"worker" if len(there) == 1 else "workers"}{each if sizes else ""}'


@dataclass(frozen=True, slots=True)
class _Running:
    """A task on a worker, since when [s]."""

    key: str
    worker: str
    since: float


class _Spread:
    """Tasks of one function on the workers of a cluster."""

    def __init__(self, client: Client, run: Callable[[str], Any], workers: Workers) -> None:
        self._client, self._run, self._workers = client, run, workers
        self._running: dict[Future, _Running] = {}
        self._again: deque[str] = deque()
        self._failed: dict[str, int] = {}
        self._fits: dict[str, bool] = {}
        self._silent: dict[str, int] = {}  # how often asked in vain
        self._number = count()

    def outcomes(self, keys: Iterable[str]) -> Iterator[Outcome]:
        """One outcome a key, as they finish."""
        waiting, alive = iter(keys), self._alive()
        while True:
            yield from self._finished(alive)
            alive = self._alive()  # after those whose task just ended with them
            is_over = self._give(waiting, alive)
            if is_over and not self._running:
                return
            if self._running:
                with suppress(TimeoutError):
                    wait(list(self._running), timeout=_LOOK, return_when='FIRST_COMPLETED')
            else:  # for a worker to come
                with suppress(TimeoutError):
                    self._client.wait_for_workers(len(alive) + 1, timeout=_LOOK)

    def _alive(self) -> list[str]:
        """Addresses of the workers that fit.

        Raises:
            ConfigurationError: there are workers, and none of them fits.
        """
        there = list(self._client.nthreads())
        if new := [address for address in there if address not in self._fits]:
            own = _own()
            identities = self._client.run(identity, workers=new, on_error='return')
            for address in new:
                if isinstance(identities.get(address), OSError):  # it may have ended meanwhile
                    self._silent[address] = self._silent.get(address, 0) + 1
                    if self._silent[address] < ATTEMPTS:
                        there.remove(address)
                        continue
                why = _difference(own, identities.get(address))
                self._fits[address] = not why
                if why:
                    self._workers.notice(f'worker {address} is not used: {why}')
        if there and not any(self._fits[address] for address in there):
            why = f'none of {counted(len(there), "worker")} fits: '
            why += _difference(own, identities[new[0]]) if new else 'they have other versions'
            raise ConfigurationError(f'--scheduler {self._workers.scheduler}', why)
        return [address for address in there if self._fits[address]]

    def _give(self, waiting: Iterator[str], alive: list[str]) -> bool:
        """Give every free worker a task; whether none is left to give."""
        busy = {task.worker for task in self._running.values()}
        for worker in alive:
            if worker in busy:
                continue
            key = self._again.popleft() if self._again else next(waiting, None)
            if key is None:
                return True
            future = self._client.submit(
                guarded,
                self._run,
                key,
                self._workers.timeout,
                key=f'spacerobot-{os.getpid()}-{next(self._number)}',
                workers=[worker],
                allow_other_workers=False,
            )
            self._running[future] = _Running(key, worker, time.monotonic())
        return False

    def _finished(self, alive: list[str]) -> Iterator[Outcome]:
        """Outcomes of the tasks that ended; what is worth another attempt is kept for it."""
        for future, task in list(self._running.items()):
            age = time.monotonic() - task.since
            is_late = age > self._workers.timeout + _GRACE
            if future.done() or is_late or task.worker not in alive:
                del self._running[future]
                found = self._outcome(future, task, age)
                if is_late and not future.done():
                    self._client.restart_workers([task.worker], raise_for_error=False)
                future.release()
                self._failed[task.key] = self._failed.get(task.key, 0) + bool(found.failure)
                if found.is_final or self._failed[task.key] >= ATTEMPTS:
                    yield found
                else:
                    self._again.append(task.key)

    def _outcome(self, future: Future, task: _Running, age: float) -> Outcome:
        if future.status == 'finished':
            with suppress(Exception):  # its worker ended before it could be asked
                return future.result(timeout=_ANSWER)
        if age >= self._workers.timeout:
            why = f'took more than {self._workers.timeout:g} s'
        else:
            why = 'its process ended: a crash, or more memory than a worker has'
        return Outcome(task.key, failure=why, is_final=False)


def guarded(run: Callable[[str], Any], key: str, timeout: float) -> Outcome:
    """Run a task on a worker, whose process ends where it takes too long.

    The watchdog needs no interpreter lock, so it ends compiled code, too.
    """
    with open(os.devnull, 'w', encoding='utf-8') as nowhere:
        faulthandler.dump_traceback_later(timeout, exit=True, file=nowhere)
        try:
            return attempt(run, key)
        finally:
            faulthandler.cancel_dump_traceback_later()


@cache
def identity() -> Mapping[str, str]:
    """Versions that the numbers depend on; of this package its sources, too."""
    root = Path(__file__).parents[1]
    total = hashlib.sha256()
    for path in sorted(root.rglob('*.py')):
        total.update(f'{path.relative_to(root)}\0'.encode() + path.read_bytes())
    own = {'spacerobot_ros': f'{__version__} ({total.hexdigest()[:8]})'}
    python = '.'.join(map(str, sys.version_info[:2]))
    return {**own, 'Python': python, **{name: _version(name) for name in _NUMBERS}}


def _own() -> Mapping[str, str]:
    return identity()


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:  # of a sourced ROS 2
        return 'of no known version'


def _difference(own: Mapping[str, str], other: Any) -> str:
    """What a worker has of another version; empty where nothing."""
    if not isinstance(other, Mapping):
        return f'it has not this version of spacerobot_ros ({in_a_line(other, is_ours=True)})'
    for name, mine in own.items():
        if other.get(name) != mine:
            return f'it has {name} {other.get(name, "of another version")}, here it is {mine}'
    return ''
