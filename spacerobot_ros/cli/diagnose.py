"""`spacerobot diagnose`: name what a simulation gets wrong about data, and extend its model

Compare measured data with the robot's simulation: show what is different, name the physical cause
with its place and size, extend the model by it, and measure the gain on data that it was not
fitted to. ROS is not needed.

DATA is a rosbag2 folder, mcap or db3 file, npz, CSV or JSON; several are of one machine and are
taken together.

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

from . import options as opt
from .terminal import print_answer, progress

_PAYLOAD = 'further recordings, with a load at the end of an arm that the robot file lacks'
_OPEN = 'do not simulate what the extended model is worth to a controller'


@opt.command(__doc__)
@opt.path_argument('data', metavar='DATA...', nargs=-1, required=True)
@opt.recording
@opt.robot
@opt.out
@opt.path('--payload', metavar='DATA...', multiple=True, help=_PAYLOAD)
@opt.path('--score', metavar='DATA2', help='another recording: what the extended model misses')
@opt.switch('--no-closed-loop', 'is_open', help=_OPEN)
@opt.switch('--force', help='replace an earlier diagnosis')
@opt.force_data
@opt.as_json
def run(
    data: tuple[str, ...], mapping: str | None, split_gaps: bool, robot: str, out: str,
    payload: tuple[str, ...], score: str | None, is_open: bool, force: bool, force_data: bool,
    as_json: bool,
) -> int:  # fmt: skip
    """Diagnose, write, print; 0 where the data are consistent with the model, else 1."""
    from ..diagnosis.answer.output import EXTENDED_MODEL
    from ..diagnosis.findings import Question, findings
    from ..report.diagnosis_page import JSON_NAME, REPORT_NAME, write_answer
    from ..report.diagnosis_tables import summary

    folder = opt.check_folder(out, (JSON_NAME, 'a diagnosis'), force)
    with progress() as stage:
        asked = Question(
            data=data, payload=payload, robot=robot, map=mapping or '', split_gaps=split_gaps,
            has_closed_loop=not is_open, score=score or '', force_data=force_data,
        )  # fmt: skip
        answer = findings(asked, asked.command(out), stage('reading', 1.0))
    values = answer.to_dict()
    write_answer(answer, robot, folder)
    written = f'{folder}: {JSON_NAME}, {REPORT_NAME}, {EXTENDED_MODEL}'
    print_answer(as_json, values, summary(answer), written)
    return 0 if answer.diagnosis.verdict == 'consistent' else 1
