"""A wrist of grams, its inertia changing by per cents a sample, and torque sensors of an arm."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('mujoco')

from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from validation.mujoco.run import Excitation
from validation.mujoco.sensors import Sensors
from validation.mujoco.truth import generate, robot_of
from validation.urdf import chain

LINKS = [
    ('0 0 0.3', 'z', '0 0 0.02', 0.3, '2e-4 2e-4 1e-4', '50'),
    ('0 0 0.05', 'y', '0 0 0.05', 0.3, '1e-3 1e-3 1e-4', '20'),
    ('0 0 0.1', 'z', '0.01 0 0.05', 0.5, '2e-3 2e-3 1e-3', '10'),
]
"""The first and the last axis are one where the middle joint is straight."""


def test_noise_of_efforts_acts_along_the_step(tmp_path):
    """It passes the wrist's inverse inertia, which is not what it is in the step's middle."""
    joints = ('joint_1', 'joint_2', 'joint_3')
    wrist = robot_of(chain(LINKS), joints, (0.2, 0.1, 0.1), free=False)
    case = generate(
        wrist,
        folder=tmp_path,
        seed=2,
        duration=8.0,
        excitation=Excitation(amplitude=0.5, period=3.0, control='held'),
        sensors=Sensors(effort_std=0.05, effort_mean=False),
    )
    robot = load_robot_file(case.robot).robot
    record = observed(case.data, robot)
    fit = Fit(Run(record, robot, (), noise_levels(robot.sensors, record)[0], 'held_before'), ())
    chance = np.sqrt(2.0 * len(fit.data))  # of the sum of so many squares
    assert abs(fit.misfit) < 4.0 * chance
    assert fit.rows.whiteness()[0] > 1e-3
