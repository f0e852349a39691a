"""`spacerobot montecarlo`: the closed loop over ranges of what is not known.

Simulate the closed loop many times: what is not known of the machine (inertia, wheels, noise,
faults) is drawn from distributions, the controller believes the robot file. The same command goes
on where it was stopped; the same seed gives the same numbers.

RANGES is a YAML (docs/fleet.md):
  runs: 10000
  duration: 20.0                 # s
  seed: 1
  effects:                       # of the machine, unknown to its controller
    worn: {effect: joint_viscous_friction, where: joint_2}
  draw:                          # distributions as in scipy.stats
    inertia.link_3: {distribution: uniform, loc: 0.8, scale: 0.4}     # a factor
    truth.target_momentum[0]: {distribution: norm, loc: 42, scale: 5}
    sensors.gyro_std: {distribution: loguniform, a: 1.0e-5, b: 1.0e-4}
    effects.worn.coefficient: {distribution: expon, scale: 1.0}

writes: DIR/runs.parquet, DIR/runs.csv      a row a run
        DIR/percentiles.parquet, .csv       of every result
        DIR/report.html

examples:
  spacerobot montecarlo ranges.yaml --robot config/servicer.yaml --out out/mc
  spacerobot montecarlo ranges.yaml --robot config/servicer.yaml --out out/mc --dynamics
  spacerobot montecarlo ranges.yaml --robot config/servicer.yaml --out out/mc --replay 4711

exit status: 0 every run ended, 1 some did not (they are listed), 2 unusable input
"""

from __future__ import annotations

import argparse
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from ..display import Section
from .options import (
    check_folder,
    workers_of,
)
from .terminal import print_json, print_sections, progress

if TYPE_CHECKING:
    from ..batch.ranges import Ranges

_BLOCKS = {False: 4, True: 500}  # runs of a task: seconds of work


def run(args: argparse.Namespace) -> int:
    """Run what is not there yet, write, print; 0 where every run ended."""
    from ..batch.fleet_table import write_table
    from ..batch.montecarlo_results import (
        montecarlo_page,
        percentiles,
        sections,
        worst,
    )
    from ..batch.montecarlo_trial import RUN, check_dynamics, trial_block
    from ..batch.ranges import load_ranges
    from ..batch.runner import Kept, Tasks, complete
    from ..report.html import write_report

    out = check_folder(args.out)
    ranges = load_ranges(args.ranges, args.robot, args.runs)
    if args.dynamics:
        check_dynamics(ranges)
    if args.replay is not None:
        return _replay(args, ranges, out)
    out.mkdir(parents=True, exist_ok=True)
    size, asked = _BLOCKS[args.dynamics], _asked(args, ranges)
    keys = [
        json.dumps({**asked, 'first': k, 'last': min(k + size, ranges.runs)})
        for k in range(0, ranges.runs, size)
    ]
    tasks = Tasks(run=trial_block, kept=Kept(out / 'montecarlo.jsonl'))
    workers = workers_of(args, isolated=False)
    with progress() as stage:
        done = stage('simulating', ranges.runs)
        found = complete(tasks, keys, workers, lambda n: done(min(n * size, ranges.runs)))
    rows = [row for record in found.records for row in record['rows']]
    rows += _missing(found.failures)
    rows.sort(key=lambda row: row[RUN])
    write_table(rows, out / 'runs', (RUN, *ranges.draw))
    write_table(percentiles(ranges, rows), out / 'percentiles')
    words = ['spacerobot', 'montecarlo', args.ranges, '--robot', args.robot, '--out', args.out]
    words += ['--dynamics'] * args.dynamics
    words += ['--runs', str(args.runs)] if args.runs else []
    words.append('--replay')
    page = write_report(montecarlo_page(ranges, rows, words), out / 'report.html')
    if args.json:
        figures = {'percentiles': percentiles(ranges, rows), 'worst': worst(rows)}
        print_json({'schema': 1, 'runs': len(rows), **figures, 'failures': found.failures})
    else:
        print_sections([*sections(ranges, rows, words), Section('', [f'report: {page}'])])
    return 1 if any(row.get('error') for row in rows) else 0


def _asked(args: argparse.Namespace, ranges: Ranges) -> dict[str, str | bool]:
    """What a block of runs depends on beside their numbers."""
    from .. import __version__

    files = (args.ranges, args.robot)
    parts = [__version__, *(Path(f).read_text(encoding='utf-8') for f in files)]
    parts.append(ranges.robot_file.robot.urdf)
    digest = hashlib.sha256('\0'.join(parts).encode()).hexdigest()[:16]
    paths = {'ranges': str(Path(files[0]).absolute()), 'robot': str(Path(files[1]).absolute())}
    return {**paths, 'is_dynamics': args.dynamics, 'asked': digest}


def _missing(failures: Mapping[str, str]) -> list[dict[str, object]]:
    """Rows of the runs whose block failed."""
    rows = []
    for key, why in failures.items():
        block = json.loads(key)
        rows += [{'run': k, 'error': why} for k in range(block['first'], block['last'])]
    return rows


def _replay(args: argparse.Namespace, ranges: Ranges, out: Path) -> int:
    """One run again, alone."""
    from ..batch.montecarlo_results import run_table
    from ..batch.montecarlo_trial import closed_loop, closed_loop_row, dynamics_rows
    from ..simulation.closed_loop import record_run

    if args.dynamics:
        row = dynamics_rows(ranges, [args.replay])[0]
    else:
        row = closed_loop_row(ranges, args.replay)
    print_sections([Section(f'run {args.replay}', [run_table(row)])])
    if row['error']:
        return 1
    if not args.dynamics:
        loop, steps = closed_loop(ranges, args.replay)
        bag = out / f'run_{args.replay}'
        record_run(loop, steps, bag, overwrite=True)
        print(f'bag: {bag}')
    return 0
