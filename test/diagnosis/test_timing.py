"""How efforts act is told from the data: no friction stands in for half an interval of it."""

from __future__ import annotations

import pytest

pytest.importorskip('mujoco')

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.search.search import RelinearizedSearch
from spacerobot_ros.diagnosis.search.timing import in_words
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from validation.mujoco.run import Excitation
from validation.mujoco.sensors import Sensors
from validation.mujoco.truth import ROBOTS, generate

DURATION = 8.0  # s


def flown(folder, robot, seed, *effects, control='held', effort_mean=True, effort_std=None):
    """A record in closed loop on the sensors, and its robot."""
    motion = Excitation(amplitude=0.2, period=DURATION, control=control, measured=True)
    std = effort_std or ROBOTS[robot].effort_std
    sensors = Sensors(effort_std=std, effort_mean=effort_mean)
    case = generate(
        robot,
        effects,
        folder=folder,
        seed=seed,
        duration=DURATION,
        excitation=motion,
        sensors=sensors,
    )
    return case.data, load_robot_file(case.robot).robot


def search_of(record, robot, timing='sampled'):
    noise, _ = noise_levels(robot.sensors, record)
    run = Run(observed(record, robot), robot, (), noise, timing)
    return RelinearizedSearch(run, list(CATALOGUE.values()), lambda what, share: None)


def searched(record, robot, timing):
    return search_of(record, robot, timing).find()


def timing_of(record, robot):
    return search_of(record, robot).timing


@pytest.mark.parametrize(('robot', 'seed'), [('ground', 3), ('ground', 6), ('pendulum', 6)])
def test_means_of_held_torques_are_no_friction(tmp_path, robot, seed):
    """Light links show that the torque was held; its reading is that of a smooth one."""
    said = diagnose(*flown(tmp_path, robot, seed))
    assert said.verdict == 'consistent', said.sentence
    assert not said.causes


@pytest.mark.parametrize(('effort_mean', 'timing'), [(True, 'held_about'), (False, 'held_before')])
def test_conventions_of_recorders_are_told_apart(tmp_path, effort_mean, timing):
    record, robot = flown(tmp_path, 'ground', 8, effort_mean=effort_mean)
    assert timing_of(record, robot) == timing
    assert in_words(timing)


def test_friction_beside_means_of_held_torques_has_its_size(tmp_path):
    hidden = ('joint_viscous_friction', 'joint_2', {'coefficient': 0.5})
    said = diagnose(*flown(tmp_path, 'ground', 8, hidden))
    assert said.verdict == 'explained', said.sentence
    [cause] = said.causes
    assert (cause.applied.id, cause.applied.where) == hidden[:2]
    found = cause.parameters['coefficient']
    assert abs(found.value - 0.5) < 4.0 * found.std  # beyond that 1 of 15,000 seeds


def test_what_stands_in_for_half_an_interval_is_none_of_another_timing(tmp_path):
    """Beside a cause that is real, in a record whose noise hides when efforts act."""
    hidden = ('joint_viscous_friction', 'joint_2', {'coefficient': 1.0})
    record, robot = flown(tmp_path, 'ground', 4, hidden, control='smooth', effort_std=0.1)
    found = searched(record, robot, 'held_after')
    assert [cause.key for cause in found.fit.causes] == [hidden[:2]]


def test_two_causes_under_a_timing_that_is_not_that_of_the_record(tmp_path):
    hidden = [
        ('joint_viscous_friction', 'joint_2', {'coefficient': 1.0}),
        ('joint_torque_constant', 'joint_1', {'gain': 1.1}),
    ]
    record, robot = flown(tmp_path, 'ground', 8, *hidden)
    found = searched(record, robot, 'held_before')
    assert found.fit.run.timing == 'held_about'
    assert {cause.key for cause in found.fit.causes} == {h[:2] for h in hidden}
