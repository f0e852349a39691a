"""What numba keeps of a function is left alone when anything that its code holds has changed."""

from __future__ import annotations

import importlib
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import pytest

from spacerobot_ros.dynamics.crba import crba

FILES = {
    'helper': 'from spacerobot_ros.dynamics.compiling import inner\n'
    '@inner\ndef twice(x):\n    return 2.0 * x\n',
    'constants': 'OFFSET = 0.0\n',
    'kernel': 'from constants import OFFSET\nfrom helper import twice\n'
    'from spacerobot_ros.dynamics.compiling import compiled\n'
    '@compiled\ndef called(x):\n    return twice(x) + OFFSET\n',
}


def run(folder, monkeypatch):
    """The answer of a folder's kernel, loaded as a fresh process would, and if it was kept."""
    monkeypatch.syspath_prepend(folder)
    for name in FILES:
        sys.modules.pop(name, None)
    called = importlib.import_module('kernel').called
    return called(1.0), sum(called.stats.cache_hits.values())


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """Return a folder with a kernel that was called, as another checkout would have it."""
    first, second = tmp_path / 'first', tmp_path / 'second'
    first.mkdir()
    for name, text in FILES.items():
        (first / f'{name}.py').write_text(text)
    assert run(first, monkeypatch) == (2.0, 0)
    no_times = {'copy_function': shutil.copyfile, 'ignore': shutil.ignore_patterns('*.pyc')}
    shutil.copytree(first, second, **no_times)
    yield second
    for name in FILES:
        del sys.modules[name]


def test_an_unchanged_source_is_compiled_once(kept, monkeypatch):
    assert run(kept, monkeypatch) == (2.0, 1)


@pytest.mark.parametrize(
    ('file', 'before', 'after', 'answer'),
    [
        ('helper', '2.0 * x', '3.0 * x', 3.0),
        ('constants', '0.0', '1.0', 3.0),
        ('kernel', 'twice(x)', 'x', 1.0),
    ],
)
def test_a_change_anywhere_below_is_compiled_anew(kept, monkeypatch, file, before, after, answer):
    (kept / f'{file}.py').write_text(FILES[file].replace(before, after))
    assert run(kept, monkeypatch) == (answer, 0)


def test_processes_that_compile_at_one_time_keep_each_its_own(tmp_path):
    cache_file = type(crba._cache._cache_file)
    n, start = 8, Barrier(8)

    def keep(k):
        mine = cache_file(str(tmp_path), 'kernel', 'stamp')
        start.wait()
        mine.save(k, f'code {k}')

    with ThreadPoolExecutor(n) as threads:
        list(threads.map(keep, range(n)))
    found = cache_file(str(tmp_path), 'kernel', 'stamp')
    assert [found.load(k) for k in range(n)] == [f'code {k}' for k in range(n)]
    found.save(3, 'again')
    assert [found.load(k) for k in (2, 3)] == ['code 2', 'again']
    assert cache_file(str(tmp_path), 'kernel', 'other').load(3) is None
