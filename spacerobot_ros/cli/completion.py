"""`spacerobot completion`: commands, options, choices and files at a press of the tab key.

Print what makes a shell complete commands, options, choices and files of `spacerobot`.

examples:
  source <(spacerobot completion bash)                       in ~/.bashrc, or once by hand
  spacerobot completion zsh > ~/.zfunc/_spacerobot           a folder of $fpath, before compinit

exit status: 0 printed
"""

from __future__ import annotations

import argparse

from .options import Subparsers

_FOLDERS = ('DIR', 'FOLDER')


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    import shtab

    from .main import whole_parser

    parser = whole_parser()
    for action in _actions(parser):
        is_open = action.option_strings == [] or action.metavar is not None
        if is_open and not action.choices and action.nargs != 0:
            kind = shtab.DIRECTORY if action.metavar in _FOLDERS else shtab.FILE
            vars(action).setdefault('complete', kind)
    print(shtab.complete(parser, shell=args.shell))
    return 0


def _actions(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Of a parser and its sub-commands."""
    out: list[argparse.Action] = []
    for action in parser._actions:
        out.append(action)
        if isinstance(action, Subparsers):
            out += [a for sub in action.choices.values() for a in _actions(sub)]
    return out
