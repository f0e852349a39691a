"""Who runs tasks: same results whoever does, and what fails costs itself alone."""

import logging
import re
import subprocess
import sys
from functools import partial

import pytest
from support import tasks

from spacerobot_ros.batch import workers as workers_module
from spacerobot_ros.batch.runner import Kept, Tasks, complete, outcomes
from spacerobot_ros.batch.workers import Workers
from spacerobot_ros.errors import ConfigurationError

distributed = pytest.importorskip('distributed', reason='the extra `fleet` is not installed')
KEYS = [str(k) for k in range(12)]


def results(run, keys, workers):
    found = {outcome.key: outcome for outcome in outcomes(run, keys, workers)}
    assert len(found) == len(keys)
    return found


@pytest.fixture(scope='module')
def alone():
    return {key: tasks.draw(key) for key in KEYS}


def test_same_numbers_though_processes_are_killed(tmp_path, alone):
    lines = []
    run = partial(tasks.killing, folder=str(tmp_path), victims=('2', '7'))
    found = results(run, KEYS, Workers(number=2, notice=lines.append))
    assert {key: outcome.result for key, outcome in found.items()} == alone
    assert {path.name for path in tmp_path.iterdir()} == {'killed-2', 'killed-7'}
    assert lines[0].startswith('2 workers, at most ')


def test_what_fails_is_told_and_the_rest_goes_on(tmp_path, alone):
    bad = ['dies 1', 'raises 3']
    run = partial(tasks.misbehave, folder=str(tmp_path))
    found = results(run, [*bad, *KEYS], Workers(number=2, memory=10**9))
    assert {key: found[key].result for key in KEYS} == alone
    why = {key: found[key].failure for key in bad}
    assert why['dies 1'].startswith('its process ended')
    assert why['raises 3'] == 'ValueError: no such number'
    begun = (tmp_path / 'begun').read_text(encoding='utf-8').splitlines()
    assert begun.count('dies 1') == 3
    # what a worker had not yet sent when the task after it ended the process is made again
    again = [begun.count('raises 3') - 3, *(begun.count(key) - 1 for key in KEYS)]
    assert min(again) >= 0
    assert sum(again) <= 3


def test_what_hangs_is_ended(tmp_path):
    run = partial(tasks.misbehave, folder=str(tmp_path))
    found = results(run, ['hangs 2'], Workers(number=1, timeout=0.1))
    assert found['hangs 2'].failure == 'took more than 0.1 s'
    assert (tmp_path / 'begun').read_text(encoding='utf-8') == 3 * 'hangs 2\n'


def test_an_existing_cluster_whose_workers_come_and_go(tmp_path, alone):
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, host='127.0.0.1', dashboard_address='127.0.0.1:0'
    ) as cluster:
        seen = []
        for outcome in outcomes(tasks.draw, KEYS, Workers(scheduler=cluster.scheduler_address)):
            seen.append(outcome)
            if len(seen) == 3:
                cluster.scale(2)
    assert {outcome.key: outcome.result for outcome in seen} == alone


def other_version(folder, name):
    """A path on which a package has another version."""
    info = folder / f'{name}-0.1.dist-info'
    info.mkdir()
    (info / 'METADATA').write_text(f'Metadata-Version: 2.1\nName: {name}\nVersion: 0.1\n')
    return str(folder)


def strangers(folder):
    """A path on which this package is another one."""
    (folder / 'spacerobot_ros').mkdir()
    (folder / 'spacerobot_ros' / '__init__.py').touch()
    return str(folder)


def there(*paths):
    """A cluster of one worker a folder, from which it imports first."""
    own = {'nthreads': 1, 'host': '127.0.0.1', 'silence_logs': logging.CRITICAL}
    return distributed.SpecCluster(
        {
            k: {
                'cls': distributed.Nanny,
                'options': {**own, 'preload': f'import sys; sys.path.insert(0, {path!r})'},
            }
            for k, path in enumerate(paths)
        },
        {
            'cls': distributed.Scheduler,
            'options': {
                'host': '127.0.0.1',
                'dashboard': False,
                'dashboard_address': '127.0.0.1:0',
            },
        },
    )


