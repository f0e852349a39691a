"""`spacerobot completion`: what makes bash or zsh complete all of this

Print what makes a shell complete commands, options, choices and files of `spacerobot`.

examples:
  source <(spacerobot completion bash)                       in ~/.bashrc, or once by hand
  spacerobot completion zsh > ~/.zfunc/_spacerobot           a folder of $fpath, before compinit

exit status: 0 printed
"""

from __future__ import annotations

import click

from .options import command

VARIABLE = '_SPACEROBOT_COMPLETE'
"""Of the environment, in which the script asks what completes a line."""


@command(__doc__)
@click.argument('shell', type=click.Choice(['bash', 'zsh']))
@click.pass_context
def run(context: click.Context, shell: str) -> int:
    """Print the script."""
    from click.shell_completion import get_completion_class

    root = context.find_root()
    of_shell = get_completion_class(shell)
    assert of_shell is not None  # one of the choices
    print(of_shell(root.command, {}, 'spacerobot', VARIABLE).source())
    return 0
