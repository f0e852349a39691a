"""The search: limits, gain over Table II, reproducibility, interrupts, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.excitation import TABLE_TWO, robot_file, six_joints, with_excitation

from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.estimation.trajectory.motion_limits import Limits
from spacerobot_ros.excitation.assessment import Summary, _compared
from spacerobot_ros.excitation.design import Design, search
from spacerobot_ros.excitation.motions import Chosen
from spacerobot_ros.excitation.precision import own_motion, predict
from spacerobot_ros.excitation.problem import Problem

SYMMETRIC = {'structure': 'symmetric'}
WIDE = robot_file(
    reference=TABLE_TWO, excitation={'starts': 1, 'iterations': 25}, identifier=SYMMETRIC
)
USABLE = robot_file(
    excitation={
        'starts': 1,
        'iterations': 12,
        'joint_range': [np.pi / 3],
        'joint_rate': [0.5, 0.4, 0.5],
        'joint_acceleration': [0.3],
        'joint_torque': [150.0],
        'base_rate': 0.1,
        'base_rotation': 0.5,
    }
)


@pytest.fixture(scope='module')
def wide():
    """The problem within 175 degrees, and its design."""
    problem = Problem(WIDE)
    return problem, search(problem)


def predict_design(problem: Problem, x):
    return predict(problem, Chosen(problem.family, x, problem.start))


def predict_reference(problem: Problem):
    return predict(problem, own_motion(problem))


def finest_uses(problem: Problem, design: Design):
    """Uses on a grid that shares few times with the search's, ten times as fine as its nodes."""
    times = np.linspace(0.0, problem.family.duration, 10 * len(problem.family.times) + 7)
    return problem.limits.uses(problem.move(design.x[None], problem.family.at(times)))


def test_usable_motion_keeps_every_limit():
    problem = Problem(USABLE)
    design = search(problem)
    uses = finest_uses(problem, design)
    assert len(uses) == 4 * 3 + 2
    assert max(use.fraction for use in uses) <= 1.0 + 1e-6
    assert max(use.fraction for use in uses) > 0.95  # and wastes none
    assert problem.start_kind == 'rest'  # the initial 0.17 rad/s is beyond 0.1 rad/s
    notes = ' '.join(Summary(problem, design).notes)
    assert 'bring the base to rest first' in notes


def test_effort_limits_leave_room_for_feedback():
    file = robot_file()
    robot = replace(file.robot, effort_limits=np.array([200.0, 100.0, np.inf]))
    limits = Limits(robot, with_excitation(file, joint_torque=(150.0,)).settings.excitation)
    np.testing.assert_allclose(limits.torque, [150.0, 90.0, 150.0], rtol=1e-15, atol=0)


def test_the_base_turns_no_faster_than_gyro_and_tracker_can_follow():
    file = robot_file()
    sensors = replace(file.robot.sensors, gyro_range=0.3, attitude_rate_limit=0.2)
    robot = replace(file.robot, sensors=sensors)
    limits = Limits(robot, with_excitation(file, base_rate=0.4).settings.excitation)
    assert limits.base_rate == 0.2
    still = Problem(file)
    uses = limits.uses(still.move(np.zeros((1, still.family.size)), still.family))
    assert {use.where: use.limit for use in uses if use.name == 'gyro_range'} == {
        f'base {axis}': 0.3 for axis in 'xyz'
    }


def test_limits_of_a_slide_are_metres():
    parts = [replace(p, kind='prismatic') if i == 2 else p for i, p in enumerate(six_joints())]
    settings = {'starts': 1, 'iterations': 2, 'joint_rate': [0.5], 'base_rate': 0.1}
    problem = Problem(robot_file(parts, excitation=settings))
    design = search(problem)
    uses = finest_uses(problem, design)
    assert max(use.fraction for use in uses) <= 1.0 + 1e-6
    units = {(use.name, use.where): use.unit for use in uses}
    assert units['joint_range', 'j_link_2'] == 'm'
    assert units['joint_torque', 'j_link_2'] == 'N'
    assert units['joint_rate', 'j_link_1'] == 'rad/s'


