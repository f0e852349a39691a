"""Readings that are divided by a sensor's gain have their noise divided with them."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.refit import refine
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.sensing.reading_gains import reading_gains
from validation.hidden.diagnosis_scenario import robot_file, simulated

SCALES = [
    ('servicer, fixed', 'encoder_scale', 'joint_1', {'gain': 0.85}),
    ('servicer, fixed', 'joint_rate_scale', 'joint_2', {'gain': 1.25}),
    ('servicer', 'gyro_scale', None, {'x': 0.12, 'y': 0.0, 'z': -0.12}),
]


def applied(effect, where, **values):
    entry = CATALOGUE[effect]
    return entry(name=effect, where=where, values={**entry.nominal(), **values})


@pytest.fixture(params=SCALES, ids=[scale[1] for scale in SCALES])
def hidden(request):
    """The run of a record with a scale that nobody knows, and that scale."""
    name, effect, where, values = request.param
    robot = robot_file(name).robot
    truth = applied(effect, where, **values)
    record = observed(simulated(name, 'default', 2, [truth], 8.0), robot)
    return Run(record, robot, (), noise_levels(robot.sensors, record)[0], 'held_before'), truth


def test_innovations_at_the_truth_have_unit_variance_sensor_by_sensor(hidden):
    run, truth = hidden
    fit = Fit(run, [truth])
    every = fit.rows.time_base.rows
    sensors = every.channel * (int(np.max(every.axis)) + 1) + every.axis
    settled = fit.rows.row_times > 0.1
    for sensor in np.unique(sensors):
        rows = fit.data[settled & (sensors == sensor)]
        # of thirty sensors one is beyond it in 500 seeds; noise as read: five of these or more
        assert abs(np.mean(rows**2) - 1.0) < 4.0 * np.sqrt(2.0 / len(rows)), sensor


def test_the_misfit_is_least_at_the_truth(hidden):
    run, truth = hidden
    fit = refine(run, [truth])
    stds = fit.standard_deviations()[0]
    for name, value in truth.values.items():
        assert abs(fit.causes[0].values[name] - value) < 3.5 * stds[name], name


def test_gains_are_of_each_joint_and_axis():
    robot = robot_file('servicer').robot
    record = observed(simulated('servicer', 'default', 1, (), 1.0), robot)
    assert not reading_gains(record, robot, [applied('joint_delay', None, delay=0.01)])
    effects = [
        applied('encoder_scale', 'joint_2', gain=0.9),
        applied('encoder_offset', 'joint_1', offset=0.02),
        applied('gyro_misalignment', None, x=0.2, y=0.1, z=-0.1),
        applied('gyro_scale', None, x=0.1, y=0.0, z=-0.1),
        applied('gyro_bias', None, x=1e-3),
    ]
    rows = {'joint_position': [1.0, 0.9, 1.0], 'joint_velocity': [1.0] * 3, 'gyro': [1.0] * 3}
    gains = reading_gains(record, robot, effects[:3])
    assert set(gains) == set(rows)
    for channel, expected in rows.items():
        # differences over 1e-6 of numbers near 1
        assert np.max(np.abs(gains[channel] - expected)) < 1e-8, channel
    # what is turned is scaled: lengths of diag(s) R lie between the scales
    turned = reading_gains(record, robot, effects)['gyro']
    assert np.all((turned > 0.9) & (turned < 1.1))
