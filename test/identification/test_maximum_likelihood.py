"""Maximum likelihood on simulated runs: recovery, covariance, noise levels, wrong priors."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from support.identification import (
    NOISE,
    SILENT,
    STDS,
    changed,
    errors_of,
    measure,
    servicer,
    simulate,
    truth_of,
)
from support.models import H_TARGET

from spacerobot_ros.estimation.filters.momentum_process import MomentumModel
from spacerobot_ros.estimation.unknowns.minimal import minimal_set
from spacerobot_ros.identification.batch import identify
from spacerobot_ros.identification.maximum_likelihood import MaximumLikelihood, prepare
from spacerobot_ros.model.robot_settings import SensorSettings
from spacerobot_ros.model.settings import IdentifierSettings

SEEDS = range(12)
SETTINGS = IdentifierSettings()
WRONG = 1.5  # factor on the prior's inertial parameters, alternating with its inverse
H = np.linalg.norm(H_TARGET)


def linear_estimate(axes, seed):
    """The core's estimate and covariance of [h_W; AAM; x], all columns free."""
    robot = servicer(axes, prior=WRONG)
    model = MomentumModel(robot, minimal_set(robot, 'symmetric'))
    likelihood = MaximumLikelihood(model, SETTINGS)
    likelihood.solve(prepare(measure(simulate(axes, 20.0), seed), NOISE))
    solution = likelihood.solution('ml')
    return SimpleNamespace(
        error=solution.constants - truth_of(simulate(axes, 20.0)),
        covariance=solution.information.solve()[1],
        chi2=solution.chi2_per_dof,
        converged=likelihood.is_converged,
    )


@pytest.fixture(scope='module')
def linear_runs():
    """Return noisy runs with a wrong prior, axes alternating."""
    return [linear_estimate(('zyx', 'xyy')[seed % 2], seed) for seed in range(6)]


@pytest.fixture(scope='module')
def runs():
    """Return errors, standard deviations and estimates of a dozen noisy runs."""
    out = []
    for seed in SEEDS:
        axes = ('zyx', 'xyy')[seed % 2]
        run = simulate(axes, 20.0)
        robot = servicer(axes, prior=WRONG)
        estimate = identify(measure(run, seed), robot, SETTINGS)
        out.append((*errors_of(estimate, truth_of(run)), estimate))
    return out


def test_core_converges_and_explains_the_data(linear_runs):
    assert all(run.converged for run in linear_runs)
    # 18600 residuals: standard deviation 0.01
    np.testing.assert_allclose([run.chi2 for run in linear_runs], 1.0, rtol=0, atol=0.1)


def test_core_states_its_whole_covariance_honestly(linear_runs):
    # Squared errors in the metric of the covariance: 6 runs x 25 unknowns, scatter 0.12.
    scores = []
    for run in linear_runs:
        std = np.sqrt(np.diag(run.covariance))
        z = run.error / std
        correlation = run.covariance / np.outer(std, std)
        scores.append(z @ np.linalg.solve(correlation, z) / len(z))
        assert np.max(np.abs(z)) <= 4.0
    assert 0.6 <= np.mean(scores) <= 1.4


def test_every_component_is_within_four_sigma(runs):
    for error, std, _ in runs:
        assert np.max(np.abs(error / std)) <= 4.0


def test_pooled_errors_have_the_stated_size(runs):
    z = np.array([error / std for error, std, _ in runs])
    # components of one run are correlated through the common scale
    assert 0.75 <= np.sqrt(np.mean(z**2)) <= 1.25


def test_wheel_momentum_is_within_the_requirement(runs):
    for error, std, _ in runs:
        assert np.max(np.abs(error[3:6])) <= 1.5e-3 * H
        assert np.max(std[3:6]) <= 5e-4 * H


def test_estimates_are_valid_complete_and_self_consistent(runs):
    for _, _, estimate in runs:
        assert estimate.valid
        assert estimate.reason == ''
        assert estimate.unexcited == ()
        assert estimate.rank == estimate.unknowns == 22
        assert 0.9 <= estimate.chi2_per_dof <= 1.1
        assert estimate.samples == 2001
        assert estimate.stamp_ns == 10**18 + 20 * 10**9
        estimate.check()


@pytest.mark.parametrize('axes', ['zyx', 'xyy'])
def test_a_minute_of_data(axes):
    run = simulate(axes, 60.0)
    estimate = identify(measure(run, 100), servicer(axes, prior=WRONG), SETTINGS)
    error, std = errors_of(estimate, truth_of(run))
    assert np.max(np.abs(error / std)) <= 4.0
    assert np.max(np.abs(error[3:6])) <= 4e-4 * H
    assert 0.95 <= estimate.chi2_per_dof <= 1.1


