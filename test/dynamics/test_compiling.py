"""Machine code is kept for other processes, and left alone when anything that it holds changed."""

from __future__ import annotations

import ast
import importlib
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

import spacerobot_ros
from spacerobot_ros.dynamics import compiling
from spacerobot_ros.dynamics.crba import crba

FILES = {
    '__init__': '',
    'dynamics/__init__': '',
    'dynamics/constants': 'OFFSET = 0.0\n',
    'dynamics/compiling': Path(compiling.__file__).read_text(encoding='utf-8'),
    'control/__init__': '',
    'control/helper': 'from ..dynamics.compiling import inner\n'
    '@inner\ndef twice(x):\n    return 2.0 * x\n',
    'control/kernel': 'from ..dynamics.compiling import compiled\n'
    'from ..dynamics.constants import OFFSET\nfrom .helper import twice\n'
    '@compiled\ndef called(x):\n    return twice(x) + OFFSET\n',
    'report': '',
}
CALL = (
    'from spacerobot_ros.control.kernel import called; '
    'print(called(1.0), sum(called.stats.cache_hits.values()), called.stats.cache_path)'
)


@pytest.fixture
def package(tmp_path):
    """Return a package of the same name with one kernel, whose inner function is elsewhere."""
    for name, text in FILES.items():
        path = tmp_path / 'spacerobot_ros' / f'{name}.py'
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding='utf-8')
    return tmp_path / 'spacerobot_ros'


def start(package, code=CALL, **variables):
    """A fresh process, which finds no cache but below the package's parent."""
    environ = {k: v for k, v in os.environ.items() if k != 'NUMBA_CACHE_DIR'}
    here = {'PYTHONPATH': package.parent, 'XDG_CACHE_HOME': package.parent / 'user'}
    environ |= {k: str(v) for k, v in {**here, **variables}.items()}
    command = [sys.executable, '-B', '-c', code]
    return subprocess.Popen(
        command, env=environ, cwd=package.parent, stdout=subprocess.PIPE, text=True
    )


def ended(process):
    """The answer of the kernel, whether it was loaded, and the folder where it is kept."""
    out, _ = process.communicate(timeout=300)
    assert process.returncode == 0
    answer, hits, folder = out.split()
    return float(answer), int(hits), Path(folder)


def run(package, code=CALL, **variables):
    return ended(start(package, code, **variables))


def edit(package, name, before, after):
    path = package / f'{name}.py'
    text = path.read_text(encoding='utf-8').replace(before, after)
    path.write_text(text, encoding='utf-8')
    os.utime(path, (1e9, 1e9))  # long before any process began


@pytest.fixture
def called(package):
    """Return the package, its kernel called once."""
    for name in FILES:
        edit(package, name, '', '')
    assert run(package)[:2] == (2.0, 0)
    return package


def test_a_second_process_compiles_nothing(called):
    answer, hits, folder = run(called)
    assert (answer, hits) == (2.0, 1)
    assert called / '__pycache__' / 'kernels' in folder.parents


@pytest.mark.parametrize(
    ('name', 'before', 'after', 'answer'),
    [
        ('control/helper', '2.0 * x', '3.0 * x', 3.0),
        ('dynamics/constants', '0.0', '1.0', 3.0),
        ('control/kernel', 'return twice(x)', 'return x', 1.0),
    ],
)
def test_a_change_anywhere_below_is_compiled_anew(called, name, before, after, answer):
    edit(called, name, before, after)
    assert run(called)[:2] == (answer, 0)
    edit(called, name, after, before)
    assert run(called)[:2] == (2.0, 1)  # each is kept


def test_a_change_elsewhere_compiles_nothing(called):
    (called / 'report.py').write_text('TITLE = "changed"\n', encoding='utf-8')
    assert run(called)[:2] == (2.0, 1)


