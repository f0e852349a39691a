"""`spacerobot montecarlo`: simulate the closed loop over ranges of what is not known

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

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..display import Section
from . import options as opt
from .terminal import print_answer, print_sections, progress

if TYPE_CHECKING:
    from ..batch.ranges import Ranges

_BLOCKS = {False: 4, True: 500}  # runs of a task: seconds of work
_DYNAMICS = 'dynamics alone: computed torque in continuous time, exact sensors; 100 times as fast'
_REPLAY = 'one run again: its numbers and, but for --dynamics, its bag in DIR/run_RUN'


@opt.command(__doc__)
@opt.path_argument('ranges_file', metavar='RANGES')
@opt.robot
@opt.out
@opt.count('--runs', "in place of the file's", 1)
@opt.switch('--dynamics', help=_DYNAMICS)
@opt.count('--replay', _REPLAY)
@opt.as_json
@opt.workers
def run(
    ranges_file: str, robot: str, out: str, runs: int | None, dynamics: bool, replay: int | None,
    as_json: bool, **who: Any,
) -> int:  # fmt: skip
    """Run what is not there yet, write, print; 0 where every run ended."""
    from ..batch.fleet_table import write_table
    from ..batch.montecarlo_results import montecarlo_page, percentiles, sections, worst
    from ..batch.montecarlo_trial import RUN, block_keys, check_dynamics, failed_rows, trial_block
    from ..batch.ranges import load_ranges
    from ..batch.runner import Kept, Tasks, complete
    from ..report.html import write_report

    folder = opt.check_folder(out)
    ranges = load_ranges(ranges_file, robot, runs)
    if dynamics:
        check_dynamics(ranges)
    if replay is not None:
        return _replay(ranges, replay, dynamics, folder)
    folder.mkdir(parents=True, exist_ok=True)
    size = _BLOCKS[dynamics]
    keys = block_keys(ranges_file, ranges, dynamics, size)
    tasks = Tasks(run=trial_block, kept=Kept(folder / 'montecarlo.jsonl'))
    with progress() as stage:
        done = stage('simulating', ranges.runs)
        found = complete(tasks, keys, opt.workers_of(isolated=False, **who),
                         lambda n: done(min(n * size, ranges.runs)))  # fmt: skip
    rows = [row for record in found.records for row in record['rows']]
    rows += [row for key, why in found.failures.items() for row in failed_rows(key, why)]
    rows.sort(key=lambda row: row[RUN])
    write_table(rows, folder / 'runs', (RUN, *ranges.draw))
    write_table(percentiles(ranges, rows), folder / 'percentiles')
    words = ['spacerobot', 'montecarlo', ranges_file, '--robot', robot, '--out', out]
    words += ['--dynamics'] * dynamics
    words += ['--runs', str(runs)] if runs else []
    words.append('--replay')
    page = write_report(montecarlo_page(ranges, rows, words), folder / 'report.html')
    figures = {'percentiles': percentiles(ranges, rows), 'worst': worst(rows)}
    values = {'schema': 1, 'runs': len(rows), **figures, 'failures': found.failures}
    said = [*sections(ranges, rows, words), Section('', [f'report: {page}'])]
    print_answer(as_json, values, said)
    return 1 if any(row.get('error') for row in rows) else 0


def _replay(ranges: Ranges, number: int, dynamics: bool, folder: Path) -> int:
    """One run again, alone."""
    from ..batch.montecarlo_results import run_table
    from ..batch.montecarlo_trial import closed_loop, closed_loop_row, dynamics_rows
    from ..simulation.closed_loop import record_run

    row = dynamics_rows(ranges, [number])[0] if dynamics else closed_loop_row(ranges, number)
    print_sections([Section(f'run {number}', [run_table(row)])])
    if row['error']:
        return 1
    if not dynamics:
        loop, steps = closed_loop(ranges, number)
        bag = folder / f'run_{number}'
        record_run(loop, steps, bag, overwrite=True)
        print(f'bag: {bag}')
    return 0
