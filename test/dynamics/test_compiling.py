"""What numba keeps of a function is left alone when anything that its code holds has changed."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

FILES = {
    'helper': 'from spacerobot_ros.dynamics.compiling import inner\n'
    '@inner\ndef twice(x):\n    return 2.0 * x\n',
    'constants': 'OFFSET = 0.0\n',
    'kernel': 'from constants import OFFSET\nfrom helper import twice\n'
    'from spacerobot_ros.dynamics.compiling import compiled\n'
    '@compiled\ndef called(x):\n    return twice(x) + OFFSET\n',
    'main': 'from kernel import called\n'
    'print(called(1.0), sum(called.stats.cache_hits.values()))\n',
}


@pytest.fixture
def run(tmp_path):
    """Return what a fresh process prints: the kernel's answer, and how often it was kept."""
    for name, text in FILES.items():
        (tmp_path / f'{name}.py').write_text(text)
    paths = os.pathsep.join([str(tmp_path), *sys.path])
    env = {**os.environ, 'PYTHONPATH': paths, 'PYTHONDONTWRITEBYTECODE': '1'}
    env.pop('NUMBA_CACHE_DIR', None)

    def start():
        done = subprocess.run(
            [sys.executable, str(tmp_path / 'main.py')],
            env=env, capture_output=True, text=True, check=True,
        )  # fmt: skip
        return done.stdout.split()

    assert start() == ['2.0', '0']
    return start


def test_an_unchanged_source_is_compiled_once(run, tmp_path):
    for path in tmp_path.glob('*.py'):
        os.utime(path)  # as a checkout does
    assert run() == ['2.0', '1']


@pytest.mark.parametrize(
    ('file', 'before', 'after', 'answer'),
    [
        ('helper', '2.0 * x', '3.0 * x', '3.0'),
        ('constants', '0.0', '1.0', '3.0'),
        ('kernel', 'twice(x)', 'x', '1.0'),
    ],
)
def test_a_change_anywhere_below_is_compiled_anew(run, tmp_path, file, before, after, answer):
    (tmp_path / f'{file}.py').write_text(FILES[file].replace(before, after))
    assert run() == [answer, '0']
