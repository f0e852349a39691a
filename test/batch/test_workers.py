"""Who runs tasks: same results whoever does, and what fails costs itself alone."""

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
    assert [begun.count(key) for key in bad] == [3, 3]
    assert [begun.count(key) for key in KEYS] == [1] * len(KEYS)


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


def test_workers_of_another_version_are_refused(monkeypatch):
    from spacerobot_ros.batch import cluster

    own = {**cluster.identity(), 'numpy': '0.1'}
    with distributed.LocalCluster(
        n_workers=1, host='127.0.0.1', dashboard_address='127.0.0.1:0'
    ) as there:
        plain = Workers(scheduler=there.scheduler_address)
        monkeypatch.setattr(cluster, '_own', lambda: own)
        with pytest.raises(ConfigurationError, match=r'none of 1 .*numpy .*here it is 0\.1'):
            list(outcomes(tasks.draw, KEYS, plain))


def test_a_worker_that_ends_before_it_is_asked_ends_nothing():
    from spacerobot_ros.batch import cluster

    class Client:
        answers = iter((OSError('gone'), cluster.identity(), *[OSError('gone')] * 3))

        def nthreads(self):
            return {'a': 1}

        def run(self, *_, workers, **__):
            return {workers[0]: next(self.answers)}

    client = Client()
    spread = cluster._Spread(client, tasks.draw, Workers(scheduler='there'))
    assert [spread._alive(), spread._alive()] == [[], ['a']]
    unheard = cluster._Spread(client, tasks.draw, Workers(scheduler='there'))
    assert [unheard._alive(), unheard._alive()] == [[], []]
    with pytest.raises(ConfigurationError, match=r'none of 1 worker fits: .*gone'):
        unheard._alive()


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
    import argparse

    from spacerobot_ros.cli import options

    monkeypatch.setattr(workers_module, 'has_dask', lambda: False)
    parser = argparse.ArgumentParser()
    options.add_arguments(parser, 'workers')
    found = options.workers_of(parser.parse_args(['--jobs', '4']), isolated=True)
    assert found.number == 0
    assert capsys.readouterr().err.count('\n') == 1
    with pytest.raises(ConfigurationError, match='needs dask'):
        options.workers_of(parser.parse_args(['--scheduler', 'tcp://a:1']), isolated=True)
