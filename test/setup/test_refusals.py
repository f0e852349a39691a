"""The set-up on machines where it can not work: one line, no traceback, nothing half made."""

import os
import shutil

import pytest


def refused(machine, *args, **environ):
    """Run a set-up that must fail; return the only line that it says on stderr."""
    status, lines = machine.set_up(*args, **environ)
    assert status == 1
    assert len(lines) == 1
    assert lines[0].startswith('spacerobot set-up: ')
    return lines[0]


def test_no_python(machine):
    line = refused(machine)
    assert 'no fitting Python: none found; install CPython 3.10 to 3.13' in line


def test_old_python_is_named(machine):
    machine.put('python3', 'echo is 3.8.1; exit 1')
    machine.put('python3.12', 'echo "is 3.12.1 without its headers"; exit 1')
    assert 'python3 is 3.8.1; python3.12 is 3.12.1 without its headers; install' in refused(
        machine
    )


def test_chosen_python_that_does_not_exist(machine):
    machine.put_all()
    assert 'python3.99 does not run' in refused(machine, PYTHON='python3.99')


def test_python_that_does_not_fit_the_sourced_ros(machine, ros):
    machine.put_all()
    line = refused(machine, **{**ros, 'PYTHONPATH': ''})
    assert 'which the sourced ROS 2 does not fit (No module named' in line


def test_no_compiler_nor_cmake(machine):
    machine.put_all()
    for tool in ('cc', 'c++', 'cmake'):
        (machine.programs / tool).unlink()
    line = refused(machine)
    assert 'not found on PATH: C compiler (cc or gcc or clang), C++ compiler' in line
    assert 'cmake; needed to build the messages' in line
    assert not (machine.checkout / '.venv').exists()


def test_compilers_that_were_chosen_count(machine):
    machine.put_all()
    assert 'not found on PATH: C compiler (mycc), ' in refused(machine, CC='mycc -m64', CXX='no')
    machine.put('mycc')
    assert machine.made(CC='mycc -m64', CXX='mycc') == {'venv', 'packages', 'build'}


def test_no_network(machine):
    """With the real Python, pip and an index that nothing listens for."""
    machine.put_all()
    machine.put('python3', 'exec "$REAL_PYTHON" "$@"')
    line = refused(
        machine, PIP_CONFIG_FILE=os.devnull, PIP_INDEX_URL='http://127.0.0.1:9/simple',
        UV_OFFLINE='1', UV_NO_CACHE='1', PIP_NO_CACHE_DIR='1',
    )  # fmt: skip
    assert 'installing requirements/wheels.txt failed: no network, or no package index' in line
    log = machine.checkout / 'log' / 'setup' / 'packages.log'
    assert line.endswith(f'see {log}')
    assert log.exists()
    assert not (machine.checkout / '.venv' / 'spacerobot-stamp').exists()


def test_other_machines(machine, ros):
    machine.put_all()
    (machine.programs / 'uname').unlink()
    machine.put('uname', 'echo Linux aarch64')
    assert 'no ROS 2 wheels for Linux aarch64' in refused(machine)
    assert machine.made(**ros) == {'venv', 'packages', 'build'}


@pytest.mark.parametrize('name', ['my robot', 'a:b', "it's", '$HOME'])
def test_paths_that_colcon_can_not_build_in(machine, name):
    machine.put_all()
    moved = machine.checkout.with_name(name)
    machine.checkout.rename(moved)
    machine.checkout = moved
    assert f'can not build under "{moved}": move the checkout' in refused(machine)


def test_folder_that_can_not_be_written(machine):
    machine.put_all()
    (machine.programs / 'mkdir').unlink()
    machine.put(
        'mkdir', 'echo "mkdir: cannot create directory: Read-only file system" >&2; exit 1'
    )
    line = refused(machine)
    assert line.endswith(f'can not write in {machine.checkout}: Read-only file system')


def test_folder_that_can_not_be_written_serves_when_current(ready):
    (ready.programs / 'mkdir').unlink()
    ready.put('mkdir', 'exit 1')
    assert ready.made() == set()


@pytest.mark.parametrize(
    ('said', 'cause'),
    [
        ('OSError: [Errno 28] No space left on device', 'the disk is full'),
        ('ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM', 'does not match its locked hash'),
        ('error: hash mismatch for `pin`', 'does not match its locked hash'),
        ('anything else', 'the log names the first error'),
    ],
)
def test_cause_is_read_from_the_log(ready, said, cause):
    ready.put('says', f'echo "{said}" >&2')
    line = refused(ready, '--rebuild', SLOWLY='says', BUILD_FAILS='1')
    assert 'colcon build failed: ' in line
    assert f'{cause}; see {ready.checkout}/log/setup/build.log' in line


def test_whatever_ends_it_is_one_line(ready):
    shutil.rmtree(ready.checkout / 'build')
    (ready.programs / 'mv').unlink()
    ready.put('mv', 'echo "mv: No space left on device" >&2; exit 1')
    assert refused(ready).endswith('mv: No space left on device')
    assert ready.set_up()[0] == 1  # no stamp was written