@pytest.mark.parametrize('axes', ['zyx', 'xyy'])
def test_data_without_noise_are_recovered(axes):
    run = simulate(axes, 20.0)
    robot = servicer(axes, SILENT, prior=WRONG)
    estimate = identify(measure(run, 0, scale=0.0), robot, SETTINGS)
    error, _ = errors_of(estimate, truth_of(run))
    truth = truth_of(run)
    for part in (slice(0, 3), slice(3, 6), slice(6, None)):
        # the filter's trapezoid and the splines at 0.01 s
        assert np.max(np.abs(error[part])) <= 1e-6 * np.max(np.abs(truth[part]))


def test_noise_levels_that_are_not_stated_are_estimated_and_said():
    run = simulate('zyx', 20.0)
    record = measure(run, 1)
    stated = identify(record, servicer('zyx', prior=WRONG), SETTINGS)
    silent = identify(record, servicer('zyx', SILENT, prior=WRONG), SETTINGS)
    said = [note for note in silent.notes if 'is not stated' in note]
    assert [note.split()[0] for note in said] == list(STDS)
    assert not any('is not stated' in note for note in stated.notes)
    error, std = errors_of(silent, truth_of(run))
    assert np.max(np.abs(error / std)) <= 4.0
    np.testing.assert_allclose(silent.std, stated.std, rtol=0.1, atol=0)
    assert 0.9 <= silent.chi2_per_dof <= 1.1


def test_prior_does_not_matter():
    # Right, too heavy and too light priors give the same to a small part of a sigma.
    run = simulate('zyx', 20.0)
    record = measure(run, 2)
    right, heavy, light = (
        identify(record, servicer('zyx', prior=prior), SETTINGS) for prior in (1.0, 1.5, 1.0 / 1.5)
    )
    for other in (heavy, light):
        shift = np.concatenate([other.aam - right.aam, other.parameters - right.parameters])
        assert np.max(np.abs(shift / right.std)) < 0.3
        np.testing.assert_allclose(other.std, right.std, rtol=0.05, atol=0)


@pytest.mark.parametrize(
    'rates',
    [
        {'attitude_every': 50},
        {'joint_every': 2, 'rate_every': 1},
        {'joint_every': 1, 'rate_every': 4, 'attitude_every': 7},
    ],
    ids=['tracker 2 Hz', 'joints 50 Hz', 'gyro 25 Hz'],
)
def test_sensors_at_other_rates(rates):
    run = simulate('zyx', 20.0)
    estimate = identify(measure(run, 4, **rates), servicer('zyx', prior=WRONG), SETTINGS)
    error, std = errors_of(estimate, truth_of(run))
    assert np.max(np.abs(error / std)) <= 4.0
    assert np.max(np.abs(error[3:6])) <= 1.5e-3 * H
    assert 0.9 <= estimate.chi2_per_dof <= 1.1


def test_joint_rates_need_not_be_measured():
    run = simulate('xyy', 20.0)
    data = measure(run, 5)
    encoders = changed(data, qd=None)
    estimate = identify(encoders, servicer('xyy', prior=WRONG), SETTINGS)
    error, std = errors_of(estimate, truth_of(run))
    assert np.max(np.abs(error / std)) <= 4.0
    # no more than a tenth worse than with them
    with_rates = identify(data, servicer('xyy', prior=WRONG), SETTINGS)
    assert np.max(std[3:6]) <= 1.1 * np.max(with_rates.std[:3])


@pytest.mark.parametrize('scale', [0.1, 10.0])
def test_errors_scale_with_the_noise(scale):
    run = simulate('zyx', 20.0)
    sensors = SensorSettings(**{name: scale * std for name, std in STDS.items()})
    robot = servicer('zyx', sensors, prior=WRONG)
    estimate = identify(measure(run, 6, scale), robot, SETTINGS)
    error, std = errors_of(estimate, truth_of(run))
    assert np.max(np.abs(error / std)) <= 4.0
    nominal = identify(measure(run, 6), servicer('zyx', prior=WRONG), SETTINGS)
    np.testing.assert_allclose(estimate.std[:3], scale * nominal.std[:3], rtol=0.25, atol=0)


def test_noise_that_is_larger_than_stated_shows():
    run = simulate('zyx', 20.0)
    estimate = identify(measure(run, 7, scale=3.0), servicer('zyx'), SETTINGS)
    assert estimate.chi2_per_dof == pytest.approx(9.0, rel=0.15)


def test_generic_structure():
    run = simulate('zyx', 60.0)
    settings = IdentifierSettings(structure='generic')
    estimate = identify(measure(run, 8), servicer('zyx', prior=WRONG), settings)
    error, std = errors_of(estimate, truth_of(run, 'generic'))
    assert estimate.valid
    assert estimate.rank == estimate.unknowns == 48
    assert np.max(np.abs(error / std)) <= 4.0
    assert np.max(np.abs(error[3:6])) <= 1.5e-3 * H
