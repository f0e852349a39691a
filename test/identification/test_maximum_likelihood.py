"""Maximum likelihood on simulated runs: recovery, covariance, noise levels, wrong priors."""

from __future__ import annotations

import numpy as np
import pytest
from support.identification import (
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

from spacerobot_ros.identification.batch import identify
from spacerobot_ros.model.robot_settings import SensorSettings
from spacerobot_ros.model.settings import IdentifierSettings

SEEDS = range(12)
SETTINGS, GENERIC = IdentifierSettings(structure='symmetric'), IdentifierSettings()
WRONG = 1.5  # factor on the prior's inertial parameters, alternating with its inverse
H = np.linalg.norm(H_TARGET)


@pytest.fixture(scope='module')
def runs():
    """Return errors, standard deviations and estimates of a dozen noisy runs."""
    out = []
    for seed in SEEDS:
        axes = ('zyx', 'xyy')[seed % 2]
        run = simulate(axes, 20.0)
        robot = servicer(axes, prior=WRONG)
        estimate = identify(measure(run, seed), robot, SETTINGS).estimate
        out.append((*errors_of(estimate, truth_of(run)), estimate))
    return out


def test_the_whole_covariance_is_honest(runs):
    # Squared errors along its principal axes: 12 runs x 18 numbers, scatter 0.1. Numbers that
    # follow from the others, as bodies have fewer, have none of their own.
    scores = []
    for error, std, estimate in runs:
        spread, axes = np.linalg.eigh(estimate.covariance / np.outer(std[3:], std[3:]))
        told = spread > 1e-9  # rounding 1e-15, the smallest of the others 5e-5
        assert 18 <= np.sum(told) <= 19
        scores.append(np.mean((axes.T @ (error[3:] / std[3:]))[told] ** 2 / spread[told]))
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
        assert np.max(np.abs(error[3:6])) <= 5e-4 * H
        assert np.max(std[3:6]) <= 1.4e-4 * H


def test_estimates_are_valid_complete_and_self_consistent(runs):
    for _, _, estimate in runs:
        assert estimate.valid
        assert estimate.reason == ''
        assert estimate.unexcited == ('base_link: mass',)
        # momenta, 19 numbers and four nuisances at most; bodies have more coordinates than those
        assert 22 <= estimate.rank <= 3 + 3 + 19 + 4 < estimate.unknowns == 32
        assert set(estimate.sources) == {'data'}
        assert 0.9 <= estimate.chi2_per_dof <= 1.1
        assert estimate.samples == 2001
        assert estimate.stamp_ns == 10**18 + 20 * 10**9
        estimate.check()


@pytest.mark.parametrize('axes', ['zyx', 'xyy'])
def test_a_minute_of_data(axes):
    run = simulate(axes, 60.0)
    estimate = identify(measure(run, 100), servicer(axes, prior=WRONG), SETTINGS).estimate
    error, std = errors_of(estimate, truth_of(run))
    assert np.max(np.abs(error / std)) <= 4.0
    assert np.max(np.abs(error[3:6])) <= 4e-4 * H
    assert 0.95 <= estimate.chi2_per_dof <= 1.1


@pytest.mark.parametrize('axes', ['zyx', 'xyy'])
def test_data_without_noise_are_recovered(axes):
    run = simulate(axes, 20.0)
    robot = servicer(axes, SILENT, prior=WRONG)
    estimate = identify(measure(run, 0, scale=0.0), robot, SETTINGS).estimate
    error, _ = errors_of(estimate, truth_of(run))
    truth = truth_of(run)
    for part in (slice(0, 3), slice(3, 6), slice(6, None)):
        # the filter's trapezoid and the splines at 0.01 s
        assert np.max(np.abs(error[part])) <= 1e-6 * np.max(np.abs(truth[part]))


def test_noise_levels_that_are_not_stated_are_estimated_and_said():
    run = simulate('zyx', 20.0)
    record = measure(run, 1)
    stated = identify(record, servicer('zyx', prior=WRONG), SETTINGS).estimate
    silent = identify(record, servicer('zyx', SILENT, prior=WRONG), SETTINGS).estimate
    said = [note for note in silent.notes if 'is not stated' in note]
    assert [note.split()[0] for note in said] == list(STDS)
    assert not any('is not stated' in note for note in stated.notes)
    error, std = errors_of(silent, truth_of(run))
    assert np.max(np.abs(error / std)) <= 4.0
    np.testing.assert_allclose(silent.std, stated.std, rtol=0.1, atol=0)
    assert 0.9 <= silent.chi2_per_dof <= 1.1


def test_a_wrong_prior_costs_little():
    # Masses four and a half stated deviations off, heavy and light: a right file sharpens.
    run = simulate('zyx', 20.0)
    record = measure(run, 2)
    right, heavy, light = (
        identify(record, servicer('zyx', prior=prior), SETTINGS).estimate
        for prior in (1.0, 1.5, 1.0 / 1.5)
    )
    assert right.prior_factor < 0.2
    for other in (heavy, light):
        assert 1.0 < other.prior_factor < 2.0
        shift = np.concatenate([other.aam - right.aam, other.parameters - right.parameters])
        assert np.max(np.abs(shift / other.std)) < 1.0
        assert np.all(other.std < 1.4 * right.std)
        assert np.all(other.std[:3] < 1.2 * right.std[:3])
        error, std = errors_of(other, truth_of(run))
        assert np.max(np.abs(error / std)) <= 4.0


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
    estimate = identify(measure(run, 4, **rates), servicer('zyx', prior=WRONG), SETTINGS).estimate
    error, std = errors_of(estimate, truth_of(run))
    assert np.max(np.abs(error / std)) <= 4.0
    assert np.max(np.abs(error[3:6])) <= 1.5e-3 * H
    assert 0.9 <= estimate.chi2_per_dof <= 1.1


def test_joint_rates_need_not_be_measured():
    run = simulate('xyy', 20.0)
    data = measure(run, 5)
    encoders = changed(data, qd=None)
    estimate = identify(encoders, servicer('xyy', prior=WRONG), SETTINGS).estimate
    error, std = errors_of(estimate, truth_of(run))
    assert np.max(np.abs(error / std)) <= 4.0
    # no more than a tenth worse than with them
    with_rates = identify(data, servicer('xyy', prior=WRONG), SETTINGS).estimate
    assert np.max(std[3:6]) <= 1.1 * np.max(with_rates.std[:3])


@pytest.mark.parametrize('scale', [0.1, 10.0])
def test_errors_scale_with_the_noise(scale):
    run = simulate('zyx', 20.0)
    sensors = SensorSettings(**{name: scale * std for name, std in STDS.items()})
    robot = servicer('zyx', sensors, prior=WRONG)
    estimate = identify(measure(run, 6, scale), robot, SETTINGS).estimate
    error, std = errors_of(estimate, truth_of(run))
    assert np.max(np.abs(error / std)) <= 4.0
    nominal = identify(measure(run, 6), servicer('zyx', prior=WRONG), SETTINGS).estimate
    np.testing.assert_allclose(estimate.std[:3], scale * nominal.std[:3], rtol=0.25, atol=0)


def test_noise_that_is_larger_than_stated_shows():
    run = simulate('zyx', 20.0)
    estimate = identify(measure(run, 7, scale=3.0), servicer('zyx'), SETTINGS).estimate
    assert not estimate.valid
    # 9 min(z^2, 4): a residual beyond six deviations counts as one of six; splines leave 0.97
    assert estimate.chi2_per_dof == pytest.approx(0.97 * 8.28, rel=0.15)


@pytest.mark.parametrize('prior', [1.0, 1.2, WRONG])
@pytest.mark.parametrize(('duration', 'seed'), [(20.0, 8), (20.0, 9), (60.0, 8)])
def test_generic_structure(prior, duration, seed):
    run = simulate('zyx', duration)
    estimate = identify(measure(run, seed), servicer('zyx', prior=prior), GENERIC).estimate
    error, std = errors_of(estimate, truth_of(run, 'generic'))
    assert estimate.valid, estimate.reason
    assert estimate.rank <= 3 + 3 + 45 + 4
    assert estimate.unknowns == 3 + 3 + 40 + 4
    assert np.max(np.abs(error / std)) <= 4.0
    assert np.max(np.abs(error[3:6])) <= 1.5e-3 * H