def test_the_files_own_motion_is_written_where_it_is_better(tmp_path):
    problem = Problem(with_excitation(WIDE, harmonics=1))
    found = Design(problem.random(np.random.default_rng(0), 0.2), 0.0, (), False)
    summary = Summary(problem, found)
    assert summary.is_own
    assert 'is better than what the search found' in summary.notes[0]
    assert summary.design is summary.reference
    assert summary.design.aam_std < summary.searched.aam_std
    own = summary.chosen.family.reference(summary.chosen.x)
    np.testing.assert_allclose(own.sine, WIDE.settings.reference.sine, rtol=1e-12)
    assert max(use.fraction for use in summary.uses) <= 1.0


@pytest.mark.parametrize(
    ('changes', 'why'),
    [
        ({'base_rate': 0.3}, 'breaks a limit: base_rate of base reaches'),
        ({'duration': 10.0}, 'takes 20 s, excitation.duration is 10 s'),
        ({'start': 'rest'}, "starts at another base rate than a start of kind 'rest'"),
    ],
)
def test_the_files_own_motion_is_no_choice_and_why(changes, why):
    problem = Problem(with_excitation(WIDE, **changes))
    gentle = problem.random(np.random.default_rng(0), max(0.2, problem.resting_use + 0.05))
    summary = Summary(problem, Design(gentle, 0.0, (), False))
    assert not summary.is_own
    assert "the file's own motion tells more (wheel momentum +- " in summary.notes[0]
    assert why in summary.notes[0]


@pytest.mark.parametrize(
    ('why', 'said'), [('', 'alone; what'), ('is long', 'alone, and is long;')]
)
def test_a_motion_that_tells_fewer_bits_than_the_files_own_says_so(why, said):
    assert _compared('', why, 14.3).startswith("the file's own motion tells 14.3 bits more")
    assert said in _compared('', why, 14.3)
    assert '14.3' not in _compared('by this', why, 14.3)
    assert _compared('', '', -14.3) == ''


def test_velocity_limits_hold_beside_those_of_the_settings():
    file = robot_file()
    robot = replace(file.robot, velocity_limits=np.array([0.2, np.inf, 2.0]))
    settings = with_excitation(file, joint_rate=(0.5,)).settings.excitation
    np.testing.assert_array_equal(Limits(robot, settings).rate, [0.2, 0.5, 0.5])


def test_tells_more_than_table_two_within_175_degrees(wide):
    problem, design = wide
    assert max(use.fraction for use in finest_uses(problem, design)) <= 1.0 + 1e-6
    ours, table_two = predict_design(problem, design.x), predict_reference(problem)
    assert ours.bits > table_two.bits + 3.0
    assert ours.worst_aam < table_two.worst_aam
    assert ours.median_parameter < table_two.median_parameter
    np.testing.assert_allclose(table_two.condition, 801.0, rtol=0.01)  # notes, section 3
    np.testing.assert_allclose(table_two.unit_condition, 248.0, rtol=0.01)


@pytest.mark.parametrize('criterion', ['condition', 'unit_condition'])
def test_condition_number_of_table_two_is_improved(criterion):
    problem = Problem(with_excitation(WIDE, criterion=criterion))
    design = search(problem)
    own = predict_reference(problem)
    assert design.cost < np.log2(getattr(own, criterion)) - 0.5


def test_same_seed_same_motion_to_the_last_bit():
    file = with_excitation(USABLE, iterations=2, starts=2)
    first, second = search(Problem(file)), search(Problem(file))
    assert first.x.tobytes() == second.x.tobytes()
    other = search(Problem(with_excitation(file, seed=2)))
    assert first.x.tobytes() != other.x.tobytes()


def test_interrupt_keeps_the_best_so_far():
    problem = Problem(with_excitation(USABLE, starts=5))
    best = []

    def progress(steps: int, cost: float) -> None:
        best.append(cost)
        if steps == 7:
            raise KeyboardInterrupt

    design = search(problem, progress)
    assert design.interrupted
    assert len(design.attempts) == 1
    assert design.cost < design.attempts[0].first
    assert max(use.fraction for use in finest_uses(problem, design)) <= 1.0 + 1e-6


