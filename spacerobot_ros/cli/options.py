"""What all commands share: their parsers, types of arguments, and checks of what they will write.

Types say what is wrong with a value; targets are checked before any work is done.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from ..errors import ConfigurationError

if TYPE_CHECKING:
    from ..batch.workers import Workers

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
    subparsers: Subparsers[argparse.ArgumentParser],
    name: str,
    text: str | None,
    choices: Mapping[str, Sequence[str]] | None = None,
    **words: str,
) -> argparse.ArgumentParser:
    """The parser of a command of `spacerobot`, its arguments those of `options.yaml`.

    Args:
        subparsers: Of `spacerobot`.
        name: Of the command.
        text: Docstring of its module.
        choices: Of arguments, where the code knows them.
        words: What is put into the texts, by its name in braces.
    """
    texts: dict[str, Any] = {key: _with(words, value) for key, value in help_texts(text).items()}
    # shells show the first line beside the name
    summary = texts['description'].partition('\n')[0].replace('%', '%%')
    parser = subparsers.add_parser(name, help=summary, formatter_class=Formatter, **texts)
    add_arguments(parser, name, choices or {}, words)
    return parser


def add_arguments(
    parser: argparse.ArgumentParser,
    group: str,
    choices: Mapping[str, Sequence[str]] = MappingProxyType({}),
    words: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Add the arguments that stand below a name in `options.yaml`."""
    for entry in _arguments()[group]:
        if isinstance(entry, str):
            add_arguments(parser, entry, choices, words)
            continue
        ((key, given),) = entry.items()
        spec = dict(given) if isinstance(given, Mapping) else {'help': given}
        names = [word for word in key.split() if word == word.lower()]
        of_value = key.split()[len(names) :]
        own = choices.get(names[0].lstrip('-'))
        spec |= {'metavar': of_value[0]} if of_value else {}
        spec |= {'choices': tuple(own)} if own else {}
        if names[0].startswith('-') and not of_value and 'choices' not in spec:
            spec['action'] = 'store_true'
        if kind := spec.get('type'):
            spec['type'] = positive_float if kind == 'positive' else whole_number(*kind)
        parser.add_argument(*names, **{**spec, 'help': _with(words, spec['help'])})


@cache
def _arguments() -> dict[str, list[Any]]:
    import yaml

    text = Path(__file__).with_name('options.yaml').read_text(encoding='utf-8')
    return dict(yaml.load(text, yaml.CSafeLoader))  # ours: without the checks of `model.files`


def _with(words: Mapping[str, str], text: str) -> str:
    for name, word in words.items():
        text = text.replace(f'{{{name}}}', word)
    return text


def workers_of(args: argparse.Namespace, *, isolated: bool) -> Workers:
    """Who works, from the options of `workers` in `options.yaml`.

    Args:
        args: Parsed.
        isolated: Whether a single process is one of its own, too.

    Raises:
        ConfigurationError: a scheduler is given, and there is no Dask.
    """
    from ..batch.workers import Workers, has_dask

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
    _check_writable(path, target.parent)
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
    _check_writable('--out', folder)
    if marker and (folder / marker).exists() and not force:
        raise ConfigurationError('--out', f'{folder} holds {what} already (--force replaces it)')
    return folder


def _check_writable(place: str, folder: Path) -> None:
    """Refuse, before any work, a folder that is none or can't be written to, there or not."""
    above = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if not above.is_dir():
        raise ConfigurationError(place, f'{above} is a file, not a folder')
    if not os.access(above, os.W_OK | os.X_OK):
        raise ConfigurationError(place, f'{above} can not be written to')
