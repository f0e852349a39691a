"""`spacerobot diagnose`: what the simulation gets wrong about measured data, and why."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from .options import Subparsers, add_command, add_recording_options, check_folder
from .terminal import print_json, print_sections, progress

if TYPE_CHECKING:
    from ..report.diagnosis_tables import Findings

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
  spacerobot diagnose run1.csv run2.csv --map arm_columns.yaml --robot arm.yaml --out out/arm
  spacerobot diagnose run --robot config/servicer.yaml --out out/d --json | jq .causes
  spacerobot simulate --robot out/diagnosis/extended_model.yaml -o again

exit status: 0 consistent with the model, 1 something was found, 2 unusable input
"""


def add_parser(subparsers: Subparsers[argparse.ArgumentParser]) -> None:
    """Add the sub-command's arguments."""
    parser = add_command(subparsers, 'diagnose', _DESCRIPTION, _EPILOG)
    add_recording_options(parser)
    add = parser.add_argument
    add(
        'data',
        metavar='DATA',
        nargs='+',
        help='rosbag2 folder, mcap or db3 file, npz, CSV or JSON; several of one machine together',
    )
    add('--robot', required=True, metavar='YAML', help='robot file')
    add('--out', '-o', required=True, metavar='DIR', help='folder to write')
    add('--score', metavar='DATA2', help='another recording: what the extended model misses of it')
    add(
        '--no-closed-loop',
        action='store_true',
        help='do not simulate what the extended model is worth to a controller',
    )
    add('--force', action='store_true', help='replace an earlier diagnosis')
    add('--json', action='store_true', help='print diagnosis.json, nothing else')


def run(args: argparse.Namespace) -> int:
    """Diagnose, write, print; 0 where the data are consistent with the model, else 1."""
    from ..diagnosis.answer.extended_model import write_extended_model
    from ..diagnosis.answer.output import EXTENDED_MODEL
    from ..json_values import json_text
    from ..model.files import write_text
    from ..report.diagnosis_page import diagnosis_page
    from ..report.diagnosis_tables import summary
    from ..report.html import write_report

    out = check_folder(args.out, (JSON_NAME, 'a diagnosis'), args.force)
    with progress() as stage:
        answer = _answer(args, stage('reading', 1.0))
    values = answer.to_dict()
    write_extended_model(args.robot, (*answer.added, *answer.calibration), out / EXTENDED_MODEL)
    write_text(out / JSON_NAME, json_text(values))
    write_report(diagnosis_page(answer), out / REPORT_NAME)
    if args.json:
        print_json(values)
    else:
        print_sections(summary(answer))
        print(f'written: {out}: {JSON_NAME}, {REPORT_NAME}, {EXTENDED_MODEL}')
    return 0 if answer.diagnosis.verdict == 'consistent' else 1


def _answer(args: argparse.Namespace, report: Callable[[float, str], None]) -> Findings:
    """Read, diagnose, and measure what that is worth."""
    from ..diagnosis.answer.appearance import appearances
    from ..diagnosis.answer.closed_loop_gain import closed_loop_gain
    from ..diagnosis.answer.extended_model import named
    from ..diagnosis.answer.next_motion import with_motions
    from ..diagnosis.answer.score_on import score_on
    from ..diagnosis.diagnose import diagnose
    from ..effects.robot_file import load_robot_file
    from ..recording.read import read_record, read_records
    from ..report.diagnosis_tables import Findings

    file = load_robot_file(args.robot)
    records = read_records(args.data, file.robot, args.map, split_gaps=args.split_gaps)
    diagnosis = diagnose(
        records, file.robot, file.effects, report=lambda what, share: report(share, what)
    )
    said = dict.fromkeys(note for record in records for note in record.notes)
    diagnosis = replace(diagnosis, notes=(*said, *diagnosis.notes))
    diagnosis = with_motions(diagnosis, args.robot)
    added = named((cause.applied for cause in diagnosis.causes), file.effects)
    calibration = named(diagnosis.calibration, (*file.effects, *added))
    extension = (*added, *calibration)
    closed, why = None, 'left out (--no-closed-loop)'
    if not args.no_closed_loop:
        report(0.95, 'simulating a controller with the old and the extended model')
        closed, why = closed_loop_gain(file, extension)
    other = read_record(args.score, file.robot, args.map) if args.score else None
    return Findings(
        diagnosis=diagnosis,
        file=file,
        records=records,
        added=added,
        calibration=calibration,
        closed_loop=closed,
        why_open=why,
        appearances=appearances(diagnosis.series, records[0]),
        command=_command(args),
        score=()
        if other is None
        else score_on(other, file.robot, (*added, *calibration), file.effects),
    )


def _command(args: argparse.Namespace) -> str:
    words = ['spacerobot', 'diagnose', *args.data, '--robot', args.robot, '--out', args.out]
    words += ['--map', args.map] if args.map else []
    words += ['--split-gaps'] if args.split_gaps else []
    words += ['--score', args.score] if args.score else []
    words += ['--no-closed-loop'] if args.no_closed_loop else []
    return shlex.join(words)
