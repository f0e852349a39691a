"""Parallel tasks: same results whatever the number of processes; errors come through."""

import math
import os

import pytest

from spacerobot_ros.campaign.tasks import Task, run_tasks

TASKS = [Task(k, math.sqrt, (float(k),)) for k in range(6)]


@pytest.mark.parametrize('workers', [1, 2])
def test_results_by_key_in_order(workers):
    before = dict(os.environ)
    calls = []
    results = run_tasks(TASKS, workers, lambda: calls.append(1))
    assert list(results) == list(range(6))
    assert results == {k: math.sqrt(k) for k in range(6)}
    assert len(calls) == 6
    assert dict(os.environ) == before


@pytest.mark.parametrize('workers', [1, 2])
def test_an_error_comes_through(workers):
    with pytest.raises(ValueError, match=r'math domain error|nonnegative'):
        run_tasks([*TASKS, Task('bad', math.sqrt, (-1.0,))], workers, lambda: None)