@pytest.mark.parametrize('dual', [False, True])
def test_six_joints_without_symmetry(dual):
    file = robot_file(
        six_joints(dual=dual),
        identifier={'structure': 'generic'},
        excitation={
            'starts': 1,
            'iterations': 6,
            'duration': 30.0,
            'joint_range': [2.0],
            'joint_rate': [0.5],
            'base_rate': 0.1,
        },
    )
    problem = Problem(file)
    assert problem.model.bodies.size == 70
    design = search(problem)
    assert design.cost < design.attempts[0].first - 0.1
    assert max(use.fraction for use in finest_uses(problem, design)) <= 1.0 + 1e-6


def test_limits_hold_for_uncertain_wheel_momentum():
    file = with_excitation(USABLE, momentum_uncertainty=30.0, iterations=3)
    problem = Problem(file)
    design = search(problem)
    motions = problem.moves(design.x[None], problem.fine)
    assert len(motions) == 7  # nominal, and each axis up and down
    rates = [float(np.linalg.norm(m.omega, axis=-1).max()) for m in motions]
    assert max(rates) <= 0.1 + 1e-9
    assert max(rates) > rates[0]


def test_spin_up_starts_at_the_rate_that_the_wheels_give():
    file = with_excitation(USABLE, start='spin_up', iterations=2)
    problem = Problem(file)
    np.testing.assert_allclose(  # notes, section 9
        problem.start.omega, [-0.0159, -0.0047, -0.0066], rtol=0, atol=6e-5
    )
    summary = Summary(problem, search(problem))
    assert summary.with_rest is not None
    assert summary.with_rest.bits > summary.design.bits


def test_own_wheels_at_rest_are_said_to_leave_the_scale_open():
    file = robot_file(wheels=(0.0, 0.0, 0.0), excitation={'starts': 1, 'iterations': 1})
    problem = Problem(file)
    summary = Summary(problem, search(problem))
    assert 'only ratios can be told' in summary.advice
    assert summary.design.scale_std > 10.0 * summary.wheels[0].prediction.scale_std


@pytest.mark.parametrize('share', [1.0, 1e-2])
def test_wheels_that_are_tried_fit_the_robot(share):
    """10 N m s are much for a robot of kilograms."""
    parts = [replace(p, mass=share * p.mass, inertia=share * p.inertia) for p in six_joints()]
    settings = {'starts': 1, 'iterations': 1, 'duration': 10.0}
    file = robot_file(parts, wheels=(0.0, 0.0, 0.0), excitation=settings)
    problem = Problem(file)
    still = Design(np.zeros(problem.family.size), 0.0, (), False)
    tried = [option.momentum / share for option in Summary(problem, still).wheels]
    expected = np.outer([1.0, 2.0, 5.0], np.ones(3)) * tried[0][0]
    np.testing.assert_allclose(tried, expected, rtol=1e-9)
    assert 5.0 < tried[0][0] < 50.0  # N m s of robots of tonnes


def test_faster_own_wheels_tell_the_common_scale(wide):
    scales = [o.prediction.scale_std for o in Summary(*wide).wheels]
    assert scales[0] > 1.3 * scales[1] > 1.3 * scales[2]


@pytest.mark.parametrize(
    ('changes', 'match'),
    [
        ({'start': 'initial', 'base_rotation': None}, r'base_rate of base reaches 0\.\d+ rad/s'),
        ({'joint_rate': (0.1, 0.2)}, r'joint_rate: expected one number, or 3'),
        ({'start': 'spin_up', 'base_rate': 1e-3}, 'no motion can keep the limits'),
    ],
)
def test_refusals(changes, match):
    with pytest.raises(ConfigurationError, match=match):
        Problem(with_excitation(USABLE, **changes))


def test_start_outside_the_joint_range_is_refused():
    file = robot_file(
        initial={'joint_position': [2.0, 0.0, 0.0]}, excitation={'joint_range': [1.0]}
    )
    with pytest.raises(ConfigurationError, match='joint_range of j_link_1 reaches 2 rad'):
        Problem(file)


@pytest.mark.parametrize(
    ('name', 'value', 'match'),
    [
        ('duration', 0.0, 'duration.*must be at least'),
        ('criterion', 'best', "'best' is not one of"),
        ('base_rate', -1.0, 'base_rate.*must be above 0'),
        ('starts', 0, 'starts.*must be at least 1'),
    ],
)
def test_bad_settings_are_refused(name, value, match):
    with pytest.raises(ConfigurationError, match=match):
        robot_file(excitation={name: value})
