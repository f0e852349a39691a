"""Springs whose columns, those of small ones with a guessed rest, say less than others' do."""

from __future__ import annotations

import pytest

pytest.importorskip('mujoco')

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.refit import refine
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.inference.decisive import MISFIT
from validation.mujoco.truth import generate

SPRING = 'joint_stiffness'
OTHERS = (
    'joint_torque_constant',
    'joint_torque_ripple',
    'joint_viscous_friction',
    'torque_sensor_bias',
)


def spring(folder, joint, rest_angle, seed, excitation):
    """A record of an arm on the ground with a spring of 1.7 N m/rad, and its robot."""
    values = {'stiffness': 1.7, 'rest_angle': rest_angle}
    case = generate(
        'ground',
        ((SPRING, joint, values),),
        folder=folder,
        seed=seed,
        duration=12.0,
        excitation=excitation,
    )
    return case.data, load_robot_file(case.robot).robot


def assert_found(said):
    """The spring with its numbers, and no motor.

    What a controller that hears its own noise leaves of other joints may have a name, or none.
    """
    assert said.verdict in ('explained', 'partly_explained'), said.sentence
    by_id = {cause.applied.id: cause for cause in said.causes}
    assert OTHERS[0] not in by_id
    found = by_id[SPRING]
    assert found.applied.where == 'joint_1'
    for name, truth in {'stiffness': 1.7, 'rest_angle': -0.19}.items():
        # two numbers: beyond 4 standard deviations by chance in one of 8000 sets of seeds
        assert abs(found.parameters[name].value - truth) <= 4.0 * found.parameters[name].std


def test_a_spring_between_guesses_of_its_rest_is_first(tmp_path):
    record, robot = spring(tmp_path, 'joint_1', -0.19, 2, 'measured')
    assert_found(diagnose(record, robot, catalogue=[CATALOGUE[e] for e in (*OTHERS, SPRING)]))


def test_what_is_unsound_and_all_that_there_is_stays_unnamed(tmp_path):
    record, robot = spring(tmp_path, 'joint_1', -0.19, 2, 'measured')
    said = diagnose(record, robot, catalogue=[CATALOGUE[OTHERS[0]]])
    assert (said.verdict, said.causes) == ('unexplained', ())


def test_a_fit_arrives_where_columns_are_mostly_noise(tmp_path):
    """At a light wrist the column is 20 times what it changes in the data: steps are as short."""
    record, robot = spring(tmp_path, 'joint_4', 0.0, 1, 'slow')
    measured = observed(record, robot)
    run = Run(measured, robot, (), noise_levels(robot.sensors, measured)[0], 'sampled')
    weak = CATALOGUE[SPRING](
        name='weak', where='joint_4', values={'stiffness': 0.3, 'rest_angle': 0.3}
    )
    fit = refine(run, [weak])
    # the curvature of its likelihood gives 1.2 %; a step more or less is as much
    assert fit.causes[0].values['stiffness'] == pytest.approx(1.7, rel=0.1)
    assert fit.rows.whiteness()[0] >= MISFIT
