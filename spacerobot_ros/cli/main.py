"""The `spacerobot` command: parses arguments, calls a sub-command, turns errors into exit codes.

Sub-commands are light modules with `add_parser(subparsers)` and `run(args) -> int`; they import
what is heavy inside `run`, so that `--help` answers at once.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
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

exit status: 0 done, 1 done but the answer is no, 2 input that can't be used, 130 interrupted
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        argv: Arguments without the program's name; None takes the process's.

    Returns:
        Exit status: 0 done, 1 done but the answer is no (see each sub-command), 2 input that
        can't be used, 130 interrupted, 141 the reader of the output went away.
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
        print(f'spacerobot {args.command}: {_one_line(error)}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f'spacerobot {args.command}: interrupted', file=sys.stderr)
        return 130
    except BrokenPipeError:
        # the interpreter would complain again when it flushes at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    return status


def _one_line(error: SpaceRobotError) -> str:
    return ' '.join(str(error).split())


def _version() -> str:
    from spacerobot_ros import __version__

    return f'spacerobot {__version__}'


if __name__ == '__main__':
    sys.exit(main())
