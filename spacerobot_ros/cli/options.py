"""What all commands share: their parsers, types of arguments, and checks of what they will write.

Types say what is wrong with a value; targets are checked before any work is done.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ConfigurationError

if TYPE_CHECKING:
    from ..campaign.workers import Workers

Subparsers = argparse._SubParsersAction


class Formatter(argparse.RawDescriptionHelpFormatter, argparse.ArgumentDefaultsHelpFormatter):
    """Keeps the layout of descriptions and shows defaults."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        """Defaults of None or False say nothing."""
        if action.default is None or action.default is False:
            return action.help
        return super()._get_help_string(action)


def help_texts(text: str | None) -> dict[str, Any]:
    """What an argument parser says, from the docstring of a module.

    Args:
        text: A line for readers of the code, what the command does, and from `examples:` on
            examples and exit statuses.
    """
    about, examples, rest = (text or '').partition('\n\n')[2].partition('examples:\n')
    return {'description': about, 'epilog': examples + rest}


def add_command(
    subparsers: Subparsers[argparse.ArgumentParser], name: str, text: str | None
) -> argparse.ArgumentParser:
    """The parser of a command of `spacerobot`, whose module has the docstring `text`."""
    texts = help_texts(text)
    # shells show the first line beside the name
    summary = texts['description'].partition('\n')[0].replace('%', '%%')
    return subparsers.add_parser(name, help=summary, formatter_class=Formatter, **texts)


def add_recording_options(parser: argparse.ArgumentParser) -> None:
    """How recordings are read."""
    add = parser.add_argument
    add('--map', metavar='YAML', help='column mapping of CSV, JSON or npz data (docs/data.md)')
    add(
        '--split-gaps',
        action='store_true',
        help='take a recording as several, split at long pauses and where a table begins anew',
    )


def add_worker_options(parser: argparse.ArgumentParser) -> None:
    """Who does the work (docs/fleet.md)."""
    add = parser.add_argument
    add('--jobs', type=whole_number(1), metavar='N', help='processes (default: one a core)')
    add(
        '--scheduler',
        default='',
        metavar='ADDRESS',
        help='Dask cluster that does the work, such as tcp://10.0.0.1:8786, in place of processes',
    )
    add('--memory', type=positive_float, metavar='GB', help='of a process (default: its share)')
    add(
        '--timeout',
        type=positive_float,
        default=3600.0,
        metavar='S',
        help='time after which a task hangs, and is tried again elsewhere',
    )
    add('--dashboard', action='store_true', help="Dask's page of the work, on this machine only")


def workers_of(args: argparse.Namespace, *, isolated: bool) -> Workers:
    """Who works, from the options of `add_worker_options`.

    Args:
        args: Parsed.
        isolated: Whether a single process is one of its own, too.

    Raises:
        ConfigurationError: a scheduler is given, and there is no Dask.
    """
    from ..campaign.workers import Workers, has_dask

    number = args.jobs or len(os.sched_getaffinity(0))
    if not has_dask():
        if args.scheduler:
            raise ConfigurationError('--scheduler', 'needs dask and distributed: make setup')
        tell('dask is not installed: one process (make setup installs it)')
        number = 0
    return Workers(
        number=0 if number == 1 and not isolated else number,
        scheduler=args.scheduler,
        memory=None if args.memory is None else round(1e9 * args.memory),
        timeout=args.timeout,
        dashboard=args.dashboard,
        notice=tell,
    )


def tell(line: str) -> None:
    """A line beside the answer."""
    sys.stderr.write(f'spacerobot: {line}\n')


def positive_float(text: str) -> float:
    """A finite number above zero."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is not a number') from None
    if not math.isfinite(value) or value <= 0.0:
        raise argparse.ArgumentTypeError(f'{text} must be finite and above zero')
    return value


def whole_number(least: int, most: float = math.inf) -> Callable[[str], int]:
    """A whole number within limits."""
    words = {0: 'zero', 1: 'one'}.get(least, str(least))
    limits = f'{words} or above' if math.isinf(most) else f'from {least} to {most:g}'

    def parse(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f'{text!r} is not a whole number') from None
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f'{text} must be {limits}')
        return value

    return parse


seed = whole_number(0)


def check_file(path: str, force: bool, source: str = '') -> Path:
    """A file to write.

    Args:
        path: The file.
        force: Whether it may be replaced.
        source: A file that is read, and never replaced.

    Raises:
        ConfigurationError: it is there already, or can't be a file.
    """
    target = Path(path)
    if target.is_dir():
        raise ConfigurationError(path, 'is a folder')
    if source and target.exists() and target.resolve() == Path(source).resolve():
        raise ConfigurationError(path, 'is the robot file itself')
    if target.exists() and not force:
        raise ConfigurationError(path, 'is already there; --force replaces it')
    return target


def check_folder(path: str, holds: tuple[str, str] = ('', ''), force: bool = False) -> Path:
    """A folder to write to.

    Args:
        path: The folder.
        holds: File whose presence says that the folder is taken, and what it then holds.
        force: Whether that may be replaced.

    Raises:
        ConfigurationError: it can't be written to, or is taken.
    """
    folder, (marker, what) = Path(path), holds
    above = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if not above.is_dir():
        raise ConfigurationError('--out', f'{above} is a file, not a folder')
    if not os.access(above, os.W_OK | os.X_OK):
        raise ConfigurationError('--out', f'{above} can not be written to')
    if marker and (folder / marker).exists() and not force:
        raise ConfigurationError('--out', f'{folder} holds {what} already (--force replaces it)')
    return folder
