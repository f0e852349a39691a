"""The colcon workspace, and what Python and numba would compile at the first use."""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Iterator

from setup_tools import failure, log_path, remove, run, say, start, tool_environment
from setup_workspace import Workspace, read_stamp, wanted_build, write_stamp

EXECUTABLES = ('simulator', 'identifier', 'controller', 'monitor', 'composed', 'spacerobot')
WARM_UP = 'spacerobot_ros.campaign.warm_up'


def build(work: Workspace, lock: int) -> None:
    """Build the messages and link the package into `install`."""
    wanted, found = wanted_build(work), read_stamp(work.build_stamp)
    if any(found.get(key) != wanted[key] for key in ('venv', 'message_files')):
        remove(work.root / 'build')
        remove(work.root / 'install')
    remove(work.build_stamp)
    remove(log_path(work, 'build.log'))
    python = str(work.python)
    start_colcon = 'import sys; from colcon_core.command import main; sys.exit(main())'
    command = [
        python, '-c', start_colcon, '--log-base', 'log', 'build', '--symlink-install',
        '--base-paths', '.', 'msg_defs', '--cmake-args', '-DBUILD_TESTING=OFF',
        f'-DPython3_EXECUTABLE={python}', '-DPython3_FIND_VIRTUALENV=ONLY', '--no-warn-unused-cli',
    ]  # fmt: skip
    # colcon's own choice also heeds the load, which the kernels beside would make too high
    env = {**tool_environment(work), 'MAKEFLAGS': f'-j{os.cpu_count() or 1}'}
    if not run(work, 'build.log', command, env, lock):
        raise failure(work, 'build.log', 'colcon build', 'the log names the first error')
    programs = work.root / 'install' / 'spacerobot_ros' / 'lib' / 'spacerobot_ros'
    missing = [name for name in EXECUTABLES if not (programs / name).exists()]
    if missing:
        raise failure(work, 'build.log', 'colcon build', f'{", ".join(missing)} not installed')
    tool = work.venv / 'bin' / 'spacerobot'
    remove(tool)
    tool.symlink_to(programs / 'spacerobot')
    write_stamp(work.build_stamp, wanted_build(work))


@contextlib.contextmanager
def kernels_beside(work: Workspace, lock: int) -> Iterator[None]:
    """Let numba compile its kernels, which need no messages, while the block runs."""
    remove(log_path(work, 'kernels.log'))
    env = tool_environment(work)
    env['PYTHONPATH'] = os.pathsep.join(filter(None, [str(work.root), env.get('PYTHONPATH')]))
    command = [str(work.python), '-m', WARM_UP, 'kernels']
    compiling = start(work, 'kernels.log', command, env, lock, is_shown=True)
    try:
        yield
        is_done = compiling.wait() == 0
    finally:
        if compiling.poll() is None:
            os.killpg(compiling.pid, signal.SIGKILL)
            compiling.wait()
    if not is_done:
        _say_not_done(work)


def compile_modules(work: Workspace, lock: int) -> None:
    """Let Python compile the modules that every start needs; the workspace is built."""
    enter = f'source ./env.sh && exec python -m {WARM_UP} modules'
    env = tool_environment(work)
    if not run(work, 'kernels.log', ['bash', '-c', enter], env, lock):
        _say_not_done(work)


def _say_not_done(work: Workspace) -> None:
    say(f'not done, so the first commands take longer: {log_path(work, "kernels.log")}')
