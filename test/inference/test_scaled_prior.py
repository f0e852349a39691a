"""A prior of unknown scale against quadrature over dense Gaussians; calibration on drawn data."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.stats import multivariate_normal

from spacerobot_ros.inference.scaled_prior import LARGEST, scaled_posterior


def problem(rng, rows, size, scale=1.0):
    """Drawn unknowns, rows of unit noise about them, and the prior's standard deviations."""
    std = rng.uniform(0.05, 0.5, size)
    y = scale * std * rng.standard_normal(size)
    A = rng.standard_normal((rows, size)) * 10.0 ** rng.uniform(-1.0, 2.0, size)
    return y, A, A @ y + rng.standard_normal(rows), std


def root_of(A, b):
    """(m, m) and (m,) information of rows, without a square root of the product's."""
    m = A.shape[1]
    q, r = np.linalg.qr(np.vstack([A, np.zeros((m, m))]))
    return r, q[: len(A)].T @ b


def by_quadrature(A, b, std):
    """Mean, covariance, prior variance, mean of ln s, and share of s above half of the largest."""
    m, end = A.shape[1], np.log(LARGEST)

    def moments(log_s):
        prior = np.exp(2.0 * log_s) * np.diag(std**2)
        seen = A @ prior @ A.T + np.eye(len(A))
        gain = np.linalg.solve(seen, A @ prior).T
        mean, covariance = gain @ b, prior - gain @ A @ prior
        density = np.exp(multivariate_normal.logpdf(b, cov=seen) - log0 - 0.5 * log_s**2)
        parts = [[1.0], mean, (covariance + np.outer(mean, mean)).ravel(), np.diag(prior)]
        return density * np.concatenate([*parts, [log_s, log_s > np.log(LARGEST / 2.0)]])

    grid = np.linspace(-end, end, 60)
    log0 = max(
        multivariate_normal.logpdf(b, cov=np.exp(2 * g) * (A * std**2) @ A.T + np.eye(len(A)))
        for g in grid
    )
    total = quad_vec(
        moments, -end, end, epsrel=1e-8, points=[np.log(LARGEST / 2.0), *grid[::6]], limit=2000
    )[0]
    total /= total[0]
    mean = total[1 : 1 + m]
    second = total[1 + m : 1 + m + m * m].reshape(m, m)
    prior = total[1 + m + m * m : -2]
    return mean, second - np.outer(mean, mean), prior, total[-2], total[-1]


@pytest.mark.parametrize('scale', [0.1, 0.5, 1.0, 3.0, 20.0])
@pytest.mark.parametrize(('rows', 'size'), [(1, 3), (4, 4), (12, 3), (3, 6)])
def test_equals_quadrature(rows, size, scale, rng):
    _, A, b, std = problem(rng, rows, size, scale)
    root, values = root_of(A, b)
    found = scaled_posterior(root, values, std)
    mean, covariance, prior, log_s, above = by_quadrature(A, b, std)
    wide = np.sqrt(np.diag(covariance))
    # trapezoids 0.04 apart over densities a third wide, cut off at both ends of the range
    np.testing.assert_allclose((found.mean - mean) / wide, 0.0, rtol=0, atol=0.02)
    off = (found.covariance - covariance) / np.outer(wide, wide)
    np.testing.assert_allclose(off, 0.0, rtol=0, atol=0.03)
    np.testing.assert_allclose(found.prior_variance, prior, rtol=0.03, atol=0)
    assert np.log(found.factor) == pytest.approx(log_s, abs=0.02)
    assert found.above == pytest.approx(above, abs=0.03)


@pytest.mark.parametrize('scale', [0.2, 1.0, 5.0])
@pytest.mark.parametrize('size', [3, 20])
def test_errors_have_the_stated_size(size, scale, rng):
    z, factors = [], []
    for _ in range(300):
        y, A, b, std = problem(rng, size // 2 + 2, size, scale)
        found = scaled_posterior(*root_of(A, b), std)
        z.append((found.mean - y) / np.sqrt(np.diag(found.covariance)))
        factors.append(found.factor)
    rms = np.sqrt(np.mean(np.square(z)))
    # 300 problems of 3 numbers and more; few numbers do not tell the factor, which is taken to be
    # about one: it errs to the sure side where the file is better than stated
    low, high = {0.2: (0.4, 1.05), 1.0: (0.9, 1.1), 5.0: (0.95, 2.2)}[scale]
    if size == 20:
        low, high = {0.2: (0.8, 1.05), 1.0: (0.95, 1.05), 5.0: (0.95, 1.2)}[scale]
        assert 0.7 * scale < np.median(factors) < 1.5 * scale
    assert low < rms < high


def test_on_average_over_what_is_believed_of_the_factor_it_is_exact(rng):
    squares = []
    for _ in range(1000):
        scale = 0.0
        while not 1.0 / LARGEST < scale < LARGEST:
            scale = np.exp(rng.standard_normal())
        y, A, b, std = problem(rng, 3, 4, scale)
        found = scaled_posterior(*root_of(A, b), std)
        error = found.mean - y
        squares.append(error @ np.linalg.solve(found.covariance, error) / 4.0)
    assert np.mean(squares) == pytest.approx(1.0, abs=0.1)  # 4000 squares with heavy tails


@pytest.mark.parametrize(
    ('sizes', 'rank'), [((0.0, 0.0, 0.0), 0), ((1e3, 0.0, 0.0), 1), ((1e3, 1e3, 1e-3), 2)]
)
def test_rank_is_what_data_tell_better(sizes, rank, rng):
    values = np.sqrt(1.0 + np.square(sizes)) * [1.0, -1.0, 1.0]
    found = scaled_posterior(np.diag(sizes), values, np.ones(3))
    assert found.rank == rank
    for told, variance, prior in zip(
        sizes, np.diag(found.covariance), found.prior_variance, strict=True
    ):
        if told < 1.0:
            assert variance == pytest.approx(prior, rel=0.01)
        else:
            assert variance == pytest.approx(told**-2, rel=0.05)


def test_no_data_leave_the_prior():
    std = np.array([0.1, 0.3])
    found = scaled_posterior(np.zeros((2, 2)), np.zeros(2), std)
    np.testing.assert_array_equal(found.mean, 0.0)
    np.testing.assert_allclose(found.covariance, np.diag(found.prior_variance), rtol=1e-12)
    assert found.factor == pytest.approx(1.0, rel=1e-12)
    assert found.rank == 0


@pytest.mark.parametrize(('off', 'above'), [(1.0, 0.0), (3.0, 0.0), (30.0, 1.0), (100.0, 1.0)])
def test_a_prior_far_off_is_said(off, above):
    # twelve numbers told exactly, each off by as many deviations
    found = scaled_posterior(1e4 * np.eye(12), 1e4 * off * np.ones(12), np.ones(12))
    assert found.above == pytest.approx(above, abs=0.05)
    np.testing.assert_allclose(found.mean, off, rtol=1e-3)  # whatever the prior says


def test_what_is_expected_has_the_spread_of_what_happens(rng):
    # the covariance without noise, told one larger squares, is the mean of those with noise
    _, A, _, std = problem(rng, 30, 20)
    root, values = root_of(A, np.zeros(30))
    expected = scaled_posterior(root, values, std, is_expected=True)
    mean = np.zeros(20)
    for _ in range(200):
        drawn = scaled_posterior(root, rng.standard_normal(20), std)
        mean += np.sqrt(np.diag(drawn.covariance)) / 200
    ratio = np.sqrt(np.diag(expected.covariance)) / mean
    assert np.all((ratio > 0.7) & (ratio < 1.4))
