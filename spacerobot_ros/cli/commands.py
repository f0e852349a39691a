"""The commands of `spacerobot` as click sees them: each is imported when it is asked for.

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

import importlib
import os
from collections.abc import Sequence

import click

from .. import __version__
from ..errors import did_you_mean
from .completion import VARIABLE
from .options import command, invoked

COMMANDS = (
    *('demo', 'simulate', 'identify', 'check', 'show', 'diagnose', 'compare'),
    *('fleet', 'excite', 'montecarlo', 'export', 'completion'),
)
"""Modules, in the order of the help."""


class _Commands(click.Group):
    """Commands: `run` of the module of that name, which imports what is heavy inside it."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """All names."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """A command by its name."""
        if cmd_name in COMMANDS:
            command: click.Command = importlib.import_module(f'{__package__}.{cmd_name}').run
            return command
        if not ctx.resilient_parsing:
            hint = did_you_mean(cmd_name, COMMANDS, f'known: {", ".join(COMMANDS)}')
            ctx.fail(f'no such command: {cmd_name} ({hint})')
        return None


_SETTINGS = {
    'help_option_names': ['-h', '--help'],
    'max_content_width': 100,
    'show_default': True,
}


@click.version_option(__version__, message='spacerobot %(version)s')
@command(__doc__, click.group, cls=_Commands, no_args_is_help=False, context_settings=_SETTINGS)
def spacerobot() -> int:
    """All commands; runs before each of them."""
    return 0


def run(words: Sequence[str]) -> int:
    """Run a command, or answer a shell that asks what completes its line.

    Returns:
        Exit status of the command.

    Raises:
        SpaceRobotError: words that no command takes.
    """
    if instruction := os.environ.get(VARIABLE):
        from click.shell_completion import shell_complete

        return shell_complete(spacerobot, {}, 'spacerobot', VARIABLE, instruction)
    return invoked(spacerobot, 'spacerobot', words)
