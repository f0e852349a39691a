"""What the controller does about the effects that its model believes in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spacerobot_ros.control.loop import ControlLoop
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.model.settings import TruthSettings
from spacerobot_ros.simulation.closed_loop import ClosedLoop

ROBOT = Path(__file__).resolve().parents[2] / 'config' / 'servicer.yaml'


@pytest.fixture(scope='module')
def file():
    return load_robot_file(ROBOT)


def tracking_error(file, plant, believed, seconds=4.0):
    """Root mean square joint error [rad] of a plant under a controller with other effects."""
    exact = replace(file.settings.simulator, noise=False)
    settings = replace(file.settings, truth=TruthSettings(), simulator=exact)
    loop = ClosedLoop(file.robot, replace(settings, effects=plant))
    loop.controller = ControlLoop(file.robot, replace(settings, effects=believed))
    errors = [
        step.command.setpoint.q - step.state.q
        for step in loop.run(round(seconds / settings.simulator.period))
    ]
    return float(np.sqrt(np.mean(np.square(errors))))


def test_believed_friction_is_made_up_for(file):
    effects = {
        'dry': {'effect': 'joint_coulomb_friction', 'where': 'joint_1', 'torque': 1.0},
        'wet': {'effect': 'joint_viscous_friction', 'where': 'joint_3', 'coefficient': 20.0},
    }
    unaware = tracking_error(file, effects, {})
    aware = tracking_error(file, effects, effects)
    nominal = tracking_error(file, {}, {})
    assert unaware > 5.0 * nominal
    # what is left: dry friction turns with the measured rate, its compensation with the wanted one
    assert aware < 0.1 * unaware


def test_believed_sensor_faults_are_undone(file):
    effects = {
        'zero': {'effect': 'encoder_offset', 'where': 'joint_2', 'offset': 0.02},
        'drift': {'effect': 'gyro_bias', 'x': 1e-3, 'y': -2e-3, 'z': 1e-3},
    }
    nominal = tracking_error(file, {}, {})
    assert tracking_error(file, effects, {}) > 100.0 * nominal
    # the faults are undone by a fixed point, exactly for offsets
    assert tracking_error(file, effects, effects) < 1.01 * nominal


def test_no_effects_change_nothing(file):
    loop = ControlLoop(file.robot, file.settings)
    assert loop.robot is file.robot
