"""The checkout and the ROS 2 it is used with, and from stamps what of its set-up is current."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from dataclasses import dataclass, field
from pathlib import Path

from probe_python import has_rclpy, sourced_ros

PACKAGES = ('spacerobot_msgs', 'spacerobot_ros')


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
