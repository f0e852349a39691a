"""`spacerobot diagnose`: what the simulation gets wrong about measured data, and why.

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

examples:
  spacerobot diagnose run --robot config/servicer.yaml --out out/diagnosis
  spacerobot diagnose arm.csv --map arm_columns.yaml --robot arm.yaml --out out/arm
  spacerobot diagnose run1.csv run2.csv --map arm_columns.yaml --robot arm.yaml --out out/arm
  spacerobot diagnose empty.csv --payload full.csv --map columns.yaml --robot arm.yaml --out out/p
  spacerobot diagnose run --robot config/servicer.yaml --out out/d --json | jq .causes
  spacerobot simulate --robot out/diagnosis/extended_model.yaml -o again

exit status: 0 consistent with the model, 1 something was found, 2 unusable input
"""

from __future__ import annotations

import argparse

from .options import check_folder
from .terminal import print_json, print_sections, progress


def run(args: argparse.Namespace) -> int:
    """Diagnose, write, print; 0 where the data are consistent with the model, else 1."""
    from ..diagnosis.answer.output import EXTENDED_MODEL
    from ..diagnosis.findings import Question, findings
    from ..report.diagnosis_files import JSON_NAME, REPORT_NAME, write_answer
    from ..report.diagnosis_tables import summary

    out = check_folder(args.out, (JSON_NAME, 'a diagnosis'), args.force)
    with progress() as stage:
        asked = Question(
            data=tuple(args.data),
            payload=tuple(args.payload),
            robot=args.robot,
            map=args.map or '',
            split_gaps=args.split_gaps,
            has_closed_loop=not args.no_closed_loop,
            score=args.score or '',
        )
        answer = findings(asked, asked.command(args.out), stage('reading', 1.0))
    values = answer.to_dict()
    write_answer(answer, args.robot, out)
    if args.json:
        print_json(values)
    else:
        print_sections(summary(answer))
        print(f'written: {out}: {JSON_NAME}, {REPORT_NAME}, {EXTENDED_MODEL}')
    return 0 if answer.diagnosis.verdict == 'consistent' else 1
