"""The `spacerobot` command: parses arguments, calls a sub-command, turns errors into exit codes.

Estimation and control of a free-floating space robot that has captured a satellite whose
reaction wheels still spin.

examples:
  spacerobot demo                                      the whole loop on ROS 2 nodes, with a report
  spacerobot simulate --robot config/servicer.yaml -o run
  spacerobot identify run --robot config/servicer.yaml
  spacerobot diagnose run --robot config/servicer.yaml --out out/diagnosis

exit status: 0 done, 1 done but the answer is no, 2 input that can't be used, 3 a fault of ours,
130 interrupted
"""

from __future__ import annotations

import argparse
import errno
import importlib
import os
import shlex
import sys
import tempfile
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import SpaceRobotError
from ..interrupts import interruptible
from .options import Formatter, add_command, help_texts

COMMANDS = {
    'demo': 'the whole loop on ROS 2 nodes, with a report',
    'simulate': 'simulate a robot in closed loop (no ROS needed) and record a bag',
    'identify': 'estimate wheel momentum and inertial parameters from a recording',
    'check': 'say what a recording is worth: rates, clocks, noise, faults, excitation',
    'show': 'play a recording in 3D on one page, with what the model makes of it',
    'diagnose': 'name what a simulation gets wrong about measured data, and extend its model',
    'compare': 'say what changed on an arm between two recordings, or that nothing did',
    'fleet': 'diagnose many recordings: one table, what drifts, what appeared when',
    'excite': 'design the motion that an identification learns most from',
    'montecarlo': 'simulate the closed loop over ranges of what is not known',
    'export': 'write a model for MuJoCo or as plain URDF, and say what is lost',
    'completion': 'what makes bash or zsh complete all of this',
}
"""Commands, and what they do in a line."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        argv: Arguments without the program's name; None takes the process's.

    Returns:
        Exit status: 0 done, 1 done but the answer is no (see each sub-command), 2 input that
        can't be used, 3 a fault of ours, 130 interrupted, 141 the reader of the output went away.
    """
    words = sys.argv[1:] if argv is None else list(argv)
    asked = next((word for word in words if not word.startswith('-')), '')
    try:
        with interruptible():
            status = _run(words, asked)
        sys.stdout.flush()
    except SpaceRobotError as error:
        return _fails(asked, 2, str(error))
    except KeyboardInterrupt:
        return _fails(asked, 130, 'interrupted')
    except BrokenPipeError:
        # the interpreter would complain again when it flushes at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except ImportError as error:
        if str(error.name).startswith(__package__.partition('.')[0]):
            return _fails(asked, 3, _fault(error, words))
        from ..requirements import why_missing

        return _fails(asked, 2, why_missing(error))
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT) or _is_given(error.filename, words):
            return _fails(asked, 2, f'{error.filename or "results"}: {error.strerror}')
        return _fails(asked, 3, _fault(error, words))
    except Exception as error:  # noqa: BLE001  whatever nobody foresaw is a fault of ours
        return _fails(asked, 3, _fault(error, words))
    return status


def _run(words: Sequence[str], asked: str) -> int:
    """Parse, with the parser of the one command that is asked for, and run it.

    A sub-command is a light module with `run(args) -> int` that imports what is heavy inside it;
    its docstring is its help, its arguments stand in `options.yaml`, and `known()`, where there is
    one, says what these take from the code. Only the one that is asked for is imported at all.
    """
    args = _parser(asked).parse_args(words)
    return int(importlib.import_module(f'{__package__}.{asked}').run(args))


def whole_parser() -> argparse.ArgumentParser:
    """The parser of all commands with their arguments."""
    return _parser(*COMMANDS)


def _parser(*asked: str) -> argparse.ArgumentParser:
    """The parser of some commands; of the others only their names."""
    parser = argparse.ArgumentParser(
        prog='spacerobot', formatter_class=Formatter, **help_texts(__doc__)
    )
    parser.add_argument('--version', action='version', version=_version())
    subparsers = parser.add_subparsers(dest='command', metavar='COMMAND', required=True)
    for name, summary in COMMANDS.items():
        if name in asked:
            command = importlib.import_module(f'{__package__}.{name}')
            known = command.known() if hasattr(command, 'known') else {}
            add_command(subparsers, name, command.__doc__, **known)
        else:
            subparsers.add_parser(name, help=summary)
    return parser


def _is_given(path: Any, words: Sequence[str]) -> bool:
    """Whether a path stands on the command line, or is below one that does."""
    given = [Path(word).absolute() for word in words if word]
    return isinstance(path, str) and any(Path(path).absolute().is_relative_to(g) for g in given)


def _fails(command: str, status: int, why: str) -> int:
    """One line on stderr."""
    print(f'spacerobot {command}: {" ".join(why.split())}', file=sys.stderr)
    return status


def _fault(error: Exception, words: Sequence[str]) -> str:
    """What to send about a fault of ours; the traceback goes to a file."""
    trace = ''.join(traceback.format_exception(error))
    text = f'{_version()}, Python {sys.version}\nspacerobot {shlex.join(words)}\n\n{trace}'
    try:
        with tempfile.NamedTemporaryFile(
            'w', prefix='spacerobot-fault-', suffix='.txt', delete=False
        ) as file:
            file.write(text)
        sent = file.name
    except OSError:  # nowhere to keep it
        sent = 'this line'
    return (
        f'this is a fault of ours ({type(error).__name__}: {error}); please send {sent} '
        'and the robot file'
    )


def _version() -> str:
    from spacerobot_ros import __version__

    return f'spacerobot {__version__}'


if __name__ == '__main__':
    sys.exit(main())
