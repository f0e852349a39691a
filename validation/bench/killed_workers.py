"""Workers that are killed and come: the same table of many diagnoses as undisturbed.

    python -m validation bench.killed_workers [--count 200] [--seed 0]

Short seeded records of an arm, one cause in each. First one process diagnoses them all; then three
workers of a Dask scheduler of this machine, two of which are killed at drawn moments and one of
which is started. Every number of both tables is compared by its bits, which `repr` tells.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

from nodes import options

_JOINTS, _DURATION, _WORKERS = 3, 4.0, 3


@cache
def _robot_file():
    from scaling import robot_file

    from spacerobot_ros.effects.robot_file import load_robot_file

    with tempfile.TemporaryDirectory() as folder:
        return load_robot_file(robot_file(_JOINTS, True, Path(folder)))


def row_of(key: str) -> dict:
    """All that is said of one record."""
    from scaling import FEW, record_of

    from spacerobot_ros.diagnosis.answer.output import to_dict
    from spacerobot_ros.diagnosis.diagnose import diagnose
    from spacerobot_ros.effects.catalogue import CATALOGUE

    file = _robot_file()
    record = record_of(file.robot, _DURATION, int(key))
    kinds = [CATALOGUE[name] for name in FEW]
    return to_dict(diagnose(record, file.robot, file.effects, kinds))


def _started(env: dict, *words: str, stderr: int = subprocess.DEVNULL) -> subprocess.Popen:
    command = [sys.executable, '-m', 'dask', *words]
    return subprocess.Popen(command, env=env, stdout=subprocess.DEVNULL, stderr=stderr, text=True)


def disturbed(keys: list[str], seed: int) -> dict[str, dict]:
    """Rows by key, made by workers that are killed and come."""
    import killed_workers as own  # so that workers find the function by name
    import numpy as np

    from spacerobot_ros.batch.runner import outcomes
    from spacerobot_ros.batch.workers import Workers

    bench = Path(__file__).resolve().parent
    path = os.pathsep.join([str(bench), str(bench.parent), os.environ.get('PYTHONPATH', '')])
    env = {**os.environ, 'PYTHONPATH': path, 'OPENBLAS_NUM_THREADS': '1'}
    moments = np.sort(np.random.default_rng(seed).choice(len(keys) // 2, 3, replace=False)) + 3
    here = ('--no-dashboard', '--host', '127.0.0.1')
    scheduler = _started(env, 'scheduler', *here, '--port', '0', stderr=subprocess.PIPE)
    # the first line that says where it listens; the rest of it is not read
    address = next(re.search(r'tcp://\S+', line) for line in scheduler.stderr if 'tcp:' in line)[0]
    worker = ('worker', address, *here, '--no-nanny', '--nthreads', '1')
    workers = [_started(env, *worker) for _ in range(_WORKERS)]
    rows: dict[str, dict] = {}
    try:
        for outcome in outcomes(own.row_of, keys, Workers(scheduler=address, notice=print)):
            rows[outcome.key] = outcome.result or {'failure': outcome.failure}
            if len(rows) in moments[:2]:
                workers[int(np.searchsorted(moments, len(rows)))].kill()
                print(f'a worker is killed after {len(rows)} rows', flush=True)
            if len(rows) == moments[2]:
                workers.append(_started(env, *worker))
                print(f'a worker is started after {len(rows)} rows', flush=True)
    finally:
        for process in (*workers, scheduler):
            process.terminate()
            process.wait()
    return rows


def main() -> int:
    """Compare both tables; 0 where they are the same."""
    args = options(__doc__, count=200, seed=0)
    keys = [str(k) for k in range(args.count)]
    found = disturbed(keys, args.seed)
    alone = {key: row_of(key) for key in keys}
    other = [key for key in keys if repr(alone[key]) != repr(found[key])]
    print(f'{len(keys) - len(other)} of {len(keys)} rows are the same to the last bit')
    if other:
        print(alone[other[0]], found[other[0]], sep='\n')
    return bool(other)


if __name__ == '__main__':
    raise SystemExit(main())
