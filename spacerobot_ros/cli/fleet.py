"""`spacerobot fleet`: diagnose many recordings: one table, what drifts, what appeared when

Diagnose every recording below folders, each by itself, on all cores or on a Dask cluster. What
drifts, which cause appears first where, and which recordings can't be used stand in one report.
DATA are recordings, and folders of recordings.
The same command goes on where it was stopped, and adds new recordings.

writes: DIR/fleet.parquet, DIR/fleet.csv  a row a recording
        DIR/report.html                   what drifts, what appeared when, what could not be read
        DIR/reports/NAME/                 the diagnosis of each recording
        DIR/fleet.jsonl                   what is finished

examples:
  spacerobot fleet recordings --robot config/servicer.yaml --out out/fleet
  spacerobot fleet week1 week2 --robot arm.yaml --map arm_columns.yaml --out out/fleet --jobs 8
  spacerobot fleet recordings --robot arm.yaml --out out/fleet --scheduler tcp://10.0.0.1:8786

exit status: 0 all are consistent with the model, 1 something was found or could not be read, 2
unusable input
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..errors import ConfigurationError
from ..formats import counted
from . import options as opt
from .terminal import print_answer, progress

_CLOSED_LOOP = 'simulate what each extended model is worth to a controller, too'


@opt.command(__doc__)
@opt.path_argument('data', metavar='DATA...', nargs=-1, required=True)
@opt.recording
@opt.robot
@opt.out
@opt.switch('--closed-loop', help=_CLOSED_LOOP)
@opt.as_json
@opt.workers
def run(
    data: tuple[str, ...], mapping: str | None, split_gaps: bool, robot: str, out: str,
    closed_loop: bool, as_json: bool, **who: Any,
) -> int:  # fmt: skip
    """Diagnose what is not yet, write, print; 0 where all are consistent with the model."""
    from ..batch.fleet_page import fleet_page, summary
    from ..batch.fleet_table import COLUMNS, table_rows, write_table
    from ..batch.runner import Kept, Tasks, complete
    from ..batch.single import diagnose_one, digest, find_recordings, without_duplicates
    from ..diagnosis.findings import Question
    from ..report.html import write_report

    folder = opt.check_folder(out)
    question = Question(
        data=(), robot=str(Path(robot).absolute()),
        map=str(Path(mapping).absolute()) if mapping else '',
        split_gaps=split_gaps, has_closed_loop=closed_loop,
    )  # fmt: skip
    asked = digest(question)  # which reads robot and mapping, before the work is done
    found, tables = find_recordings(data, bool(mapping), folder)
    if tables:
        left_out = counted(len(tables), 'table')
        opt.tell(f'{left_out} left out for lack of --map, such as {tables[0]}')
    if all(recording.fault for recording in found):
        raise ConfigurationError(data[0], found[0].fault)
    recordings = without_duplicates(found)
    folder.mkdir(parents=True, exist_ok=True)
    keys = {r.key(question, folder, asked): r for r in recordings if not r.fault}
    tasks = Tasks(run=diagnose_one, kept=Kept(folder / 'fleet.jsonl'))
    workers = opt.workers_of(isolated=True, **who)
    with progress() as stage:
        finished = complete(tasks, list(keys), workers, stage('diagnosing', len(keys)))
    answers = [{**record, **keys[record['case']].about(folder)} for record in finished.records]
    answers += [{'error': r.fault, **r.about(folder)} for r in recordings if r.fault]
    answers.sort(key=lambda one: one['name'])
    failures = {keys[key].name: why for key, why in finished.failures.items()}
    rows = [*table_rows(answers), *({'recording': k, 'error': w} for k, w in failures.items())]
    # before anything is written: what was found is said where that fails, too
    values = {'schema': 1, 'recordings': answers, 'failures': failures}
    print_answer(as_json, values, summary(answers, failures))
    written = write_table(
        sorted(rows, key=lambda row: row['recording']), folder / 'fleet', COLUMNS
    )
    report = fleet_page(f'Fleet: {Path(robot).stem}', answers, failures)
    page = write_report(report, folder / 'report.html')
    if not as_json:
        print(f'written: {", ".join(map(str, (*written, page)))}')
    is_good = all(one.get('verdict') == 'consistent' for one in answers) and not failures
    return 0 if is_good else 1
