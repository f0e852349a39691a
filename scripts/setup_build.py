"""The colcon workspace."""

from __future__ import annotations

import os

from setup_tools import failure, log_path, remove, run, tool_environment
from setup_workspace import Workspace, read_stamp, wanted_build, write_stamp

EXECUTABLES = ('simulator', 'identifier', 'controller', 'monitor', 'composed', 'spacerobot')


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
    # colcon's own choice also heeds the load
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
