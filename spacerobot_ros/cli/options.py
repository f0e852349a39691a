"""What all commands share: their parsers, types of arguments, and checks of what they will write.

Types say what is wrong with a value; targets are checked before any work is done.
"""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Callable
from pathlib import Path

from ..errors import ConfigurationError

Subparsers = argparse._SubParsersAction


class Formatter(argparse.RawDescriptionHelpFormatter, argparse.ArgumentDefaultsHelpFormatter):
    """Keeps the layout of descriptions and shows defaults."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        """Defaults of None or False say nothing."""
        if action.default is None or action.default is False:
            return action.help
        return super()._get_help_string(action)


def add_command(
    subparsers: Subparsers[argparse.ArgumentParser], name: str, text: str, epilog: str
) -> argparse.ArgumentParser:
    """The parser of a command.

    Args:
        subparsers: Of `spacerobot`.
        name: Of the command.
        text: What it does.
        epilog: Examples and exit statuses.
    """
    return subparsers.add_parser(name, description=text, epilog=epilog, formatter_class=Formatter)


def add_recording_options(parser: argparse.ArgumentParser) -> None:
    """How recordings are read."""
    add = parser.add_argument
    add('--map', metavar='YAML', help='column mapping of CSV, JSON or npz data (docs/data.md)')
    add(
        '--split-gaps',
        action='store_true',
        help='take a recording as several, split at long pauses and where a table begins anew',
    )


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
