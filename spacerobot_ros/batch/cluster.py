"""Tasks on a Dask cluster: processes of our own on this machine, or a cluster that exists.

Dask retries what raises and what its workers' deaths interrupt. As many tasks are given to it as
it has workers, so that a task that ends its process takes no other along.
"""

from __future__ import annotations

import faulthandler
import hashlib
import logging
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import cache, partial
from importlib.metadata import PackageNotFoundError, version
from itertools import islice
from pathlib import Path
from typing import Any

import dask
from distributed import CancelledError, Client, Future, KilledWorker, LocalCluster, wait
from distributed.protocol.pickle import dumps, loads

from .. import __version__
from ..errors import ConfigurationError
from ..formats import counted
from .workers import ATTEMPTS, Outcome, TaskError, Workers, attempt, in_a_line

_HOST = '127.0.0.1'
_ANSWER = 15.0  # s in which a scheduler answers
_LOOK = 0.5  # s after which workers are counted again
_NUMBERS = ('numpy', 'scipy', 'numba', 'pin')  # what results depend on beside the package
_CONFIG = {
    'distributed.scheduler.allowed-failures': ATTEMPTS - 1,
    'distributed.scheduler.worker-saturation': 1.0,  # nothing waits beside a task that may crash
    # A process that restarts on a busy machine is not given up after 15 s; where none restarts,
    # tasks do not wait for ever.
    'distributed.deploy.lost-worker-timeout': '1h',
    'distributed.scheduler.no-workers-timeout': '5 minutes',
    # results are small; a process beyond its share is ended, not slowed
    'distributed.worker.memory.target': False,
    'distributed.worker.memory.spill': False,
    'distributed.worker.memory.pause': False,
    'distributed.worker.memory.terminate': 0.95,
}
_NO_PAGES: dict[str, Any] = {'distributed.scheduler.http.routes': []}
_THREADS = {name: '1' for name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS')}
_DEAF = 'import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)'
"""Of a terminal's Ctrl-C the workers hear, too; it is this process that ends them."""
_ONE = threading.Lock()
"""One task at a time in a process, which has one watchdog."""


def spread(run: Callable[[str], Any], keys: Iterable[str], workers: Workers) -> Iterator[Outcome]:
    """Run every task on a cluster; see `runner.outcomes`."""
    waiting, own = iter(keys), identity()
    running: dict[Future, tuple[str, float, int]] = {}
    unfit: dict[str, str] = {}
    with _client(workers) as client:

        def begin(key: str) -> None:
            task = dumps(partial(guarded, run, key, workers.timeout, own))
            fit = list(client.nthreads().keys() - unfit) if unfit else None
            future = client.submit(
                _caller(), task, pure=False, retries=ATTEMPTS - 1,
                workers=fit, allow_other_workers=bool(unfit),
            )  # fmt: skip
            running[future] = key, time.monotonic(), len(unfit)

        while True:
            number = max(1, len(client.nthreads().keys() - unfit))
            for key in islice(waiting, max(0, number - len(running))):
                begin(key)
            if not running:
                return
            with suppress(TimeoutError):
                wait(list(running), timeout=_LOOK, return_when='FIRST_COMPLETED')
            for future in [one for one in running if one.done()]:
                key, since, known = running.pop(future)
                found = future.exception() or future.result()
                if isinstance(found, Outcome):
                    yield found
                elif isinstance(found, TaskError | KilledWorker):
                    yield Outcome(key, failure=_why(found, time.monotonic() - since, workers))
                else:  # its worker has other versions, or can not even load it
                    unfit |= _unfit(client, own, workers, unfit, found)
                    if len(unfit) > known:
                        begin(key)
                    else:
                        yield Outcome(key, failure=in_a_line(found, is_ours=True))


def _caller() -> Callable[[bytes], Any]:
    """Calls a task; a function in here is sent by value: who can not import one closes."""

    def called(task: bytes) -> Any:
        try:
            call = loads(task)
        except (ImportError, AttributeError) as error:
            return error
        return call()

    return called


def _why(error: Exception, age: float, workers: Workers) -> str:
    """Why a task gave nothing, as often as it was tried."""
    if not isinstance(error, KilledWorker):
        return str(error)
    if age >= workers.timeout * (error.allowed_failures + 1):
        return f'took more than {workers.timeout:g} s'
    return 'its process ended: a crash, or more memory than a worker has'


@contextmanager
def _client(workers: Workers) -> Iterator[Client]:
    """A client of the cluster that is asked for.

    Raises:
        ConfigurationError: no scheduler answers, or it ends.
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
                    preload=_DEAF,
                )
            )
        try:
            client = stack.enter_context(Client(address, timeout=_ANSWER))
        except (OSError, ValueError, TypeError) as error:
            why = f'no Dask scheduler answers there within {_ANSWER:g} s ({in_a_line(error)})'
            raise ConfigurationError(_place(workers), why) from error
        workers.notice(_in_words(client))
        if workers.dashboard:
            workers.notice(f'dashboard: {client.dashboard_link}')
        try:
            yield client
        except (OSError, CancelledError) as error:
            why = f'answers no more ({in_a_line(error)}); what was finished before stays'
            raise ConfigurationError(_place(workers), why) from error


def _place(workers: Workers) -> str:
    return f'--scheduler {workers.scheduler}' if workers.scheduler else f'--jobs {workers.number}'


def _in_words(client: Client) -> str:
    """Who works, with how much memory."""
    there = client.scheduler_info(n_workers=-1)['workers'].values()
    sizes = sorted({w['memory_limit'] / 1e9 for w in there if w['memory_limit']})
    each = f', at most {" to ".join(f"{s:.1f}" for s in sizes[:: len(sizes) - 1 or 1])} GB each'
    return f'{len(there)} {"worker" if len(there) == 1 else "workers"}{each if sizes else ""}'


def _unfit(
    client: Client, own: Mapping[str, str], workers: Workers, known: Mapping[str, str], error: Any
) -> dict[str, str]:
    """Workers of other versions by their addresses, and what differs.

    Raises:
        ConfigurationError: no other worker is left.
    """
    answers = client.run(identity, on_error='return')
    found = {at: why for at, other in answers.items() if (why := _difference(own, other))}
    for address in found.keys() - known:
        workers.notice(f'worker {address} is not used: {found[address]}')
    if len(found) == len(answers):
        why = next(iter(found.values()), in_a_line(error))
        why = f'none of {counted(len(answers), "worker")} fits: {why}'
        raise ConfigurationError(_place(workers), why)
    return found


def guarded(
    run: Callable[[str], Any], key: str, timeout: float, own: Mapping[str, str]
) -> Outcome | ConfigurationError:
    """Run a task on a worker, whose process ends where it takes too long.

    The watchdog needs no interpreter lock, so it ends compiled code, too.

    Returns:
        Its outcome, or what differs on this worker, which is not tried again here.

    Raises:
        TaskError: by the task, not on purpose.
    """
    if why := _difference(own, identity()):
        return ConfigurationError('worker', why)
    with _ONE, open(os.devnull, 'w', encoding='utf-8') as nowhere:
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
