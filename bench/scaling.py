"""Cost of a diagnosis as work grows: length of the record, joints, effects, recordings.

    python bench/scaling.py [--out docs/images/scaling.svg] [--json]

An arm of n joints, its motion prescribed, its torques by Pinocchio's RNEA with noise and one cause
that its file lacks. Every figure is of a process of its own: processor time without imports and
compiling, and the most memory that it had.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from pathlib import Path

RATE = 100.0  # Hz
HIDDEN = 3.0  # N m s/rad at joint_2
STD = {'joint_position_std': 2e-5, 'joint_effort_std': 0.05}
FEW = ('joint_viscous_friction', 'joint_coulomb_friction', 'torque_sensor_bias')


def robot_file(n: int, states_noise: bool, folder: Path) -> Path:
    """A chain of n joints on the ground, axes z and y in turn."""
    links = ['<robot name="arm"><link name="base_link"/>']
    parent = 'base_link'
    for k in range(1, n + 1):
        mass, axis = 8.0 / k, '0 0 1' if k % 2 else '0 1 0'
        links.append(
            f'<link name="link_{k}"><inertial><origin xyz="0.02 0 0.1"/><mass value="{mass}"/>'
            f'<inertia ixx="{0.01 * mass}" iyy="{0.01 * mass}" izz="{0.005 * mass}" ixy="0" '
            'ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="joint_{k}" type="revolute"><parent link="{parent}"/>'
            f'<child link="link_{k}"/><origin xyz="0 0 0.25"/><axis xyz="{axis}"/>'
            '<limit lower="-6" upper="6" effort="1e4" velocity="9"/></joint>'
        )
        parent = f'link_{k}'
    (folder / 'arm.urdf').write_text('\n'.join([*links, '</robot>']), encoding='utf-8')
    noise = f'sensors: {json.dumps(STD)}' if states_noise else ''
    names = ', '.join(f'joint_{k}' for k in range(1, n + 1))
    path = folder / 'arm.yaml'
    path.write_text(
        f'/**:\n  ros__parameters:\n    robot:\n      urdf: arm.urdf\n      base: fixed\n'
        f'      gravity: [0.0, 0.0, -9.81]\n      joints: [{names}]\n    {noise}\n',
        encoding='utf-8',
    )
    return path


def record_of(robot, duration, seed=0):
    """A motion that never repeats, and what it takes."""
    import numpy as np
    import pinocchio as pin

    from spacerobot_ros.recording.record import JointSeries, Record, to_stamps

    rng, n = np.random.default_rng(seed), robot.n_joints
    model = pin.buildModelFromXML(robot.urdf)
    model.gravity.linear = robot.gravity
    data, time_s = model.createData(), np.arange(0.0, duration, 1.0 / RATE)
    w = rng.uniform(0.3, 2.5, (4, n))
    phase, size = rng.uniform(0.0, 6.3, (4, n)), 0.5 / (1.0 + w)
    angle = w * time_s[:, None, None] + phase
    q = np.sum(size * np.sin(angle), axis=1)
    qd = np.sum(size * w * np.cos(angle), axis=1)
    qdd = -np.sum(size * w**2 * np.sin(angle), axis=1)
    tau = np.array([pin.rnea(model, data, *row) for row in zip(q, qd, qdd, strict=True)])
    tau[:, 1] += HIDDEN * qd[:, 1]
    return Record(
        JointSeries(
            robot.joints,
            to_stamps(time_s),
            q + STD['joint_position_std'] * rng.normal(size=q.shape),
            None,
            tau + STD['joint_effort_std'] * rng.normal(size=q.shape),
        )
    )


def measure(n: int, duration: float, states_noise: bool, few: bool, folder: Path) -> dict:
    """Cost of one diagnosis in this process."""
    from spacerobot_ros.diagnosis.diagnose import diagnose
    from spacerobot_ros.effects.catalogue import CATALOGUE
    from spacerobot_ros.effects.robot_file import load_robot_file

    file = load_robot_file(robot_file(n, states_noise, folder))
    kinds = [CATALOGUE[name] for name in FEW] if few else list(CATALOGUE.values())
    diagnose(record_of(file.robot, 8.0), file.robot, file.effects, kinds)  # compiles
    record = record_of(file.robot, duration)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
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
        'causes': [
            f'{c.applied.id}@{c.applied.where} {e.value:.5g} +- {e.std:.2g}'
            for c in found.causes
            for e in c.parameters.values()
        ],
    }


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--one', metavar='JSON')
    args = parser.parse_args()
    if args.one:
        import tempfile

        with tempfile.TemporaryDirectory() as name:
            print(json.dumps(measure(**json.loads(args.one), folder=Path(name))))
