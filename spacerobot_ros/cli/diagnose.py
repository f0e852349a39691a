"""`spacerobot diagnose`: what the simulation gets wrong about measured data, and why."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import ConfigurationError
from .options import Formatter

JSON_NAME, REPORT_NAME = 'diagnosis.json', 'report.html'

_DESCRIPTION = """\
Compare measured data with the robot's simulation: show what is different, name the physical cause
with its place and size, extend the model by it, and measure the gain on data that it was not
fitted to. ROS is not needed.

writes: DIR/diagnosis.json       everything found, with its evidence
        DIR/report.html          one page for a review
        DIR/extended_model.yaml  the robot file with what was found under `effects`

verdicts: consistent        the model explains the data within the noise of the sensors
          explained         with the named causes it does
          partly_explained  causes are named, and something else is left
          unexplained       no known effect explains what is left; nothing is named
"""

_EPILOG = """\
examples:
  spacerobot diagnose run --robot config/servicer.yaml --out out/diagnosis
  spacerobot diagnose arm.csv --map arm_columns.yaml --robot arm.yaml --out out/arm
  spacerobot diagnose run --robot config/servicer.yaml --out out/d --json | jq .causes
  spacerobot simulate --robot out/diagnosis/extended_model.yaml -o again

exit status: 0 consistent with the model, 1 something was found, 2 unusable input
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the sub-command's arguments."""
    parser = subparsers.add_parser(
        'diagnose',
        help='name what a simulation gets wrong about measured data, and extend its model',
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=Formatter,
    )
    parser.add_argument(
        'data', metavar='DATA', help='rosbag2 folder, mcap or db3 file, npz, CSV or JSON'
    )
    parser.add_argument('--robot', required=True, metavar='YAML', help='robot file')
    parser.add_argument('--out', '-o', required=True, metavar='DIR', help='folder to write')
    parser.add_argument(
        '--score', metavar='DATA2', help='another recording: what the extended model misses of it'
    )
    parser.add_argument('--map', metavar='YAML', help='column mapping of the data (docs/data.md)')
    parser.add_argument(
        '--no-closed-loop',
        action='store_true',
        help='do not simulate what the extended model is worth to a controller',
    )
    parser.add_argument('--force', action='store_true', help='replace an earlier diagnosis')
    parser.add_argument('--json', action='store_true', help='print diagnosis.json, nothing else')


def run(args: argparse.Namespace) -> int:
    """Diagnose, write, print; 0 where the data are consistent with the model, else 1."""
    from ..diagnosis.answer.extended_model import write_extended_model
    from ..diagnosis.answer.output import EXTENDED_MODEL
    from ..report.html import write_report
    from .diagnose_answer import answer_of
    from .diagnose_report import report_of
    from .diagnose_summary import print_summary

    out = check_folder(args.out, args.force)
    with progress() as report:
        answer = answer_of(args, _command(args), report)
    text = json.dumps(answer.to_dict(), indent=2, allow_nan=False)
    write_extended_model(args.robot, answer.added, out / EXTENDED_MODEL)
    write_report(report_of(answer), out / REPORT_NAME)
    _write_text(out / JSON_NAME, text + '\n')  # the last: it says that the diagnosis is there
    if args.json:
        print(text)
    else:
        print_summary(answer)
        print(f'written: {out}: {JSON_NAME}, {REPORT_NAME}, {EXTENDED_MODEL}')
    return 0 if answer.diagnosis.verdict == 'consistent' else 1


def _write_text(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding='utf-8')
    except OSError as error:
        raise ConfigurationError(str(path), f'can not be written: {error.strerror}') from error


def check_folder(path: str, force: bool) -> Path:
    """The folder to write to.

    Raises:
        ConfigurationError: it can't be written to, or holds a diagnosis already.
    """
    folder = Path(path)
    above = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if not above.is_dir():
        raise ConfigurationError('--out', f'{above} is a file, not a folder')
    if not os.access(above, os.W_OK | os.X_OK):
        raise ConfigurationError('--out', f'{above} can not be written to')
    if (folder / JSON_NAME).exists() and not force:
        raise ConfigurationError(
            '--out', f'{folder} holds a diagnosis already (--force replaces it)'
        )
    return folder


def _command(args: argparse.Namespace) -> str:
    words = ['spacerobot', 'diagnose', args.data, '--robot', args.robot, '--out', args.out]
    words += ['--map', args.map] if args.map else []
    words += ['--score', args.score] if args.score else []
    words += ['--no-closed-loop'] if args.no_closed_loop else []
    return shlex.join(words)


@contextmanager
def progress() -> Iterator[Callable[[str, float], None]]:
    """A progress bar on stderr with what is being done; nothing where that is no terminal."""
    if not sys.stderr.isatty():
        yield lambda what, share: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task('reading', total=1.0)
        yield lambda what, share: bar.update(task, description=what, completed=share)
