"""The `spacerobot` command: parses arguments, calls a sub-command, turns errors into exit codes.

Sub-commands are light modules with `add_parser(subparsers)` and `run(args) -> int`; they import
what is heavy inside `run`, so that `--help` answers at once.
"""

from __future__ import annotations

import argparse
import importlib
import os
import shlex
import sys
import tempfile
import traceback
from collections.abc import Sequence

from ..errors import SpaceRobotError

COMMANDS = ('demo', 'simulate', 'identify', 'diagnose', 'excite', 'reproduce')

_DESCRIPTION = """\
Estimation and control of a free-floating space robot that has captured a satellite whose
reaction wheels still spin.
"""

_EPILOG = """\
examples:
  spacerobot demo                                      the whole loop on ROS 2 nodes, with a report
  spacerobot simulate --robot config/servicer.yaml -o run
  spacerobot identify run --robot config/servicer.yaml
  spacerobot diagnose run --robot config/servicer.yaml --out out/diagnosis
  spacerobot reproduce wheel-momentum                  the paper's tables, beside the printed ones

exit status: 0 done, 1 done but the answer is no, 2 input that can't be used, 3 a fault of ours,
130 interrupted
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        argv: Arguments without the program's name; None takes the process's.

    Returns:
        Exit status: 0 done, 1 done but the answer is no (see each sub-command), 2 input that
        can't be used, 3 a fault of ours, 130 interrupted, 141 the reader of the output went away.
    """
    modules = {name: importlib.import_module(f'{__package__}.{name}') for name in COMMANDS}
    parser = argparse.ArgumentParser(
        prog='spacerobot',
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--version', action='version', version=_version())
    subparsers = parser.add_subparsers(dest='command', metavar='COMMAND', required=True)
    for module in modules.values():
        module.add_parser(subparsers)
    args = parser.parse_args(argv)
    try:
        status = int(modules[args.command].run(args))
        sys.stdout.flush()
    except SpaceRobotError as error:
        return _fails(args.command, 2, str(error))
    except KeyboardInterrupt:
        return _fails(args.command, 130, 'interrupted')
    except BrokenPipeError:
        # the interpreter would complain again when it flushes at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except Exception as error:  # noqa: BLE001  whatever nobody foresaw is a fault of ours
        return _fails(args.command, 3, _fault(error, argv))
    return status


def _fails(command: str, status: int, why: str) -> int:
    """One line on stderr."""
    print(f'spacerobot {command}: {" ".join(why.split())}', file=sys.stderr)
    return status


def _fault(error: Exception, argv: Sequence[str] | None) -> str:
    """What to send about a fault of ours; the traceback goes to a file."""
    words = shlex.join(sys.argv[1:] if argv is None else argv)
    trace = ''.join(traceback.format_exception(error))
    with tempfile.NamedTemporaryFile(
        'w', prefix='spacerobot-fault-', suffix='.txt', delete=False
    ) as file:
        file.write(f'{_version()}, Python {sys.version}\nspacerobot {words}\n\n{trace}')
    return (
        f'this is a fault of ours ({type(error).__name__}: {error}); please send {file.name} '
        'and the robot file'
    )


def _version() -> str:
    from spacerobot_ros import __version__

    return f'spacerobot {__version__}'


if __name__ == '__main__':
    sys.exit(main())
