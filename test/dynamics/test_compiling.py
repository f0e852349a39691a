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
def made(tmp_path, monkeypatch):
    """Return a folder with a kernel that was called."""
    first = tmp_path / 'first'
    first.mkdir()
    for name, text in FILES.items():
        (first / f'{name}.py').write_text(text)
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'cache'))
    assert run(first, monkeypatch) == (2.0, 0)
    yield first
    for name in FILES:
        del sys.modules[name]


def checkout(made, *without):
    """Another folder with the same files, but of their times."""
    second = made.parent / 'second'
    ignored = shutil.ignore_patterns('*.pyc', *without)
    shutil.copytree(made, second, copy_function=shutil.copyfile, ignore=ignored)
    return second


def test_an_unchanged_source_is_compiled_once(made, monkeypatch):
    assert run(checkout(made, '__pycache__'), monkeypatch) == (2.0, 1)


def test_an_installation_brings_what_it_compiled(made, monkeypatch):
    shutil.rmtree(made.parent / 'cache')
    assert run(checkout(made), monkeypatch) == (2.0, 1)


def test_what_can_not_be_kept_is_compiled_all_the_same(made, monkeypatch):
    second = checkout(made, '__pycache__')
    for no_folder in (second / '__pycache__', second / 'cache'):
        no_folder.write_text('')
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(second / 'cache'))
    assert run(second, monkeypatch) == (2.0, 0)


@pytest.mark.parametrize(
    ('file', 'before', 'after', 'answer'),
    [
        ('helper', '2.0 * x', '3.0 * x', 3.0),
        ('constants', '0.0', '1.0', 3.0),
        ('kernel', 'twice(x)', 'x', 1.0),
    ],
)
def test_a_change_anywhere_below_is_compiled_anew(made, monkeypatch, file, before, after, answer):
    second = checkout(made)
    (second / f'{file}.py').write_text(FILES[file].replace(before, after))
    assert run(second, monkeypatch) == (answer, 0)
    shutil.rmtree(made / '__pycache__')
    assert run(made, monkeypatch) == (2.0, 1)  # each is kept


def test_what_is_edited_before_the_first_call_is_not_what_was_compiled(made, monkeypatch):
    shutil.rmtree(made.parent / 'cache')
    second = checkout(made, '__pycache__')
    monkeypatch.syspath_prepend(second)
    for name in FILES:
        sys.modules.pop(name, None)
    called = importlib.import_module('kernel').called
    (second / 'helper.py').write_text(FILES['helper'].replace('2.0 * x', '3.0 * x'))
    assert called(1.0) == 2.0
    bytecode = shutil.ignore_patterns('*.pyc')  # which Python tells apart by size and second
    shutil.copytree(second, third := made.parent / 'third', ignore=bytecode)
    assert run(third, monkeypatch) == (3.0, 0)


@pytest.mark.parametrize('damage', [b'', b'junk' * 1000, None])
def test_what_is_damaged_is_compiled_anew(made, monkeypatch, damage):
    files = list(made.parent.rglob('*.nbc'))
    assert len(files) == 2  # beside the source, and the user's
    for file in files:
        whole = file.read_bytes()
        flipped = bytes([*whole[:-9], whole[-9] ^ 1, *whole[-8:]])
        file.write_bytes(flipped if damage is None else damage)
    assert run(made, monkeypatch) == (2.0, 0)
    assert run(made, monkeypatch) == (2.0, 1)


def test_without_a_home_nothing_is_kept_in_the_working_folder(made, monkeypatch):
    monkeypatch.delenv('NUMBA_CACHE_DIR')
    monkeypatch.delenv('XDG_CACHE_HOME', raising=False)
    monkeypatch.setattr('os.path.expanduser', lambda path: path)  # a user without an entry
    monkeypatch.chdir(made)
    shutil.rmtree('__pycache__')
    assert run(made, monkeypatch) == (2.0, 0)
    assert not (made / '~').exists()


def test_processes_that_compile_at_one_time_keep_each_its_own(tmp_path):
    files = type(crba._cache._cache_file)
    n, start = 8, Barrier(8)

    def keep(k):
        mine = files('stamp', (tmp_path, 'kernel'))
        start.wait()
        mine.save(k, f'code {k}')

    with ThreadPoolExecutor(n) as threads:
        list(threads.map(keep, range(n)))
    found = files('stamp', (tmp_path, 'kernel'))
    assert [found.load(k) for k in range(n)] == [f'code {k}' for k in range(n)]
    found.save(3, 'again')
    assert [found.load(k) for k in (2, 3)] == ['code 2', 'again']
    assert len(list(tmp_path.iterdir())) == n  # no parts are left
    assert files('other', (tmp_path, 'kernel')).load(3) is None
