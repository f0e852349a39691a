"""The `spacerobot` program: runs a command, turns errors into one line and an exit status."""

from __future__ import annotations

import errno
import os
import shlex
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from .. import __version__
from ..errors import SpaceRobotError
from ..interrupts import interruptible


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        argv: Arguments without the program's name; None takes the process's.

    Returns:
        Exit status: 0 done, 1 done but the answer is no (see each sub-command), 2 input that
        can't be used, 3 a fault of ours, 130 interrupted, 141 the reader of the output went away.
    """

    def command(words: Sequence[str]) -> int:
        from .commands import run

        return run(words)

    return settled('spacerobot', command, sys.argv[1:] if argv is None else argv)


def settled(program: str, run: Callable[[Sequence[str]], int], words: Sequence[str]) -> int:
    """Exit status of a program, whatever becomes of it; an error is one line on stderr.

    Args:
        program: Its name.
        run: Does what words say, and returns its status.
        words: Its arguments.
    """
    asked = next((word for word in words if not word.startswith('-')), '')
    try:
        with interruptible():
            status = run(words)
        sys.stdout.flush()
        return status
    except KeyboardInterrupt:
        status, why = 130, 'interrupted'
    except BrokenPipeError:
        # the interpreter would complain again when it flushes at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except Exception as error:  # noqa: BLE001  whatever nobody foresaw is a fault of ours
        why = _unusable(error, words)
        status, why = (2, why) if why else (3, _fault(error, [program, *words]))
    print(f'{f"{program} {asked}".strip()}: {" ".join(why.split())}', file=sys.stderr)
    return status


def _unusable(error: Exception, words: Sequence[str]) -> str:
    """What of the input can't be used; empty where the fault is ours."""
    if isinstance(error, SpaceRobotError):
        return str(error)
    if isinstance(error, ImportError) and not str(error.name).startswith('spacerobot_ros'):
        from ..requirements import why_missing

        return why_missing(error)
    if isinstance(error, OSError) and (
        error.errno in (errno.ENOSPC, errno.EDQUOT) or _is_given(error.filename, words)
    ):
        return f'{error.filename or "results"}: {error.strerror}'
    return ''


def _is_given(path: Any, words: Sequence[str]) -> bool:
    """Whether a path stands on the command line, or is below one that does."""
    given = [Path(word).absolute() for word in words if word]
    return isinstance(path, str) and any(Path(path).absolute().is_relative_to(g) for g in given)


def _fault(error: Exception, words: Sequence[str]) -> str:
    """What to send about a fault of ours; the traceback goes to a file."""
    trace = ''.join(traceback.format_exception(error))
    about = f'spacerobot {__version__}, Python {sys.version}\n{shlex.join(words)}'
    try:
        number, sent = tempfile.mkstemp('.txt', 'spacerobot-fault-')
        with open(number, 'w', encoding='utf-8') as file:
            file.write(f'{about}\n\n{trace}')
    except OSError:  # nowhere to keep it
        sent = 'this line'
    return (
        f'this is a fault of ours ({type(error).__name__}: {error}); please send {sent} '
        'and the robot file'
    )


if __name__ == '__main__':
    sys.exit(main())
