"""Predicted standard deviations against maximum likelihood on simulated noisy records."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.excitation import robot_file
from support.identification import Run, measure

from spacerobot_ros.excitation.precision import Prediction, predict_design
from spacerobot_ros.excitation.problem import Problem
from spacerobot_ros.identification.batch import identify

SEEDS = range(5)


def run_of(problem: Problem, x: np.ndarray) -> Run:
    """The motion at 100 Hz; its truth is tested in test_base_response.py."""
    time = np.arange(round(100 * problem.family.duration) + 1) / 100.0
    m = problem.move(x[None], problem.family.at(time))
    attitude = Rotation.from_matrix(m.R_WB[0]).as_quat()
    return Run('', time, m.q[0], m.qd[0], m.omega[0], attitude, m.h_W[0])


def whitened(errors: np.ndarray, prediction: Prediction) -> np.ndarray:
    """Errors along the independent directions of the prediction, in units of their std."""
    correlation = prediction.covariance / np.outer(prediction.std, prediction.std)
    values, vectors = np.linalg.eigh(correlation)
    kept = values > 1e-6  # the bodies span fewer directions than the linear set
    assert np.sum(kept) >= 15
    return (errors / prediction.std) @ vectors[:, kept] / np.sqrt(values[kept])


@pytest.mark.parametrize('manifold', ['linear', 'physical'])
def test_monte_carlo_confirms_the_prediction(manifold):
    file = robot_file(
        identifier={'structure': 'symmetric', 'manifold': manifold},
        excitation={'joint_range': [2.0], 'starts': 1},
    )
    problem = Problem(file)
    _, x = problem.starting_motion(0)
    prediction = predict_design(problem, x)
    run = run_of(problem, x)
    believed = file.robot.with_target_momentum(np.zeros(3))
    errors = []
    for seed in SEEDS:
        estimate = identify(measure(run, seed), believed, file.settings.identifier)
        found = np.concatenate([estimate.aam, estimate.parameters])
        errors.append(found - prediction.values)
    rms = np.sqrt(np.mean(np.square(whitened(np.array(errors), prediction))))
    # five runs of some 20 independent directions: scatters by 7 %
    assert 0.7 < rms < 1.3


def test_half_the_noise_predicts_half_the_error():
    linear = {'structure': 'symmetric', 'manifold': 'linear'}
    first = Problem(robot_file(identifier=linear))
    x = first.starting_motion(0)[1]
    base = predict_design(first, x)
    quiet = {'gyro_std': 1e-5, 'attitude_std': 1.5e-5, 'joint_position_std': 1e-5}
    quiet['joint_velocity_std'] = 1e-4
    better = predict_design(Problem(robot_file(sensors=quiet, identifier=linear)), x)
    # half of every noise is half of every std, but for the weak prior
    np.testing.assert_allclose(better.std, 0.5 * base.std, rtol=0.02)
    assert better.bits > base.bits


def test_unstated_noise_is_said_to_be_assumed():
    problem = Problem(robot_file(sensors={'gyro_std': 1e-5}))
    assert problem.unstated == ('joint_position_std', 'joint_velocity_std', 'attitude_std')
    assert problem.noise.gyro == 1e-5
