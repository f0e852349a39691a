"""Fits that start where no physical robot is, and fits that lead there."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.possible import is_physical, is_possible
from spacerobot_ros.estimation.refit import refine
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.estimation.unknowns.response import Response
from validation.hidden.diagnosis_scenario import robot_file, simulated


def applied(effect, where, **values):
    entry = CATALOGUE[effect]
    return entry(name=effect, where=where, values={**entry.nominal(), **values})


def test_two_causes_that_take_the_same_mass_are_drawn_back_to_a_body():
    robot = robot_file('servicer').robot
    record = observed(simulated('servicer', 'default', 1, (), 6.0), robot)
    run = Run(record, robot, (), noise_levels(robot.sensors, record)[0], 'held_before')
    _check_swings_are_remembered(run, applied('fuel_slosh', 'link_2', mass=1.0, frequency=3.0))
    # link_2 has 100 kg: taken at its centre of mass, 60 kg leave a body and 120 kg do not
    x = float(robot.bodies[2].com[0])
    second = -60.0 * x**2
    moments = {'mx': -60.0 * x, 'iyy': second, 'izz': second}
    lighter = applied('inertial_parameters', 'link_2', mass=-60.0, **moments)
    fuel = applied('fuel_slosh', 'link_2', mass=60.0, frequency=3.0, damping=0.05, x=x)
    assert is_possible(lighter, robot)
    assert not is_possible([lighter, fuel], robot)
    fit = refine(run, [lighter, fuel])
    assert is_possible(fit.causes, robot)
    assert np.isfinite(fit.evidence)
    # nothing is hidden in the record: both come out as nothing
    assert abs(fit.causes[0].values['mass']) < 5.0 * fit.standard_deviations()[0]['mass']


def _check_swings_are_remembered(run, fuel):
    """That of the first model serves all others, to the rounding of single precision."""
    causes = [(), [applied('gyro_bias', None)], [applied('joint_viscous_friction', 'joint_1')]]
    causes.append([applied('inertial_parameters', 'link_3', mass=1.0, ixx=0.1, iyy=0.1, izz=0.1)])
    rows = [Fit(run, some).rows for some in causes]
    alone, *others = (Response(r.robot, r.motion).force(fuel) for r in rows)
    for other in others:
        np.testing.assert_allclose(other, alone, rtol=0.0, atol=1e-7 * np.max(np.abs(alone)))
    late = Fit(run, [applied('joint_delay', None, delay=1e-3)]).rows
    assert late.motion.swung is not rows[0].motion.swung  # its samples are of other times


@pytest.mark.parametrize('delay', [4e-6, 3e-4])
def test_a_late_joint_clock_beside_held_torques_is_fitted_right(delay):
    """A sample that is late shows the same hold: the torque is no later than it was."""
    robot = robot_file('servicer').robot
    late = applied('joint_delay', None, delay=delay)
    record = observed(simulated('servicer', 'fast', 2, [late], 20.0), robot)
    run = Run(record, robot, (), noise_levels(robot.sensors, record)[0], 'held_before')
    fit = refine(run, [applied('joint_delay', None, delay=0.0)])
    std = fit.standard_deviations()[0]['delay']
    assert abs(fit.causes[0].values['delay'] - delay) < 3.5 * std  # of four seeds, one in 500
    assert std < 1e-6
    assert abs(fit.misfit) < 4.0 * np.sqrt(2.0 * len(fit.data))
    assert not np.any(
        fit.rows.time_base.blind
    )  # other samples are first and last, all with torque


def test_a_body_is_not_named_elsewhere_for_quieter_accelerations():
    """Noise of efforts moves a light link less where that link is taken for heavier.

    Were its spread part of the likelihood, `right_3` would win by 71 nats here.
    """
    robot = robot_file('twin').robot
    inertia = {'ixx': 0.0167, 'ixy': 0.0067, 'iyy': 0.0075, 'ixz': 0.0038, 'iyz': -0.0072}
    moments = {'mx': 0.024, 'my': -0.046, 'mz': -0.026, 'izz': 0.0162}
    body = applied('inertial_parameters', 'right_2', mass=0.165, **moments, **inertia)
    record = observed(simulated('twin', 'default', 13402, [body], 20.0), robot)
    run = Run(record, robot, (), noise_levels(robot.sensors, record)[0], 'held_before')
    right, wrong = (
        refine(run, [applied('inertial_parameters', where)]) for where in ('right_2', 'right_3')
    )
    assert right.evidence > wrong.evidence + 100.0  # the misfits alone differ by 400


def test_what_no_masses_make_is_no_body():
    """Its moments are positive and one is more than the other two: the triangle inequality."""
    robot = robot_file('servicer').robot
    stretched = applied('inertial_parameters', 'link_2', ixx=1e3)
    assert is_possible(stretched, robot)
    assert not is_physical([stretched], robot)
    record = observed(simulated('servicer', 'default', 1, (), 4.0), robot)
    run = Run(record, robot, (), noise_levels(robot.sensors, record)[0], 'held_before')
    fit = refine(run, [stretched])
    assert is_physical(fit.causes, robot)
    assert abs(fit.misfit) < 5.0 * np.sqrt(2.0 * len(fit.data))