@pytest.mark.parametrize(
    ('path', 'why'),
    [
        (partial(other_version, name='numba'), r'it has numba 0\.1, here it is '),
        (strangers, r'it has not this version of spacerobot_ros .*ModuleNotFoundError'),
    ],
)
def test_workers_of_another_version_are_named_and_not_used(tmp_path, alone, path, why):
    lines, other = [], path(tmp_path)
    with there('', other) as cluster:
        plain = Workers(scheduler=cluster.scheduler_address, notice=lines.append)
        found = results(tasks.draw, KEYS, plain)
    assert {key: outcome.result for key, outcome in found.items()} == alone
    assert len(lines) == 2
    assert re.match(f'worker tcp://.* is not used: {why}', lines[1])
    with (
        there(other) as cluster,
        pytest.raises(ConfigurationError, match=f'none of 1 worker fits: {why}'),
    ):
        results(tasks.draw, KEYS, Workers(scheduler=cluster.scheduler_address))


def test_workers_that_do_not_start_again_stall_nothing(tmp_path, monkeypatch):
    from spacerobot_ros.batch import cluster

    config = {
        **cluster._CONFIG,
        'distributed.deploy.lost-worker-timeout': '1ms',  # which ends what is about to restart
        'distributed.scheduler.no-workers-timeout': '2s',
    }
    monkeypatch.setattr(cluster, '_CONFIG', config)
    run = partial(tasks.misbehave, folder=str(tmp_path))
    with pytest.raises(ConfigurationError, match=r'--jobs 1: none of 0 workers fits: .*timed out'):
        results(run, ['dies 1', *KEYS], Workers(number=1))


def test_a_cluster_that_ends_meanwhile(monkeypatch):
    from spacerobot_ros.batch import cluster as own

    monkeypatch.setattr(own, '_ANSWER', 1.0)
    with there('') as cluster:
        found = outcomes(tasks.draw, KEYS, Workers(scheduler=cluster.scheduler_address))
        assert not next(found).failure
        cluster.close()
        with pytest.raises(ConfigurationError, match='what was finished before stays'):
            list(found)


def test_a_scheduler_that_does_not_answer(monkeypatch):
    from spacerobot_ros.batch import cluster

    monkeypatch.setattr(cluster, '_ANSWER', 0.3)
    with pytest.raises(ConfigurationError, match='no Dask scheduler answers'):
        list(outcomes(tasks.draw, KEYS, Workers(scheduler='tcp://127.0.0.1:1')))


def test_nobody_is_asked_for_nothing():
    assert list(outcomes(tasks.draw, [], Workers(scheduler='tcp://127.0.0.1:1'))) == []


def test_a_client_that_is_killed_loses_what_is_in_flight_alone(tmp_path, alone):
    program = (
        'import os, signal\n'
        'from pathlib import Path\n'
        'from support import tasks\n'
        'from spacerobot_ros.batch.runner import *\n'
        f'path = Path({str(tmp_path)!r}) / "kept.jsonl"\n'
        'def done(n):\n'
        '    if n == 5:\n'
        '        os.kill(os.getpid(), signal.SIGKILL)\n'
        f'complete(Tasks(run=tasks.draw, kept=Kept(path)), {KEYS!r}, done=done)\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', program], env={'PYTHONPATH': ':'.join(sys.path)}, check=False
    )
    assert done.returncode == -9
    kept = Kept(tmp_path / 'kept.jsonl')
    assert len(kept.read()) == 5
    again = complete(Tasks(run=tasks.draw, kept=kept), KEYS)
    assert again.records == [{'case': key, **alone[key]} for key in KEYS]


def test_without_dask_there_is_one_process(monkeypatch, capsys):
    from spacerobot_ros.cli import options

    monkeypatch.setattr(workers_module, 'has_dask', lambda: False)
    given = {'isolated': True, 'jobs': 4, 'memory': None, 'timeout': 1.0, 'dashboard': False}
    found = options.workers_of(**given, scheduler=None)
    assert found.number == 0
    assert capsys.readouterr().err.count('\n') == 1
    with pytest.raises(ConfigurationError, match='needs dask'):
        options.workers_of(**given, scheduler='tcp://a:1')