def test_what_is_edited_while_a_process_runs_is_not_kept(called):
    helper = called / 'control' / 'helper.py'
    edited = FILES['control/helper'].replace('2.0 * x', '3.0 * x')
    while_it_runs = (
        'from spacerobot_ros.dynamics import compiling; from pathlib import Path\n'
        f'compiling._folder(); Path({str(helper)!r}).write_text({edited!r})\n'
    )
    answer, hits, folder = run(called, while_it_runs + CALL)
    assert (answer, hits, str(folder)) == (3.0, 0, 'None')
    edit(called, 'control/helper', '3.0 * x', '2.0 * x')
    assert run(called)[:2] == (2.0, 1)


def test_the_users_cache_serves_where_the_package_may_not_be_written(package):
    (package / '__pycache__').write_text('')  # of no use to root either
    assert run(package)[:2] == (2.0, 0)
    answer, hits, folder = run(package)
    assert (answer, hits) == (2.0, 1)
    assert package.parent / 'user' / 'spacerobot_ros' / 'kernels' in folder.parents


def test_a_folder_of_the_users_choice_comes_first(package, tmp_path):
    chosen = tmp_path / 'chosen'
    assert chosen in run(package, NUMBA_CACHE_DIR=chosen)[2].parents
    assert run(package, NUMBA_CACHE_DIR=chosen)[:2] == (2.0, 1)
    assert not (package / '__pycache__').exists()


def test_without_a_folder_it_runs_all_the_same(package, tmp_path):
    (package / '__pycache__').write_text('')
    (tmp_path / 'user').write_text('')
    assert run(package) == (2.0, 0, Path('None'))


def test_processes_that_compile_at_one_time_do_not_disturb_each_other(package):
    together = [start(package) for _ in range(4)]
    assert {ended(process)[0] for process in together} == {2.0}
    assert run(package)[:2] == (2.0, 1)


def test_code_of_sources_of_long_ago_is_removed(called):
    kernels = called / '__pycache__' / 'kernels'
    [now] = kernels.iterdir()
    (kernels / 'recent').mkdir()
    shutil.copytree(now, kernels / 'old')
    for name, days in (('recent', 3.0), ('old', 40.0)):
        os.utime(kernels / name, 2 * (time.time() - days * 86400.0,))
    assert run(called)[:2] == (2.0, 1)
    assert (kernels / 'old').exists()  # looked for where a new source is compiled
    edit(called, 'control/helper', '2.0 * x', '3.0 * x')
    assert run(called)[:2] == (3.0, 0)
    assert not (kernels / 'old').exists()
    assert (kernels / 'recent').exists()
    assert now.exists()


def test_kernels_of_the_user_stay_where_numba_keeps_them(called):
    own = 'import numba; import spacerobot_ros.control.kernel; print(1, 1, numba.config.CACHE_DIR)'
    assert run(called, own, NUMBA_CACHE_DIR='elsewhere')[2] == Path('elsewhere')


def test_kernels_take_constants_from_files_that_name_the_folder():
    assert crba.stats.cache_path.startswith(compiling._folder())
    root = Path(spacerobot_ros.__file__).parent
    hashed, seen = set(compiling._sources()), 0
    for path in root.rglob('*.py'):
        if path.name.encode() + path.read_bytes() not in hashed:
            continue
        parts = ('spacerobot_ros', *path.relative_to(root).with_suffix('').parts)
        module = importlib.import_module('.'.join(parts))
        package = module.__name__.rpartition('.')[0]
        imported = {
            alias.asname or alias.name: '.' * node.level + (node.module or '')
            for node in ast.parse(path.read_text(encoding='utf-8')).body
            if isinstance(node, ast.ImportFrom) and node.level
            for alias in node.names
        }
        for kernel in vars(module).values():
            if not isinstance(kernel, Dispatcher) or kernel.__module__ != module.__name__:
                continue
            for name in set(kernel.py_func.__code__.co_names) & imported.keys():
                value = getattr(module, name)
                if isinstance(value, bool | int | float | tuple | np.ndarray | np.dtype):
                    source = importlib.util.resolve_name(imported[name], package)
                    file = Path(sys.modules[source].__file__)
                    assert file.name.encode() + file.read_bytes() in hashed, (kernel, name)
                    seen += 1
    assert seen >= 10
