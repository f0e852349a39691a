"""`spacerobot fleet`: many recordings, each diagnosed, one table and one report.

Diagnose every recording below folders, each by itself, on all cores or on a Dask cluster. What
drifts, which cause appears first where, and which recordings can't be used stand in one report.
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

import argparse
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import ConfigurationError
from ..formats import counted
from .options import (
    check_folder,
    tell,
    workers_of,
)
from .terminal import print_json, print_sections, progress

if TYPE_CHECKING:
    from ..batch.single import Recording


def run(args: argparse.Namespace) -> int:
    """Diagnose what is not yet, write, print; 0 where all are consistent with the model."""
    from ..batch.fleet_page import fleet_page, summary
    from ..batch.fleet_table import COLUMNS, table_rows, write_table
    from ..batch.runner import Kept, Tasks, complete
    from ..batch.single import diagnose_one, find_recordings, without_duplicates
    from ..effects.robot_file import load_robot_file
    from ..report.html import write_report

    out = check_folder(args.out)
    load_robot_file(args.robot)  # before the work is done, not after
    found, tables = find_recordings(args.data, bool(args.map), out)
    if tables:
        tell(f'{counted(len(tables), "table")} left out for lack of --map, such as {tables[0]}')
    if all(recording.fault for recording in found):
        raise ConfigurationError(args.data[0], found[0].fault)
    recordings = without_duplicates(found)
    out.mkdir(parents=True, exist_ok=True)
    own = digest(args)
    keys = {_key(r, args, own): r for r in recordings if not r.fault}
    tasks = Tasks(run=diagnose_one, kept=Kept(out / 'fleet.jsonl'))
    workers = workers_of(args, isolated=True)
    with progress() as stage:
        finished = complete(tasks, list(keys), workers, stage('diagnosing', len(keys)))
    answers = [{**record, **_names(keys[record['case']], args)} for record in finished.records]
    answers += [{'error': r.fault, **_names(r, args)} for r in recordings if r.fault]
    answers.sort(key=lambda one: one['name'])
    failures = {keys[key].name: why for key, why in finished.failures.items()}
    rows = [*table_rows(answers), *_failed(failures)]
    if args.json:  # before anything is written: what was found is said where that fails, too
        print_json({'schema': 1, 'recordings': answers, 'failures': failures})
    else:
        print_sections(summary(answers, failures))
    written = write_table(sorted(rows, key=lambda row: row['recording']), out / 'fleet', COLUMNS)
    page = write_report(fleet_page(f'Fleet: {Path(args.robot).stem}', answers, failures),
                        out / 'report.html')  # fmt: skip
    if not args.json:
        print(f'written: {", ".join(map(str, (*written, page)))}')
    is_good = all(one.get('verdict') == 'consistent' for one in answers) and not failures
    return 0 if is_good else 1


def digest(args: argparse.Namespace) -> str:
    """What answers depend on beside the recordings.

    Robot, effects of one's own, mapping, options and version.
    """
    from .. import __version__
    from ..effects.own_kinds import source_files
    from ..effects.robot_file import load_robot_file
    from ..model.files import read_text

    file = load_robot_file(args.robot)
    parts = [__version__, Path(args.robot).read_text(encoding='utf-8'), file.robot.urdf]
    parts += [read_text(Path(args.map), 'mapping')] if args.map else []
    parts += [str(args.split_gaps), str(args.closed_loop)]
    own = [path.read_bytes() for path in source_files(file.settings.robot.effect_modules)]
    return hashlib.sha256(b'\0'.join([*(p.encode() for p in parts), *own])).hexdigest()[:16]


def _key(recording: Recording, args: argparse.Namespace, own: str) -> str:
    """All that the answer depends on, as `fleet.single.diagnose_one` takes it."""
    from ..diagnosis.findings import Question

    question = Question(
        data=(str(recording.path.absolute()),),
        robot=str(Path(args.robot).absolute()),
        map=str(Path(args.map).absolute()) if args.map else '',
        split_gaps=args.split_gaps,
        has_closed_loop=args.closed_loop,
    )
    return json.dumps(
        {
            'question': asdict(question),
            'out': str((Path(args.out) / 'reports' / recording.name).absolute()),
            'stamp': recording.stamp(),
            'asked': own,
        }
    )


def _names(recording: Recording, args: argparse.Namespace) -> dict[str, Any]:
    """Where a recording comes from, and its report."""
    report = Path('reports') / recording.name / 'report.html'
    has_report = not recording.fault and (Path(args.out) / report).exists()
    return {
        'name': recording.name,
        'machine': recording.machine,
        'path': str(recording.path),
        'report': str(report) if has_report else None,
    }


def _failed(failures: Mapping[str, str]) -> Sequence[Mapping[str, Any]]:
    return [{'recording': name, 'error': why} for name, why in failures.items()]
