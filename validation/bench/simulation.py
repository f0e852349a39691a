"""Simulators side by side: how much faster than real time each is at the same accuracy.

    python -m validation bench.simulation [--peers FOLDER] [--output FILE]

Every engine runs the same robot and torques (`servicer.py`) at several steps or tolerances. What
counts as its accuracy is the largest of: relative drift of the angular momentum over 20 s, error
of the base attitude [rad] and of the joints [rad] at the end, against a tight reference. The table
gives, for each accuracy, the fastest setting that reaches it.

A peer that this interpreter lacks is run by FOLDER/<peer>/bin/python, if that exists, and is
skipped otherwise.
"""

from __future__ import annotations

import itertools
import json
import os
import platform
import subprocess
import sys
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import servicer
from nodes import options
from scipy.integrate import solve_ivp

HERE = Path(__file__).resolve().parent
# Script, module that it needs, name of its environment.
ENGINES = {
    'spacerobot_ros': ('ours', 'spacerobot_ros', ''),
    'MuJoCo': ('mujoco_', 'mujoco', 'mujoco'),
    'Drake': ('drake_', 'pydrake', 'drake'),
    'Basilisk': ('basilisk', 'Basilisk', 'basilisk'),
    'iDynTree': ('idyntree_loop', 'idyntree', 'idyntree'),
    'Pinocchio, plain loop': ('pinocchio_loop', 'pinocchio', 'pinocchio'),
}
LEVELS = (1e-3, 1e-6, 1e-9, 1e-12)
TIME_LIMIT = 900.0  # s an engine


def main() -> int:
    """Run the engines, print the table, write the results."""
    out = HERE.parents[1] / 'out/bench/simulation.json'
    asked = options(__doc__, peers=Path(os.environ.get('BENCH_PEERS', '.')), output=out)
    references = {scenario: reference(scenario) for scenario in servicer.SCENARIOS}
    runs, skipped = [], {}
    for engine, (script, module, environment) in ENGINES.items():
        python = interpreter(module, asked.peers / environment)
        if python is None:
            skipped[engine] = 'not installed'
            continue
        print(f'{engine} ...', file=sys.stderr)
        lines, why = run_engine(python, script)
        runs += [judged(line, references[line['scenario']]) for line in lines]
        if why:
            skipped[engine] = why
    results = {'machine': machine(), 'runs': runs, 'skipped': skipped}
    written(asked.output, results)
    print(table(results))
    return 0


def written(path: Path, results: dict) -> None:
    """Write results as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(results, indent=1) + '\n')


def interpreter(module: str, environment: Path) -> str | None:
    """The Python that has a module: its own environment's, or this one."""
    for python in (str(environment / 'bin' / 'python'), sys.executable):
        if Path(python).exists():
            found = subprocess.run(
                [python, '-c', f'import {module}'], capture_output=True, check=False
            )
            if found.returncode == 0:
                return python
    return None


def run_engine(python: str, script: str) -> tuple[list[dict], str]:
    """Results of an engine's script, and the last line of what went wrong, if anything did."""
    single = dict.fromkeys(('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS'), '1')
    path = os.pathsep.join([str(HERE), str(HERE.parents[1]), os.environ.get('PYTHONPATH', '')])
    try:
        done = subprocess.run(
            [python, str(HERE / 'peers' / f'{script}.py')],
            env={**os.environ, **single, 'PYTHONPATH': path},
            capture_output=True,
            text=True,
            check=False,
            timeout=TIME_LIMIT,
        )
    except subprocess.TimeoutExpired:
        return [], f'took longer than {TIME_LIMIT:g} s'
    lines = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('{')]
    return lines, (done.stderr.strip().splitlines() or ['failed'])[-1] if done.returncode else ''


def reference(scenario: str) -> tuple[np.ndarray, np.ndarray]:
    """Attitude and arm at the end: SciPy's DOP853 over Pinocchio, restarted where torques jump."""
    sys.path.insert(0, str(HERE / 'peers'))
    from pinocchio_loop import Machine

    model = Machine()
    held = scenario == 'held'
    edges = np.arange(round(servicer.DURATION / servicer.PERIOD) + 1) * servicer.PERIOD
    spans = itertools.pairwise(edges) if held else [(0.0, servicer.DURATION)]
    for start, end in spans:
        tau = servicer.torque(start)
        model.x = solve_ivp(
            lambda t, x, tau=tau: model.rate(x, tau if held else servicer.torque(t)),
            (start, end),
            model.x,
            'DOP853',
            **{'rtol': 1e-13, 'atol': 1e-15, 'first_step': min(0.01, end - start)},
        ).y[:, -1]
    *_, q, _, attitude = model.state()
    return attitude / np.linalg.norm(attitude), q[:3]


def judged(line: dict, expected: tuple[np.ndarray, np.ndarray]) -> dict:
    """A result with its errors and speed."""
    attitude = np.array(line.pop('attitude_xyzw'))
    attitude /= np.linalg.norm(attitude)
    difference = min(np.linalg.norm(attitude - s * expected[0]) for s in (1.0, -1.0))
    attitude_error = float(2.0 * difference)
    joint_error = float(np.max(np.abs(np.array(line.pop('arm')) - expected[1])))
    return {
        **line,
        'attitude_error': attitude_error,
        'joint_error': joint_error,
        'accuracy': max(line['momentum_drift'], attitude_error, joint_error),
        'times_real_time': servicer.DURATION / line['seconds'],
    }


def machine() -> dict:
    """Where and when the figures were taken."""
    model = platform.processor()
    for line in Path('/proc/cpuinfo').read_text().splitlines():
        if line.startswith('model name'):
            model = line.split(':')[1].strip()
            break
    return {
        'cpu': model,
        'cores': os.cpu_count(),
        'python': platform.python_version(),
        'date': datetime.now(timezone.utc).date().isoformat(),
    }


def table(results: dict) -> str:
    """Speed at equal accuracy, then every run."""
    where = results['machine']
    out = [f'{where["cpu"]}, one core, Python {where["python"]}, {where["date"]}; CPU time', '']
    for scenario in servicer.SCENARIOS:
        out.append(f'{scenario}: times real time at an accuracy of')
        out.append(f'{"":24s}' + ''.join(f'{level:>10.0e}' for level in LEVELS) + f'{"best":>10s}')
        out += [_row(engine, scenario, results) for engine in ENGINES]
        out.append('')
    out.append(
        f'{"engine":24s}{"run":8s}{"setting":28s}{"x real time":>12s}{"drift":>10s}'
        f'{"attitude":>10s}{"joints":>10s}'
    )
    out += [
        f'{r["engine"]:24s}{r["scenario"]:8s}{r["setting"]:28s}{r["times_real_time"]:12.1f}'
        f'{r["momentum_drift"]:10.1e}{r["attitude_error"]:10.1e}{r["joint_error"]:10.1e}'
        for r in results['runs']
    ]
    return '\n'.join(out)


def _row(engine: str, scenario: str, results: dict) -> str:
    runs = [r for r in results['runs'] if (r['engine'], r['scenario']) == (engine, scenario)]
    if not runs:
        return f'{engine:24s}  {results["skipped"].get(engine, "no result")}'
    cells = []
    for level in LEVELS:
        speeds = [r['times_real_time'] for r in runs if r['accuracy'] <= level]
        cells.append(f'{max(speeds):10.0f}' if speeds else f'{"-":>10s}')
    return f'{engine:24s}{"".join(cells)}{min(r["accuracy"] for r in runs):10.0e}'


if __name__ == '__main__':
    sys.exit(main())
