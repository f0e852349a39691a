"""Batches of momentum regressors: CPU time a sample-row, ours and Pinocchio's a call a sample.

    python -m validation bench.regressor [--output FILE]

The robot has three joints and ten parameters a body; a sample has three rows. Ours is the
regressor of the minimal parameters; Pinocchio's is the joint torque regressor with velocities for
accelerations, whose first rows are the momentum.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import harness
import numpy as np
import pinocchio as pin
import servicer
from nodes import options
from simulation import machine, written

from spacerobot_ros.dynamics.blocks import BlockTree
from spacerobot_ros.dynamics.pinocchio_model import in_pinocchio
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.settings import parse_settings

SAMPLES, ROWS, REPEATS = 2000, 3, 7


def main() -> int:
    """Measure, print and write."""
    where = Path(__file__).resolve().parents[2] / 'out/bench/regressor.json'
    output = options(__doc__, output=where).output
    joints = [f'j_{name}' for name in servicer.JOINTS]
    wheels = {
        'servicer_wheels': {'joints': joints[3:6], 'rates': [0.0] * 3},
        'target_wheels': {'joints': joints[6:], 'rates': [0.0] * 3},
    }
    section = {'base_link': 'base', 'joints': joints[:3], **wheels}
    robot = build_robot(parse_settings({'robot': section}), servicer.urdf())
    rng = np.random.default_rng(0)
    q, u = rng.standard_normal((SAMPLES, 3)), rng.standard_normal((SAMPLES, 6))
    tree, model = BlockTree(robot), in_pinocchio(robot).model
    data, zero = model.createData(), np.zeros(model.nv)
    poses = np.column_stack([np.zeros((SAMPLES, 6)), np.ones(SAMPLES), q])
    rates = np.column_stack([np.zeros((SAMPLES, 3)), u])

    def ours() -> None:
        tree.regressor(q, u)

    def pinocchio() -> None:
        for pose, rate in zip(poses, rates, strict=True):
            pin.computeJointTorqueRegressor(model, data, pose, zero, rate)

    engines = {'spacerobot_ros': ours, 'Pinocchio': pinocchio}
    times = {name: microseconds_a_row(batch) for name, batch in engines.items()}
    written(output, {'machine': machine(), 'microseconds_a_row': times})
    print('momentum regressor, us a sample-row on one core:')
    for engine, value in times.items():
        print(f'{engine:24s}{value:8.2f}')
    return 0


def microseconds_a_row(batch: Callable[[], None]) -> float:
    """Shortest CPU time of a batch, a row [us]."""
    batch()
    best = np.inf
    for _ in range(REPEATS):
        start = harness.clock()
        batch()
        best = min(best, harness.clock() - start)
    return float(1e6 * best / (SAMPLES * ROWS))


if __name__ == '__main__':
    sys.exit(main())
