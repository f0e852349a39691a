"""A checkout's set-up on a machine whose programs only say that they were called."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
COMMON = (
    'basename', 'bash', 'cat', 'chmod', 'cut', 'date', 'dirname', 'env', 'find', 'flock', 'grep',
    'head', 'ln', 'ls', 'mkdir', 'mv', 'nproc', 'realpath', 'rm', 'sed', 'sha256sum', 'sleep',
    'sort', 'tail', 'touch', 'uname', 'xargs',
)  # fmt: skip
PYTHON = r"""
echo "python $*" >> "$CALLS"
case $* in
*probe_python.py*) exec "$REAL_PYTHON" "$@" ;;
'-m venv '*)
    for venv; do :; done
    mkdir -p "$venv/bin"
    cp_to() { printf '#!/bin/bash\n%s\n' "$1" > "$2" && chmod +x "$2"; }
    cp_to 'echo "venv $*" >> "$CALLS"; exec bash "$BUILDER" "$@"' "$venv/bin/python"
    ;;
*' install '*uv.txt)
    printf '#!/bin/bash\necho "uv $*" >> "$CALLS"; exit ${UV_FAILS:-0}\n' > .venv/bin/uv
    chmod +x .venv/bin/uv
    ;;
*' install '*) exit ${PIP_FAILS:-0} ;;
'-V') echo Python 3.11.0 ;;
*import\ colcon_core*) exit ${NO_COLCON:-0} ;;
esac
"""
BUILDER = r"""
case $* in
*colcon_core.command*)
    ${SLOWLY:-:}
    lib=install/spacerobot_ros/lib/spacerobot_ros
    mkdir -p build/spacerobot_msgs build/spacerobot_ros $lib
    for program in programs/*; do
        printf '#!/bin/bash\n' > "$lib/${program##*/}" && chmod +x "$lib/${program##*/}"
    done
    ;;
esac
exit ${BUILD_FAILS:-0}
"""


class Machine:
    """A checkout in `checkout`, a folder `programs` that is PATH, and what was called there."""

    def __init__(self, folder: Path) -> None:
        self.checkout, self.programs = folder / 'checkout', folder / 'bin'
        self.calls_file, self._builder = folder / 'calls', folder / 'builder'
        for name in ('scripts', 'requirements', 'msg_defs', 'config', 'launch', 'programs'):
            shutil.copytree(ROOT / name, self.checkout / name)
        for name in ('setup.py', 'setup.cfg', 'package.xml', 'pyproject.toml'):
            shutil.copy(ROOT / name, self.checkout)
        self.programs.mkdir()
        for tool in COMMON:
            (self.programs / tool).symlink_to(shutil.which(tool))
        self._builder.write_text(BUILDER, encoding='utf-8')

    def put(self, name, script='exit 0'):
        """Put a program on PATH."""
        path = self.programs / name
        path.write_text(f'#!/bin/bash\n{script}\n', encoding='utf-8')
        path.chmod(0o755)

    def put_all(self):
        """Put on PATH what a set-up needs; what is installed and built is empty."""
        self.put('python3', PYTHON)
        for tool in ('cc', 'c++', 'cmake', 'make'):
            self.put(tool)

    def environment(self, **environ):
        """Return the environment of a set-up."""
        return {
            'PATH': str(self.programs), 'HOME': str(self.checkout), 'CALLS': str(self.calls_file),
            'BUILDER': str(self._builder),
            'REAL_PYTHON': getattr(sys, '_base_executable', sys.executable), **environ,
        }  # fmt: skip

    def start(self, *args, **environ):
        """Start the set-up."""
        return subprocess.Popen(
            [self.checkout / 'scripts' / 'set_up.sh', *args], env=self.environment(**environ),
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def set_up(self, *args, **environ):
        """Run the set-up; return its exit status and the lines on stderr."""
        process = self.start(*args, **environ)
        _, errors = process.communicate(timeout=120)
        return process.returncode, errors.splitlines()

    def made(self, *args, **environ):
        """Run a set-up that must succeed; return what it made: venv, packages, build."""
        self.calls_file.unlink(missing_ok=True)
        assert self.set_up(*args, **environ) == (0, [])
        calls = self.calls_file.read_text() if self.calls_file.exists() else ''
        signs = {'venv': 'python -m venv', 'packages': ' pip sync', 'build': 'colcon_core.command'}
        return {name for name, sign in signs.items() if sign in calls}

    def made_so_far(self, sign):
        """Return how often something was called; of a set-up that still works."""
        text = self.calls_file.read_text() if self.calls_file.exists() else ''
        return text.count(sign)

    def calls(self):
        """Return what was called."""
        return self.calls_file.read_text(encoding='utf-8').splitlines()


@pytest.fixture
def machine(tmp_path):
    """Return a machine with next to nothing on PATH."""
    return Machine(tmp_path)


@pytest.fixture
def ready(machine):
    """Return a machine on which a set-up is done."""
    machine.put_all()
    assert machine.made() == {'venv', 'packages', 'build'}
    machine.calls_file.unlink()
    return machine


def make_ros(prefix):
    """Return the prefix of something that looks like a ROS 2 installation."""
    (prefix / 'share' / 'rclpy').mkdir(parents=True)
    (prefix / 'share' / 'rclpy' / 'package.xml').touch()
    return str(prefix)


@pytest.fixture
def ros(tmp_path, machine):
    """Return variables of a sourced ROS 2, whose rclpy any Python finds."""
    for module in ('rclpy', 'numpy'):
        (tmp_path / 'ros' / 'python').mkdir(parents=True, exist_ok=True)
        (tmp_path / 'ros' / 'python' / f'{module}.py').touch()
    prefix = make_ros(tmp_path / 'ros')
    return {
        'ROS_DISTRO': 'jazzy',
        'AMENT_PREFIX_PATH': prefix,
        'PYTHONPATH': os.path.join(prefix, 'python'),
    }
