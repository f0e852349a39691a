"""The set-up as a user starts it, on machines where it cannot work: one line, no traceback."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ('sh', 'dirname', 'uname', 'cat')
BUILD_TOOLS = ('cc', 'c++', 'cmake', 'make')


@pytest.fixture
def machine(tmp_path):
    """Return a checkout's set-up and a PATH folder with next to nothing on it."""
    checkout, programs = tmp_path / 'checkout', tmp_path / 'bin'
    for folder in ('scripts', 'requirements', 'msg_defs'):
        shutil.copytree(ROOT / folder, checkout / folder)
    programs.mkdir()
    for tool in TOOLS:
        (programs / tool).symlink_to(shutil.which(tool))
    return checkout, programs


def put(programs, name, script='exit 0'):
    path = programs / name
    path.write_text(f'#!/bin/sh\n{script}\n', encoding='utf-8')
    path.chmod(0o755)


def put_python(programs):
    base = getattr(sys, '_base_executable', sys.executable)
    put(programs, 'python3', f'exec {base} "$@"')


def run_set_up(machine, **environ):
    """Run the set-up and return its exit status and what it says on stderr, line by line."""
    checkout, programs = machine
    done = subprocess.run(
        [checkout / 'scripts' / 'set_up.sh'],
        env={'PATH': str(programs), 'HOME': str(checkout), **environ},
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    return done.returncode, done.stderr.splitlines()


def test_no_python(machine):
    status, lines = run_set_up(machine)
    assert status == 1
    assert len(lines) == 1
    assert 'no fitting Python: none found; install CPython 3.10 to 3.13' in lines[0]


def test_old_python_is_named(machine):
    put(machine[1], 'python3', 'echo is 3.8.1; exit 1')
    put(machine[1], 'python3.12', 'echo "is 3.12.1 without its headers"; exit 1')
    status, lines = run_set_up(machine)
    assert status == 1
    assert len(lines) == 1
    assert 'python3 is 3.8.1; python3.12 is 3.12.1 without its headers; install' in lines[0]


def test_chosen_python_that_does_not_exist(machine):
    put_python(machine[1])
    status, lines = run_set_up(machine, PYTHON='python3.99')
    assert status == 1
    assert len(lines) == 1
    assert 'python3.99 does not run' in lines[0]


def test_no_compiler_nor_cmake(machine):
    put_python(machine[1])
    put(machine[1], 'make')
    status, lines = run_set_up(machine)
    assert status == 1
    assert len(lines) == 1
    assert 'not found on PATH: C compiler (cc or gcc or clang), C++ compiler' in lines[0]
    assert 'cmake; needed to build the messages' in lines[0]
    assert not (machine[0] / '.venv').exists()


def test_no_network(machine):
    put_python(machine[1])
    for tool in BUILD_TOOLS:
        put(machine[1], tool)
    status, lines = run_set_up(
        machine,
        PIP_CONFIG_FILE=os.devnull,
        PIP_INDEX_URL='http://127.0.0.1:9/simple',  # nothing listens on the discard port
        UV_OFFLINE='1',
    )
    assert status == 1
    assert len(lines) == 1
    assert 'installing requirements/wheels.txt failed: no network' in lines[0]
    assert Path(lines[0].split('see ')[1]).exists()
    assert not (machine[0] / '.venv' / 'spacerobot-stamp.json').exists()
