"""What all commands share: their declaration, options, and checks of what they will write.

Types say what is wrong with a value; targets are checked before any work is done.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import ConfigurationError, SpaceRobotError

if TYPE_CHECKING:
    from ..batch.workers import Workers

    Decorator = Callable[[Callable[..., int]], Callable[..., int]]


class _Command(click.Command):
    """A command whose options of many values take all words up to the next option."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Words with `--after A B` as `--after A --after B`."""
        many = {name for param in self.params if param.multiple for name in param.opts}
        option, words = '', list[str]()
        for word in args:
            if word.startswith('-'):
                option = word if word in many else ''
            elif option and words[-1] != option:
                words.append(option)
            words.append(word)
        try:
            return super().parse_args(ctx, words)
        except click.UsageError as error:
            error.ctx = ctx  # of a missing value it does not say whose
            raise


def _positive(ctx: click.Context, param: click.Parameter, value: float | None) -> float | None:
    """The value of an option, where it is finite and above zero."""
    if value is not None and not 0.0 < value < math.inf:
        raise click.BadParameter(f'{value:g} must be finite and above zero')
    return value


def command(
    text: str | None, make: Callable[..., Any] = click.command, **given: Any
) -> Callable[[Callable[..., int]], click.Command]:
    """Make a function a command, its help the docstring of its module, the layout kept.

    Args:
        text: A line of which commands are listed with what follows the colon, what the command
            does, and from `examples:` on examples and exit statuses.
        make: Decorator of click.
        given: What else that takes.
    """
    summary, _, rest = (text or '').partition('\n\n')
    about, head, epilog = rest.partition('examples:\n')
    help_text, epilog = (
        '\n\n'.join(f'\b\n{paragraph}' for paragraph in part.strip().split('\n\n'))
        for part in (about, head + epilog)
    )
    listed = summary.partition(': ')[2]
    return make(short_help=listed, help=help_text, epilog=epilog, **{'cls': _Command, **given})


def invoked(program: click.Command, name: str, words: Sequence[str]) -> int:
    """Run a command or a group, unlike its `main` without a line of its own at errors or Ctrl-C.

    Returns:
        Exit status of the command.

    Raises:
        SpaceRobotError: words that it does not take.
    """
    try:
        with program.make_context(name, list(words)) as context:
            return int(program.invoke(context))
    except click.exceptions.Exit as done:
        return done.exit_code
    except click.UsageError as error:
        asked = error.ctx.command_path if error.ctx else name
        raise SpaceRobotError(f'{error.format_message()} ({asked} --help says more)') from error


option = click.option
switch = partial(click.option, is_flag=True)
positive = partial(click.option, type=float, callback=_positive)
path = partial(click.option, type=click.Path())
path_argument = partial(click.argument, type=click.Path())

robot = path('--robot', metavar='YAML', required=True, help='robot file')
_OF_TABLES = 'column mapping of CSV, JSON or npz data (docs/data.md)'
mapping = path('--map', 'mapping', metavar='YAML', help=_OF_TABLES)
as_json = switch('--json', 'as_json', help='print JSON, and nothing else')
out = path('-o', '--out', metavar='DIR', required=True, help='folder to write')


def count(name: str, help: str, least: int = 0) -> Decorator:
    """An option that is a whole number."""
    kind = click.IntRange(least)
    kind.name = 'whole number'
    return click.option(name, type=kind, metavar='N', help=help)


def choice(name: str, known: Sequence[str], **given: Any) -> Decorator:
    """An option that is one of some words."""
    return click.option(name, type=click.Choice(known), **given)


def recording(function: Callable[..., int]) -> Callable[..., int]:
    """Options of how recordings are read."""
    text = 'take a recording as several, split at long pauses and where a table begins anew'
    return mapping(switch('--split-gaps', help=text)(function))


force_data = switch('--force-data', help='take data with the faults that `check` lists')


def workers(function: Callable[..., int]) -> Callable[..., int]:
    """Options of who works, as `workers_of` takes them."""
    cluster = 'Dask cluster that does the work, such as tcp://10.0.0.1:8786, in place of processes'
    hangs = 'time after which a task hangs, and is tried again elsewhere'
    for add in (
        switch('--dashboard', help="Dask's page of the work, on this machine only"),
        positive('--timeout', metavar='S', default=3600.0, help=hangs),
        positive('--memory', metavar='GB', help='of a process (default: its share)'),
        option('--scheduler', metavar='ADDRESS', help=cluster),
        count('--jobs', 'processes (default: one a core)', 1),
    ):
        function = add(function)
    return function


def workers_of(
    *, isolated: bool, jobs: int | None, scheduler: str | None, memory: float | None,
    timeout: float, dashboard: bool,
) -> Workers:  # fmt: skip
    """Who works, from the options of `workers`.

    Args:
        isolated: Whether a single process is one of its own, too.
        jobs: Processes; None takes one a core.
        scheduler: Address of a cluster in their place.
        memory: Of a process [GB]; None takes its share.
        timeout: After which a task hangs [s].
        dashboard: Whether Dask shows its page.

    Raises:
        ConfigurationError: a scheduler is given, and there is no Dask.
    """
    from ..batch.workers import Workers, has_dask

    number = jobs or len(os.sched_getaffinity(0))
    if not has_dask():
        if scheduler:
            raise ConfigurationError('--scheduler', 'needs dask and distributed: make setup')
        tell('dask is not installed: one process (make setup installs it)')
        number = 0
    number = 0 if number == 1 and not isolated else number
    limit = None if memory is None else round(1e9 * memory)
    return Workers(
        number=number, scheduler=scheduler or '', memory=limit, timeout=timeout,
        dashboard=dashboard, notice=tell,
    )  # fmt: skip


def tell(line: str) -> None:
    """A line beside the answer."""
    sys.stderr.write(f'spacerobot: {line}\n')


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
