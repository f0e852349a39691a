"""Cost of a diagnosis as work grows: length of the record, joints, effects, recordings.

    python -m validation bench.scaling [--out validation/results/images/scaling.svg]

An arm of n joints, its motion prescribed, its torques by Pinocchio's RNEA with noise and one cause
that its file lacks. Every figure is of a process of its own: processor time without imports and
compiling, and the most memory that it had.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import time
from itertools import cycle
from pathlib import Path

from nodes import options

from validation.urdf import chain

RATE = 100.0  # Hz
HIDDEN = 3.0  # N m s/rad at joint_2
FREE_STD = {'gyro_std': 2e-5}
STD = {'joint_position_std': 2e-5, 'joint_effort_std': 0.05}
_BASE = (
    '<link name="base_link"><inertial><origin xyz="0 0 0"/><mass value="200"/>'
    '<inertia ixx="40" iyy="35" izz="30" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
FEW = ('joint_viscous_friction', 'joint_coulomb_friction', 'torque_sensor_bias')


def robot_file(n: int, states_noise: bool, folder: Path, base: str = 'fixed') -> Path:
    """A chain of n joints on the ground or in space, axes z and y in turn."""
    masses = [8.0 / k for k in range(1, n + 1)]
    links = [
        (*('0 0 0.25', axis, '0.02 0 0.1', m), f'{0.01 * m} {0.01 * m} {0.005 * m}', 1e4)
        for m, axis in zip(masses, cycle('zy'), strict=False)
    ]
    urdf = chain(links, velocity=9.0)
    if base == 'free':
        urdf = urdf.replace('<link name="base_link"/>', _BASE)
    (folder / 'arm.urdf').write_text(urdf, encoding='utf-8')
    std = STD | (FREE_STD if base == 'free' else {})
    noise = f'sensors: {json.dumps(std)}' if states_noise else ''
    gravity = -9.81 * (base == 'fixed')
    names = ', '.join(f'joint_{k}' for k in range(1, n + 1))
    path = folder / 'arm.yaml'
    path.write_text(
        f'/**:\n  ros__parameters:\n    robot:\n      urdf: arm.urdf\n      base: {base}\n'
        f'      base_link: base_link\n'
        f'      gravity: [0.0, 0.0, {gravity}]\n      joints: [{names}]\n    {noise}\n',
        encoding='utf-8',
    )
    return path


def motion_of(n, time_s, rng):
    """Positions, rates and accelerations that never repeat."""
    import numpy as np

    w = rng.uniform(0.3, 2.5, (4, n))
    phase, size = rng.uniform(0.0, 6.3, (4, n)), 0.5 / (1.0 + w)
    angle = w * time_s[:, None, None] + phase
    return (
        np.sum(size * np.sin(angle), axis=1),
        np.sum(size * w * np.cos(angle), axis=1),
        -np.sum(size * w**2 * np.sin(angle), axis=1),
    )


def record_of(robot, duration, seed=0):
    """A motion of an arm on the ground, or of one on a free base, and what it takes."""
    import numpy as np
    import pinocchio as pin

    from spacerobot_ros.recording.record import JointSeries, Record, to_stamps

    rng, time_s = np.random.default_rng(seed), np.arange(0.0, duration, 1.0 / RATE)
    q, qd, qdd = motion_of(robot.n_joints, time_s, rng)
    more = {}
    if robot.is_free:
        tau, more = floated(robot, time_s, (q, qd, qdd), rng)
    else:
        model = pin.buildModelFromXML(robot.urdf)
        model.gravity.linear = robot.gravity
        data = model.createData()
        tau = np.array([pin.rnea(model, data, *row) for row in zip(q, qd, qdd, strict=True)])
    tau[:, 1] += HIDDEN * qd[:, 1]
    joints = JointSeries(
        robot.joints,
        to_stamps(time_s),
        q + STD['joint_position_std'] * rng.normal(size=q.shape),
        None,
        tau + STD['joint_effort_std'] * rng.normal(size=q.shape),
    )
    return Record(joints, **more)


def floated(robot, time_s, motion, rng):
    """Torques of a free base without momentum, and what its gyro sees."""
    import numpy as np
    import pinocchio as pin

    from spacerobot_ros.recording.record import RateSeries, to_stamps

    model = pin.buildModelFromXML(robot.urdf, pin.JointModelFreeFlyer())
    model.gravity.linear[:] = 0.0
    data, full, step = model.createData(), pin.neutral(model), 1.0 / RATE
    tau, omega = [], []

    def rates(angles, speeds):
        full[7:] = angles
        pin.crba(model, data, full)
        matrix = pin.computeCentroidalMap(model, data, full)
        return np.concatenate([np.linalg.solve(matrix[:, :6], -matrix[:, 6:] @ speeds), speeds])

    for angles, speeds, bends in zip(*motion, strict=True):
        v = rates(angles, speeds)
        still = np.concatenate([np.zeros(6), bends])
        drift = pin.rnea(model, data, full, v, still)[:6]
        inertia = pin.crba(model, data, full)[:6, :6]
        a = np.concatenate([np.linalg.solve(inertia, -drift), bends])
        tau.append(pin.rnea(model, data, full, v, a)[6:].copy())
        omega.append(v[3:6].copy())
        between = angles + 0.5 * step * speeds + 0.125 * step**2 * bends
        middle = rates(between, speeds + 0.5 * step * bends)
        full[:] = pin.integrate(model, full, step * middle)
    gyro = np.array(omega) + FREE_STD['gyro_std'] * rng.normal(size=(len(time_s), 3))
    return np.array(tau), {'rates': RateSeries(to_stamps(time_s), gyro)}


def measure(
    n: int, duration: float, states_noise: bool, few: bool, folder: Path, base: str = 'fixed'
) -> dict:
    """Cost of one diagnosis in this process."""
    from spacerobot_ros.diagnosis.diagnose import diagnose
    from spacerobot_ros.effects.catalogue import CATALOGUE
    from spacerobot_ros.effects.robot_file import load_robot_file

    file = load_robot_file(robot_file(n, states_noise, folder, base))
    kinds = [CATALOGUE[name] for name in FEW] if few else list(CATALOGUE.values())
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    diagnose(record_of(file.robot, 8.0), file.robot, file.effects, kinds)  # compiles
    record = record_of(file.robot, duration)
    started = time.process_time()
    found = diagnose(record, file.robot, file.effects, kinds)
    return {
        'joints': n,
        'duration': duration,
        'samples': len(record.joint_time),
        'states_noise': states_noise,
        'effects': len(kinds),
        'cpu_s': time.process_time() - started,
        'before_mb': before / 1024.0,
        'peak_mb': resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        'verdict': found.verdict,
    }


BASE = {'n': 7, 'duration': 20.0, 'states_noise': True, 'few': False}
_UNKNOWN = {'states_noise': False}
SWEEPS = {  # what grows, and the way to make rows
    'length of the record [s]': [{'duration': d} for d in (10.0, 20.0, 40.0, 80.0)],
    'length, noise unknown [s]': [{'duration': d, **_UNKNOWN} for d in (15.0, 30.0, 60.0)],
    'number of joints': [{'n': n, 'duration': 10.0} for n in (3, 7, 15, 30)],
    'number of effects': [{'few': few} for few in (True, False)],
}


def shown(sweeps: dict[str, list[dict]]) -> list:
    """Tables, one a sweep, with the power of the growth between its ends."""
    from math import log

    from spacerobot_ros.display import table_of

    out = []
    for what, rows in sweeps.items():
        key = 'effects' if 'effects' in what else 'joints' if 'joints' in what else 'duration'
        first, last = rows[0], rows[-1]
        for row in rows:
            row['more_mb'] = row['peak_mb'] - row['before_mb']
        grown = log(last[key] / first[key])
        powers = [log(last[k] / first[k]) / grown for k in ('cpu_s', 'more_mb')]
        caption = f'grows with the power {powers[0]:.2f} in time, {powers[1]:.2f} in memory'
        cells = f'{{{key}:g}} | {{cpu_s:.1f}} | {{more_mb:.0f}} | {{peak_mb:.0f}}'
        heads = f'{what} | processor time [s] | memory for it [MB] | in all [MB]'
        out.append(table_of(rows, heads, cells, caption, what))
    return out


def draw(sweeps: dict[str, list[dict]], path: Path) -> None:
    """Time and memory against the length of the record."""
    from spacerobot_ros.display import Curve, Panel
    from validation.results.draw import curves

    def curve(what: str, key: str) -> Curve:
        rows = sweeps[what]
        return Curve(what.split(' [')[0], [r['duration'] for r in rows], [r[key] for r in rows])

    lengths = [what for what in sweeps if 'length' in what]
    panels = [
        Panel(title, unit, [curve(what, key) for what in lengths])
        for title, unit, key in (('processor time', 's', 'cpu_s'), ('memory', 'MB', 'more_mb'))
    ]
    curves(panels, 'length of the record [s]', path)


def sweep() -> dict[str, list[dict]]:
    """Every point in a process of its own, one core."""
    env = {**os.environ, 'OPENBLAS_NUM_THREADS': '1', 'OMP_NUM_THREADS': '1'}
    out: dict[str, list[dict]] = {}
    for what, changes in SWEEPS.items():
        for change in changes:
            command = [sys.executable, __file__, '--one', json.dumps({**BASE, **change})]
            done = subprocess.run(command, env=env, check=True, capture_output=True, text=True)
            out.setdefault(what, []).append(json.loads(done.stdout))
    return out


def main() -> None:
    """Measure and print."""
    import tempfile

    args = options(__doc__, one='', out='', kept='')
    if args.one:
        with tempfile.TemporaryDirectory() as name:
            print(json.dumps(measure(**json.loads(args.one), folder=Path(name))))
        return
    from spacerobot_ros.display import Section
    from validation.tables import markdown

    kept = Path(args.kept) if args.kept else None
    if kept is not None and kept.exists():
        found = json.loads(kept.read_text(encoding='utf-8'))
    else:
        found = sweep()
        if kept is not None:
            kept.write_text(json.dumps(found), encoding='utf-8')
    print(markdown('Cost of a diagnosis', [Section('', shown(found))]))
    if args.out:
        draw(found, Path(args.out))


if __name__ == '__main__':
    main()
