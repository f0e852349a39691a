"""Predicted standard deviations against maximum likelihood on simulated noisy records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.excitation import noisy_record, robot_file, six_joints

from spacerobot_ros.estimation.unknowns.body_coordinates import BodyCoordinates
from spacerobot_ros.excitation.motions import Chosen
from spacerobot_ros.excitation.precision import predict
from spacerobot_ros.excitation.problem import Problem
from spacerobot_ros.identification.batch import identify

SEEDS = range(5)
GENTLE = {'joint_range': [2.0], 'joint_rate': [0.5], 'base_rate': 0.1, 'starts': 1}
SLIDE = [replace(p, kind='prismatic') if i == 2 else p for i, p in enumerate(six_joints())]


def predicted(problem: Problem, x: np.ndarray):
    return predict(problem, Chosen(problem.family, x, problem.start))


def off(parts, structure, excitation):
    """A file whose truth has bodies and wheels that are off as `robot.uncertainty` says."""
    file = robot_file(parts)
    bodies = BodyCoordinates(file.robot, structure)
    y = bodies.std * np.random.default_rng(5).standard_normal(bodies.size)
    true = bodies.robot(y)
    # every body is one of these, and the other way round; to rounding
    np.testing.assert_allclose(bodies.coordinates(true), y, rtol=0, atol=1e-9)
    truth = {
        'links': [body.name for body in true.bodies],
        'inertial_parameters': true.inertial_parameters.ravel().tolist(),
        'target_momentum': file.robot.target_momentum.tolist(),
    }
    settings = {'identifier': {'structure': structure}, 'excitation': excitation}
    return robot_file(parts, **settings, truth=truth)


FILES = {
    'right': lambda: robot_file(identifier={'structure': 'symmetric'}, excitation=GENTLE),
    'off': lambda: off(None, 'symmetric', GENTLE),
    'six joints, right': lambda: robot_file(six_joints(), excitation=GENTLE),
    'six joints, off': lambda: off(six_joints(), 'generic', GENTLE),
    'a slide': lambda: robot_file(SLIDE, excitation=GENTLE),
}


@pytest.mark.parametrize('which', FILES)
def test_identify_is_as_sure_as_predicted(which):
    file = FILES[which]()
    problem = Problem(file)
    _, x = problem.starting_motion(1)
    prediction = predicted(problem, x)
    estimate = identify(noisy_record(problem, x, 0), file.robot, file.settings.identifier).estimate
    n = prediction.n_aam
    assert estimate.parameter_names == prediction.names[n:]
    # linear about the estimate instead of the truth; the factor found scatters, too
    np.testing.assert_allclose(estimate.std[:n] / prediction.std[:n], 1.0, rtol=0, atol=0.25)
    assert 0.8 < np.median(estimate.std[n:] / prediction.std[n:]) < 1.25
    assert estimate.prior_factor < 1.5 * prediction.prior_factor
    assert prediction.prior_factor < 1.5 * estimate.prior_factor


def test_right_bodies_are_found_surer_than_they_are_stated():
    problem = Problem(FILES['six joints, right']())
    prediction = predicted(problem, problem.starting_motion(1)[1])
    assert prediction.prior_factor < 0.2
    assert prediction.aam_std_as_stated > 1.3 * prediction.aam_std


def test_monte_carlo_confirms_the_prediction():
    file = robot_file(identifier={'structure': 'symmetric'}, excitation=GENTLE)
    problem = Problem(file)
    _, x = problem.starting_motion(0)
    prediction = predicted(problem, x)
    believed = file.robot.with_target_momentum(np.zeros(3))
    errors = []
    for seed in SEEDS:
        estimate = identify(
            noisy_record(problem, x, seed), believed, file.settings.identifier
        ).estimate
        errors.append(estimate.aam - prediction.values[:3])
    covariance = prediction.covariance[:3, :3]
    white = np.linalg.solve(np.linalg.cholesky(covariance), np.array(errors).T)
    # fifteen numbers, the bodies at the middle of their prior: above 1.5 once in a thousand
    assert np.sqrt(np.mean(white**2)) < 1.5


def test_half_the_noise_predicts_half_the_error():
    symmetric = {'structure': 'symmetric', 'nuisances': []}
    first = Problem(robot_file(identifier=symmetric))
    x = first.starting_motion(1)[1]
    base = predicted(first, x)
    quiet = {'gyro_std': 1e-5, 'attitude_std': 1.5e-5, 'joint_position_std': 1e-5}
    quiet['joint_velocity_std'] = 1e-4
    better = predicted(Problem(robot_file(sensors=quiet, identifier=symmetric)), x)
    # half of every noise is half of every std, but for the prior of the bodies
    np.testing.assert_allclose(better.stated_std, 0.5 * base.stated_std, rtol=0.1)
    assert better.bits > base.bits
    assert better.aam_bits > base.aam_bits + 2.5  # three axes, a bit each


def test_unstated_noise_is_said_to_be_assumed():
    problem = Problem(robot_file(sensors={'gyro_std': 1e-5}))
    assert problem.unstated == ('joint_position_std', 'joint_velocity_std', 'attitude_std')
    assert problem.noise.gyro == 1e-5
