"""Least-squares splines recover smooth signals, and pay for knots only where the noise allows."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.errors import IdentificationError
from spacerobot_ros.estimation.trajectory.splines import Samples, fit_spline


def signal(t, derivative=0):
    """Two smooth signals and their first derivatives."""
    if derivative == 0:
        return np.column_stack([np.sin(0.9 * t) + 0.3 * np.cos(2.1 * t), 0.5 * np.cos(1.3 * t)])
    return np.column_stack(
        [0.9 * np.cos(0.9 * t) - 0.63 * np.sin(2.1 * t), -0.65 * np.sin(1.3 * t)]
    )


def noisy(rng, time, std, derivative=0):
    values = signal(time, derivative)
    return Samples(time, values + std * rng.standard_normal(values.shape), std, derivative)


TIME = np.arange(0.0, 20.0001, 0.01)


def test_signal_without_noise_is_recovered():
    fit = fit_spline([Samples(TIME, signal(TIME), 1e-9)], 0.0, 20.0)
    between = np.linspace(0.0, 20.0, 3001)
    # quintic interpolation: (2.1 * 0.05 s)^6 / 1000 = 1e-9
    np.testing.assert_allclose(fit(between), signal(between), rtol=0, atol=1e-9)
    np.testing.assert_allclose(fit(between, 1), signal(between, 1), rtol=0, atol=1e-7)


def test_values_and_derivatives_are_fitted_together(rng):
    fit = fit_spline([noisy(rng, TIME, 1e-4), noisy(rng, TIME, 1e-4, derivative=1)], 0.0, 20.0)
    both = np.sqrt(np.mean((fit(TIME, 1) - signal(TIME, 1)) ** 2))
    alone = fit_spline([noisy(rng, TIME, 1e-4)], 0.0, 20.0)
    one = np.sqrt(np.mean((alone(TIME, 1) - signal(TIME, 1)) ** 2))
    assert both < 3e-5  # a third of one sample's noise
    assert both < 0.7 * one


def test_derivatives_alone_give_the_shape(rng):
    first = Samples(np.zeros(1), signal(np.zeros(1)), 1e-6)
    fit = fit_spline([first, noisy(rng, TIME, 1e-5, derivative=1)], 0.0, 20.0)
    # a random walk of 1e-5 rad/s over 2000 samples at 0.01 s: 5e-6
    np.testing.assert_allclose(fit(TIME), signal(TIME), rtol=0, atol=3e-5)


@pytest.mark.parametrize('std', [1e-2, 1e-4, 1e-6])
def test_residual_is_the_noise(std, rng):
    fit = fit_spline([noisy(rng, TIME, std), noisy(rng, TIME, std, derivative=1)], 0.0, 20.0)
    # 8000 values: standard deviation 0.016
    assert fit.chi2_per_dof == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize('std', [1e-2, 1e-4, 1e-6])
def test_error_is_below_the_noise_by_the_share_of_coefficients(std, rng):
    fit = fit_spline([noisy(rng, TIME, std)], 0.0, 20.0)
    error = np.sqrt(np.mean((fit(TIME) - signal(TIME)) ** 2))
    coefficients = 20.0 / fit.spacing + 5.0
    assert error < 2.0 * std * np.sqrt(coefficients / len(TIME))


def test_spacing_adapts_to_the_noise_and_to_the_signal(rng):
    spacings = [
        fit_spline([noisy(rng, TIME, std)], 0.0, 20.0).spacing for std in (1e-2, 1e-4, 1e-7)
    ]
    assert spacings[0] > spacings[1] > spacings[2]
    fast = np.sin(20.0 * TIME)[:, None] + 1e-3 * rng.standard_normal((len(TIME), 1))
    slow = np.sin(0.2 * TIME)[:, None] + 1e-3 * rng.standard_normal((len(TIME), 1))
    fast_fit, slow_fit = (fit_spline([Samples(TIME, x, 1e-3)], 0.0, 20.0) for x in (fast, slow))
    assert fast_fit.spacing <= 0.25  # a period is 0.31 s
    assert slow_fit.spacing >= 1.0
    assert fast_fit.chi2_per_dof == pytest.approx(1.0, abs=0.15)


def test_few_data_get_the_sparsest_spline(rng):
    time = np.linspace(0.0, 20.0, 12)
    fit = fit_spline([noisy(rng, time, 1e-9)], 0.0, 20.0)
    assert fit.spacing == pytest.approx(2.0, rel=1e-12)
    assert np.all(np.isfinite(fit(TIME)))


def test_gap_stays_finite_and_near_the_signal(rng):
    time = np.concatenate([TIME[TIME < 8.0], TIME[TIME > 10.0]])
    fit = fit_spline([noisy(rng, time, 1e-3)], 0.0, 20.0)
    inside = np.linspace(8.0, 10.0, 50)
    assert np.all(np.isfinite(fit(inside)))
    # nothing is known there; the curve stays within the signal's own size
    np.testing.assert_allclose(fit(inside), signal(inside), rtol=0, atol=1.0)


def test_two_rates_of_sampling_weigh_by_their_noise(rng):
    sparse = TIME[::10]
    poor = Samples(TIME, signal(TIME) + 0.3, 10.0)  # wrong by 0.3, but nearly without weight
    fit = fit_spline([noisy(rng, sparse, 1e-5), poor], 0.0, 20.0)
    np.testing.assert_allclose(fit(sparse), signal(sparse), rtol=0, atol=1e-4)


def test_interval_need_not_start_at_zero(rng):
    fit = fit_spline([noisy(rng, TIME + 1000.0, 1e-4)], 1000.0, 1020.0)
    np.testing.assert_allclose(fit(TIME + 1000.0), signal(TIME + 1000.0), rtol=0, atol=4e-4)


@pytest.mark.parametrize(
    'samples',
    [Samples(TIME, signal(TIME), np.inf), Samples(TIME[:0], signal(TIME)[:0], 1.0)],
    ids=['no weight', 'none'],
)
def test_samples_that_say_nothing_are_refused(samples):
    with pytest.raises(IdentificationError, match='no usable samples between 0 s and 20 s'):
        fit_spline([samples], 0.0, 20.0)


@pytest.mark.parametrize('start', [3.33, 0.0, 19.45])
def test_where_samples_pause_noise_is_not_blown_up(start, rng):
    """Steep corners ask for knots that are closer than the pause is long."""
    kept = TIME[(start >= TIME) | (start + 0.5 <= TIME)]
    steps = np.column_stack([np.abs(np.sin(3.0 * kept)), np.abs(np.cos(2.0 * kept))])
    fits = [
        fit_spline([Samples(kept, steps + 1e-4 * noise, 1e-4)], 0.0, 20.0)
        for noise in rng.standard_normal((10, *steps.shape))
    ]
    assert all(fit.spacing == fits[0].spacing < 0.2 for fit in fits)
    scatter = np.std([fit(TIME) for fit in fits], axis=0, ddof=1)
    # 230 times where a pause follows the first sample; without regard to it 500 to 29,000 times
    assert np.max(scatter) < 300 * 1e-4


@pytest.mark.parametrize('off', [0.0, 19e-3])
def test_before_the_first_sample_the_curve_stays_where_it_begins(off, rng):
    """Coefficients that a sample hardly touches would be its error times up to a million."""
    for start in rng.uniform(1.0, 6.0, 8):
        samples = noisy(rng, TIME[start <= TIME], 1e-3)
        samples.values[0] += off  # an outlier
        fit = fit_spline([samples], 0.0, 20.0)
        head, first = TIME[start > TIME], fit(samples.time[:1])
        # goes on for a period, in which an outlier may lead as far again; it led to 50 rad/s
        assert np.max(np.abs(fit(head) - first)) < 0.04
        assert not fit(head[:-1], 1).any()
