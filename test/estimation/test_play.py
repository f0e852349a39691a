"""Play moves what an encoder says with the torque: it is no surer of it than the torque is known.

Oracle: the plant, whose encoder sees the torque itself, not the noise of its measurement.
"""

from __future__ import annotations

import math

import pytest

from spacerobot_ros.effects.joints.flexibility import Backlash
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.refit import refine
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from validation.hidden.diagnosis_scenario import robot_file, simulated

JOINT = 'right_joint_3'  # its torque is as small as its noise for a fifth of the time


@pytest.fixture(params=[1e-4, 1e-3], ids=['small', 'wide'])
def hidden(request):
    """The run of a record with play that nobody knows, and that play."""
    robot = robot_file('twin').robot
    truth = Backlash(name='play', where=JOINT, values={'gap': request.param})
    record = observed(simulated('twin', 'default', 3, [truth], 8.0), robot)
    return Run(record, robot, (), noise_levels(robot.sensors, record)[0], 'held_before'), truth


def test_the_true_play_explains_the_record_and_is_found(hidden):
    run, truth = hidden
    without, fit = Fit(run, ()), Fit(run, [truth])
    # with play that follows the noise of the efforts the wide one leaves 120 deviations
    spread = math.sqrt(2.0 * len(fit.data))
    assert abs(fit.misfit) < 4.0 * spread
    assert fit.misfit < without.misfit - spread
    found = refine(run, [truth])
    std = found.standard_deviations()[0]['gap']
    assert abs(found.causes[0]['gap'] - truth['gap']) < 3.5 * std
    assert std < 0.1 * truth['gap']


def test_readings_are_as_unsure_as_the_torque_only_where_that_matters(hidden):
    run, truth = hidden
    assert Fit(run, ()).rows.spread_cost == 0.0
    wide = truth.values | {'gap': 100.0 * truth['gap']}
    small, large = (
        Fit(run, [Backlash(name='play', where=JOINT, values=values)]).rows.spread_cost
        for values in (truth.values, wide)
    )
    assert 0.0 < small < large
