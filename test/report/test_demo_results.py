"""What the demonstration compares its estimates with."""

from __future__ import annotations

import numpy as np
import pytest
from support.models import (
    H_BASE,
    H_TARGET,
    WHEEL_SPIN,
    robot_of,
    settings_of,
    table_one,
    wheel_joints,
    with_wheels,
)

from spacerobot_ros.demo.results import momentum_percent, truth_of
from spacerobot_ros.estimation.unknowns.minimal import minimal_set
from spacerobot_ros.simulation.truth import true_robot


@pytest.mark.parametrize('structure', ['generic', 'symmetric'])
def test_the_truth_of_a_plant_with_rotors_is_that_of_the_locked_one(structure):
    parts = with_wheels(table_one())
    wheels = {
        'servicer_wheels': {'joints': wheel_joints(0), 'rates': list(H_BASE / WHEEL_SPIN)},
        'target_wheels': {'joints': wheel_joints(3), 'rates': list(H_TARGET / WHEEL_SPIN)},
    }
    robot, locked = robot_of(parts, **wheels), robot_of(table_one())
    plant = true_robot(robot, settings_of(parts, **wheels))
    heavier = np.zeros_like(plant.inertial_parameters)
    heavier[3] = 0.1 * plant.inertial_parameters[3]  # the captured satellite without its wheels
    plant = plant.with_inertial_parameters(plant.inertial_parameters + heavier)
    locked = locked.with_inertial_parameters(locked.inertial_parameters + heavier[:4])
    found = truth_of(robot, plant, structure)
    np.testing.assert_allclose(found[:3], H_TARGET, rtol=1e-14, atol=0)
    expected = minimal_set(locked, structure).of_robot(locked)
    # rounding of 2000 kg and 1500 kg m^2, from which wheels are taken and to which they are put
    np.testing.assert_allclose(found[3:], expected, rtol=0, atol=1e-9)


def test_errors_count_by_the_momentum_of_their_link():
    truth = np.array([3.0, 0.0, 4.0, 0.0, 0.0, 0.0])
    percents = momentum_percent(np.array([[0.05, -0.1, 0.0, 0.5, 0.0, 0.0]]), truth)
    # a link at rest has no size of its own: all links' counts, 5 N m s
    np.testing.assert_allclose(percents, [[1.0, -2.0, 0.0, 10.0, 0.0, 0.0]], rtol=1e-15, atol=0)
